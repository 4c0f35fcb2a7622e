"""The score: one probability of many quantities, in one direction each."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.decide import score as room
from recognition.decide.decision import Decision, Finding, ReadingFlag
from recognition.decide.reading import Candidate, CharacterReading, Reading
from recognition.decide.score import (
    SOURCES,
    Measure,
    Score,
    Term,
    log_odds,
    measures_of,
    score_of,
    serial_is_sure,
    share,
    with_score,
)
from recognition.language.box import Box
from recognition.marks.strokes import PlaceStrokes, RivalStrokes
from recognition.settings import ReaderSettings

PLACE = CharacterReading((Candidate("A", 0.999, 0.999),), Box(0.0, 0.0, 1.0, 1.0))
ODDS = Term(0.0, ((-12.0, -12.0), (12.0, 12.0)))
PLAIN = Score(0.0, {Measure.ODDS: ODDS, Measure.GRAIN: Term(0.01, ((0.01, 0.0), (0.21, -20.0)))})


def of_photo(*, odds: float = 6.0, noise: float = 0.0) -> Reading:
    grey = np.random.default_rng(4).normal(128.0, noise, (60, 90)) if noise else np.full((60, 90), 128.0)
    made = Reading((PLACE,), 0.5, source="vision", threshold=0.98)
    return made.with_trace(photo=Photo(np.clip(grey, 0, 255).astype(np.uint8)), odds=odds)


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "score_of", lambda source: PLAIN)


@pytest.mark.parametrize(("odds", "accepted"), [(math.inf, True), (-math.inf, False)])
def test_certainty_is_no_missing_value(odds: float, accepted: bool) -> None:
    assert (with_score(of_photo(odds=odds)).decision is Decision.ACCEPT) == accepted
    assert with_score(of_photo(odds=odds)).confidence != pytest.approx(0.5)


def test_log_odds_and_shares_undo_each_other() -> None:
    for belief in (1e-6, 0.3, 0.5, 0.999):
        assert share(log_odds(belief)) == pytest.approx(belief)
    assert (log_odds(1.0), log_odds(0.0), share(-math.inf)) == (math.inf, -math.inf, 0.0)


def test_what_keeps_a_sure_text_from_acceptance_is_named() -> None:
    noisy = of_photo(noise=10.0)
    grain = measures_of(noisy)[Measure.GRAIN]
    made = with_score(noisy)
    assert made.confidence == pytest.approx(share(6.0 - 100.0 * (grain - 0.01)))
    assert made.decision is Decision.REVIEW
    assert made.messages() == (
        f"unlike most parts: grain of the photograph {grain:.2g}, usually 0.01 (look at the part)",
    )
    # where the text is in doubt by itself, that is said
    doubtful = with_score(of_photo(odds=2.0, noise=10.0))
    assert doubtful.flags == ReadingFlag.LOW_CONFIDENCE
    assert doubtful.findings == ()


def test_what_explains_a_low_score_goes_with_it() -> None:
    missing = Finding(ReadingFlag.STROKES_MISSING, "most strokes are missing: A at place 1 (clean it)")
    assert with_score(of_photo().with_findings(missing)).messages() == ()
    assert with_score(of_photo(odds=1.0).with_findings(missing)).messages()[-1] == missing.text


def test_a_broken_contract_stays_whatever_the_score() -> None:
    made = with_score(of_photo().with_findings(Finding(ReadingFlag.UNREAD_MARKS, "another line reads “SN8”")))
    assert made.decision is Decision.REVIEW
    assert not serial_is_sure(made)
    shallow = with_score(of_photo().with_findings(Finding(ReadingFlag.TOO_SHALLOW, "too shallow")))
    assert shallow.decision is Decision.REVIEW
    assert serial_is_sure(shallow)


def test_nothing_read_has_no_score() -> None:
    empty = replace(of_photo(), characters=(), confidence=0.0)
    assert with_score(empty) is empty


def test_grain_does_not_depend_on_exposure() -> None:
    noisy = of_photo(noise=10.0)
    assert noisy.trace.photo is not None
    darker = noisy.with_trace(photo=Photo((noisy.trace.photo.pixels // 2).astype(np.uint8)))
    for name in (Measure.GRAIN, Measure.PATCHES):
        assert measures_of(darker)[name] == pytest.approx(measures_of(noisy)[name], rel=0.1)


def test_strokes_are_measured_at_the_weakest_place() -> None:
    rival = RivalStrokes("B", belief=0.1, margin=1.0, apart_heights=0.5, more_heights=0.4, hidden=0.7)
    short = replace(rival, more_heights=0.1, hidden=1.0)
    places = (PlaceStrokes(0.9, 0.8), PlaceStrokes(0.4, 0.8, rivals=(rival, short)))
    found = measures_of(Reading((PLACE,) * 2, 0.5).with_trace(strokes=places))
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
        assert given.of(source).accept_confidence == score_of(source).threshold(0.005)
    assert ReaderSettings().of("tactile") == ReaderSettings()
    with pytest.raises(MarksError, match="was not tested"):
        ReaderSettings(accept_risk=1e-7)
