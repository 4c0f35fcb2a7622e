"""The score: one probability of many quantities, in one direction each."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from glyphs.camera.photo import Photo
from recognition.decision import score as room
from recognition.decision.decide import Decision, Finding, ReadingFlag
from recognition.decision.reading import Candidate, CharacterReading, Reading
from recognition.decision.score import (
    SOURCES,
    Measure,
    RiskError,
    RiskThreshold,
    Score,
    Term,
    log_odds,
    measures_of,
    score_of,
    serial_is_sure,
    share,
    text_measures,
    with_score,
)
from recognition.language.box import Box
from recognition.marks.strokes import PlaceStrokes, RivalStrokes

PLACE = CharacterReading((Candidate("A", 0.99999, 0.99999),), Box(0.0, 0.0, 1.0, 1.0))
ODDS = Term(((-12.0, -12.0), (12.0, 12.0)))
PLAIN = Score("vision", 0.0, {Measure.ODDS: ODDS, Measure.GRAIN: Term(((0.01, 0.0), (0.21, -20.0)))})


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


def test_a_measure_lowers_the_score() -> None:
    noisy = of_photo(noise=10.0)
    scored = with_score(noisy)
    assert scored.confidence == pytest.approx(share(6.0 - 100.0 * (measures_of(noisy)[Measure.GRAIN] - 0.01)))
    assert (scored.decision, scored.flags) == (Decision.REVIEW, ReadingFlag.LOW_CONFIDENCE)


@given(st.lists(st.floats(0.01, 0.99999), min_size=1, max_size=9), st.floats(-20.0, 40.0))
def test_the_whole_is_no_surer_than_its_least_sure_place(places: list[float], odds: float) -> None:
    characters = tuple(replace(PLACE, candidates=(Candidate("A", p, p),)) for p in places)
    scored = with_score(Reading(characters, 0.5, source="tactile").with_trace(odds=odds))
    assert scored.confidence <= min(places)
    assert [place.confidence for place in scored.characters] == places
    assert scored.with_confidence(1.0).confidence == min(places)


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


VALUES = {
    Measure.ODDS: st.floats(-13.0, 13.0),
    Measure.LEAST_SURE: st.floats(-13.0, 13.0),
    Measure.FORMAT_GIVEN: st.sampled_from([0.0, 1.0]),
    Measure.EVIDENCE: st.floats(-10.0, 15.0),
    Measure.COVERED: st.floats(0.0, 1.0),
    Measure.SAME_TEXT: st.sampled_from([0.0, 1.0]),
}


@pytest.mark.parametrize("source", SOURCES)
@given(data=st.data())
def test_a_better_measure_never_lowers_a_score(source: str, data: st.DataObject) -> None:
    fitted = score_of(source)
    assert {Measure.ODDS} <= set(fitted.terms) <= set(VALUES)
    assert len(fitted.terms) <= 4
    values = {name: data.draw(of_measure) for name, of_measure in VALUES.items()}
    name = data.draw(st.sampled_from(sorted(VALUES)))
    step = data.draw(st.floats(0.0, 2.0)) * (-1.0 if name is Measure.COVERED else 1.0)
    improved = {**values, name: values[name] + step}
    assert fitted.probability(improved) >= fitted.probability(values) - 1e-12
    assert fitted.probability(values) <= share(values[Measure.LEAST_SURE])


def test_measures_of_a_text_are_those_of_its_reading() -> None:
    places = (0.99, 0.7, 0.9)
    made = text_measures(probability=0.6, count_probability=0.9, places=places, format_given=False)
    characters = tuple(replace(PLACE, candidates=(Candidate("A", p, p),)) for p in places)
    reading = Reading(characters, 0.5).with_trace(odds=log_odds(0.6 * 0.9), evidence=0.0)
    assert {name: measures_of(reading)[name] for name in made} == pytest.approx(made)
    with_format = reading.with_trace(evidence=-0.01)
    assert measures_of(with_format)[Measure.FORMAT_GIVEN] == 1.0


TESTED = Score(
    "vision",
    0.0,
    {Measure.ODDS: ODDS},
    (RiskThreshold(0.05, 0.8, 200, 4, 0.046), RiskThreshold(0.02, 0.95, 180, 0, 0.017)),
)


def test_a_smaller_risk_takes_a_higher_score() -> None:
    assert [TESTED.threshold(risk) for risk in (0.3, 0.05, 0.049, 0.02)] == [0.8, 0.8, 0.95, 0.95]
    assert TESTED.least_risk == 0.02
    with pytest.raises(RiskError, match="the camera cannot promise 1 in 1,000") as error:
        TESTED.threshold(0.001)
    assert "accept a risk of 0.02 or more" in str(error.value.hint)
    assert Score("tactile", 0.0, {}).least_risk == 1.0
    for nothing in (0.0, 1.0, math.nan):
        with pytest.raises(ValueError, match="lies between 0 and 1"):
            TESTED.threshold(nothing)


@pytest.mark.parametrize("source", SOURCES)
def test_the_shipped_thresholds_keep_their_risks(source: str) -> None:
    """Each threshold has the readings that showed it, and the exact bound of their errors is within the risk."""
    tested = score_of(source).thresholds
    assert tested or source == "vision"
    for one in tested:
        assert one.bound <= one.risk
        assert binom.cdf(one.wrong, one.accepted, one.bound) == pytest.approx(0.05, abs=2e-3)
    assert [one.threshold for one in tested] == sorted(one.threshold for one in tested)
