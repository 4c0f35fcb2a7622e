"""The score: one probability of many quantities, in one direction each."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.decide import choice, score_judges
from recognition.decide import score as room
from recognition.decide.decide import decide
from recognition.decide.decision import Decision, Finding, ReadingFlag
from recognition.decide.evidence import Evidence
from recognition.decide.reading import Reading
from recognition.decide.score import (
    SOURCES,
    Measure,
    Score,
    Term,
    log_odds,
    measures_of,
    score_of,
    share,
)
from recognition.decide.score_judges import low_confidence
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.marks.strokes import PlaceStrokes, RivalStrokes
from recognition.settings import ReaderSettings
from tests.support.evidence import sense_of, text_of
from tests.support.readings import reading_of

ODDS = Term(0.0, ((-12.0, -12.0), (12.0, 12.0)))
PLAIN = Score(0.0, {Measure.ODDS: ODDS, Measure.GRAIN: Term(0.01, ((0.01, 0.0), (0.21, -20.0)))})
SETTINGS = ReaderSettings(accept_confidence=0.98, orientation=Orientation.UPRIGHT)


def photo(noise: float = 0.0) -> Photo:
    grey = np.random.default_rng(4).normal(128.0, noise, (60, 90)) if noise else np.full((60, 90), 128.0)
    return Photo(np.clip(grey, 0, 255).astype(np.uint8))


def of_photo(*, odds: float = 6.0, noise: float = 0.0) -> Reading:
    """The reading of a photograph whose text has these log odds before anything else is known."""
    sure = share(odds) ** 0.25
    lattice = Lattice(("A", "B"), np.log(np.array([[sure, (1.0 - sure) * 0.5]] * 4) + 1e-300))
    sense = sense_of(lattice, "vision", photo=photo(noise))
    return decide(Evidence.of(sense), SETTINGS)


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (room, choice, score_judges):
        monkeypatch.setattr(module, "score_of", lambda source: PLAIN)


@pytest.mark.parametrize("odds", [math.inf, -math.inf])
def test_certainty_is_no_missing_value(odds: float) -> None:
    assert measures_of(odds=odds)[Measure.ODDS] == math.copysign(50.0, odds)
    assert Measure.ODDS not in measures_of()


def test_log_odds_and_shares_undo_each_other() -> None:
    for belief in (1e-6, 0.3, 0.5, 0.999):
        assert share(log_odds(belief)) == pytest.approx(belief)
    assert (log_odds(1.0), log_odds(0.0), share(-math.inf)) == (math.inf, -math.inf, 0.0)


def test_what_keeps_a_sure_text_from_acceptance_is_named() -> None:
    noisy = of_photo(noise=10.0)
    grain = noisy.measures[Measure.GRAIN]
    assert noisy.confidence == pytest.approx(share(6.0 - 100.0 * (grain - 0.01)), abs=1e-4)
    assert noisy.decision is Decision.REVIEW
    assert noisy.messages() == (
        f"unlike most parts: grain of the photograph {grain:.2g}, usually 0.01 (look at the part)",
    )
    # where the text is in doubt by itself, that is said
    doubtful = of_photo(odds=2.0, noise=10.0)
    assert doubtful.flags == ReadingFlag.LOW_CONFIDENCE
    assert not any("unlike" in message for message in doubtful.messages())
    # and so is what speaks against it
    contract = Finding(ReadingFlag.UNREAD_MARKS, "another line reads “SN8”")
    text = text_of("A", score=noisy.confidence, measures=noisy.measures)
    assert any("unlike" in finding.text for finding in low_confidence(text, ()))
    assert not any("unlike" in finding.text for finding in low_confidence(text, (contract,)))


def test_a_broken_contract_stays_whatever_the_score() -> None:
    unread = reading_of("A", 0.999, flags=ReadingFlag.UNREAD_MARKS, threshold=0.98)
    assert unread.decision is Decision.REVIEW
    assert not unread.serial_is_sure
    shallow = reading_of("A", 0.999, flags=ReadingFlag.TOO_SHALLOW, threshold=0.98)
    assert shallow.decision is Decision.REVIEW
    assert shallow.serial_is_sure


def test_nothing_read_has_no_score_and_is_measured_all_the_same() -> None:
    empty = decide(Evidence.of(sense_of(None, "vision", photo=photo(10.0))), SETTINGS)
    assert (empty.confidence, empty.text) == (0.0, "")
    assert empty.measures[Measure.GRAIN] > 0.0


def test_measures_travel_between_processes() -> None:
    measures = of_photo(noise=10.0).measures
    assert pickle.loads(pickle.dumps(measures)) == measures
    assert measures[Measure.CONFIDENCE] == pytest.approx(of_photo(noise=10.0).confidence, abs=1e-6)


def test_grain_does_not_depend_on_exposure() -> None:
    bright = photo(10.0)
    dark = Photo((bright.pixels // 2).astype(np.uint8))
    for name in (Measure.GRAIN, Measure.PATCHES):
        assert measures_of(photo=dark)[name] == pytest.approx(measures_of(photo=bright)[name], rel=0.1)


def test_strokes_are_measured_at_the_weakest_place() -> None:
    rival = RivalStrokes("B", belief=0.1, margin=1.0, apart_heights=0.5, more_heights=0.4, hidden=0.7)
    short = replace(rival, more_heights=0.1, hidden=1.0)
    places = (PlaceStrokes(0.9, 0.8), PlaceStrokes(0.4, 0.8, rivals=(rival, short)))
    found = measures_of(strokes=places)
    assert (found[Measure.LEAST_STROKES], found[Measure.COVERED]) == (0.4, 0.7)


@pytest.mark.parametrize("source", SOURCES)
@given(data=st.data())
def test_a_better_quantity_never_lowers_a_score(source: str, data: st.DataObject) -> None:
    fitted = score_of(source)
    better = {
        Measure.ODDS, Measure.CAMERA, Measure.FORMAT, Measure.LEAST_STROKES, Measure.STROKES,
    }  # fmt: skip
    values = {
        name: data.draw(st.floats(term.points[0][0] - 1.0, term.points[-1][0] + 1.0))
        for name, term in fitted.terms.items()
    }
    name = data.draw(st.sampled_from(sorted(fitted.terms)))
    step = data.draw(st.floats(0.0, 2.0)) * (1 if name in better else -1)
    improved = {**values, name: values[name] + step}
    assert fitted.probability(improved) >= fitted.probability(values) - 1e-12


@pytest.mark.parametrize("source", SOURCES)
def test_a_smaller_risk_asks_for_a_higher_score(source: str) -> None:
    fitted = score_of(source)
    asked = [fitted.threshold(risk) for risk in (0.05, 0.01, 0.005, 0.003)]
    assert asked == sorted(set(asked))
    # between two that were tried the stricter one holds
    assert fitted.threshold(0.004) == fitted.threshold(0.003)
    for nothing_known in (1e-7, 1.0):
        with pytest.raises(MarksError, match="was not tested"):
            fitted.threshold(nothing_known)


def test_each_sense_has_its_own_threshold_for_a_risk() -> None:
    given = ReaderSettings(accept_risk=0.005)
    for source in SOURCES:
        assert given.least_score(source) == score_of(source).threshold(0.005)
        assert ReaderSettings().least_score(source) == ReaderSettings().accept_confidence
    with pytest.raises(MarksError, match="was not tested"):
        ReaderSettings(accept_risk=1e-7)
