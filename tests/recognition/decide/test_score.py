"""The score, one probability of many quantities, and the risk that is accepted with it."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.decide import choice
from recognition.decide import risk as room
from recognition.decide.decide import decide
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.evidence import Evidence
from recognition.decide.measures import (
    Measures,
    covered_share,
    photo_measures,
    piece_nats,
    stroke_measures,
    text_measures,
    unsettled_twins,
)
from recognition.decide.reading import Reading
from recognition.decide.risk import (
    least_score,
    require_kept,
    risk_findings,
    threshold_of,
)
from recognition.decide.risk_text import parse_risk, risk_in_words
from recognition.decide.score import (
    SOURCES,
    Measure,
    RiskThreshold,
    Score,
    Term,
    log_odds,
    score_of,
    share,
)
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.marks.strokes import PlaceStrokes, RivalStrokes
from recognition.settings import ReaderSettings
from tests.support.evidence import reading_of, sense_of

# ------------------------------------------------------------------------------------------------------------- score

ODDS = Term(((-12.0, -12.0), (12.0, 12.0)))
SETTINGS = ReaderSettings(orientation=Orientation.UPRIGHT)


def photo(noise: float = 0.0) -> Photo:
    grey = np.random.default_rng(4).normal(128.0, noise, (60, 90)) if noise else np.full((60, 90), 128.0)
    return Photo(np.clip(grey, 0, 255).astype(np.uint8))


def of_photo(*, odds: float = 6.0, noise: float = 0.0) -> Reading:
    """The reading of a photograph whose text has these log odds before anything else is known."""
    sure = share(odds) ** 0.25
    lattice = Lattice(("A", "B"), np.log(np.array([[sure, (1.0 - sure) * 0.5]] * 4) + 1e-300))
    sense = sense_of(lattice, "vision", photo=photo(noise))
    return decide(Evidence.of(sense), SETTINGS)


@pytest.mark.parametrize("odds", [math.inf, -math.inf])
def test_certainty_is_no_missing_value(odds: float) -> None:
    probability = share(odds)
    measured = text_measures(odds=log_odds(probability), places=[probability], format_given=True, twins=0)
    assert (measured[Measure.ODDS], measured[Measure.LEAST_SURE]) == (math.copysign(50.0, odds), probability)
    assert Measure.ODDS not in Measures({(Measure.ODDS,): dict})


def test_log_odds_and_shares_undo_each_other() -> None:
    for belief in (1e-6, 0.3, 0.5, 0.999):
        assert share(log_odds(belief)) == pytest.approx(belief)
    assert (log_odds(1.0), log_odds(0.0), share(-math.inf)) == (math.inf, -math.inf, 0.0)


@given(st.lists(st.floats(0.01, 0.999), min_size=1, max_size=9), st.floats(0.5, 1.0), st.floats(-5.0, 20.0))
def test_the_whole_is_no_surer_than_its_least_sure_place(
    places: list[float], likely: float, bias: float
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "score_of", lambda source: Score(source, bias, {Measure.ODDS: ODDS}))
        lattice = Lattice(("A", "B"), np.log([[p, 0.5 * min(p, 1.0 - p)] for p in places]))
        scored = decide(Evidence.of(sense_of(lattice, likely=likely)), SETTINGS)
    assert scored.confidence <= min((c.confidence for c in scored.characters), default=0.0)
    if len(places) >= 4:
        assert [c.confidence for c in scored.characters] == pytest.approx(places, abs=1e-6)


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
        assert photo_measures(dark)[name] == pytest.approx(photo_measures(bright)[name], rel=0.1)


def test_strokes_are_measured_at_the_weakest_place() -> None:
    rival = RivalStrokes("B", belief=0.1, margin=1.0, apart_heights=0.5, more_heights=0.4, hidden=0.7)
    short = replace(rival, more_heights=0.1, hidden=1.0)
    places = (PlaceStrokes(0.9, 0.8), PlaceStrokes(0.4, 0.8, rivals=(rival, short)))
    assert (stroke_measures(places)[Measure.LEAST_STROKES], covered_share(places)) == (0.4, 0.7)


VALUES = {
    Measure.ODDS: st.floats(-13.0, 13.0),
    Measure.LEAST_SURE: st.floats(0.0, 1.0),
    Measure.FORMAT_GIVEN: st.sampled_from([0.0, 1.0]),
    Measure.TWINS: st.integers(0, 9),
    Measure.PIECE: st.floats(-14.0, 0.0),
    Measure.EVIDENCE: st.floats(-10.0, 15.0),
    Measure.COVERED: st.floats(0.0, 1.0),
    Measure.BY_TOUCH: st.floats(-13.0, 13.0),
}


@pytest.mark.parametrize("source", SOURCES)
@given(data=st.data())
def test_a_better_measure_never_lowers_a_score(source: str, data: st.DataObject) -> None:
    fitted = score_of(source)
    assert {Measure.ODDS} <= set(fitted.terms) <= set(VALUES)
    assert len(fitted.terms) <= 4
    values = {name: data.draw(of_measure) for name, of_measure in VALUES.items()}
    name = data.draw(st.sampled_from(sorted(VALUES)))
    falls = name in (Measure.COVERED, Measure.TWINS, Measure.PIECE)
    step = data.draw(st.floats(0.0, 2.0)) * (-1.0 if falls else 1.0)
    improved = {**values, name: values[name] + step}
    assert fitted.probability(improved) >= fitted.probability(values) - 1e-12
    assert fitted.probability(values) <= values[Measure.LEAST_SURE]


@pytest.mark.parametrize(
    ("text", "rival", "probability"), [("G3", "8", 0.2), ("G8", "3", 1e-6), ("GC", "G", 0.2)]
)
def test_a_character_that_is_a_piece_of_a_likely_one(text: str, rival: str, probability: float) -> None:
    chars = "38CG"
    log = np.log(np.full((2, len(chars)), 1e-9))
    log[range(2), [chars.index(char) for char in text]] = np.log(0.7)
    log[1, chars.index(rival)] = np.log(0.2)
    assert piece_nats(text, Lattice(tuple(chars), log)) == pytest.approx(math.log(probability))


def test_measures_of_a_text_are_those_of_its_reading() -> None:
    places = (0.99, 0.7, 0.9, 0.95)
    lattice = Lattice(("A", "B"), np.log([[p, 0.5 * (1.0 - p)] for p in places]))
    measured = decide(Evidence.of(sense_of(lattice, likely=0.9)), SETTINGS).measures
    expected = text_measures(
        odds=log_odds(math.prod(places) * 0.9), places=places, format_given=False, twins=0
    )
    assert {name: measured[name] for name in expected} == pytest.approx(expected)
    assert Measure.BY_TOUCH not in measured
    both = Evidence.of(sense_of(lattice)).joined(Evidence.of(sense_of(lattice, "vision")))
    assert decide(both, SETTINGS).measures[Measure.BY_TOUCH] == pytest.approx(log_odds(math.prod(places)))
    swapped = lattice.log_belief.copy()
    swapped[1] = np.log([0.001, 0.998])
    seen = Evidence.of(sense_of(Lattice(("A", "B"), swapped), "vision"))
    outvoted = decide(Evidence.of(sense_of(lattice)).joined(seen), SETTINGS)
    assert outvoted.plain_text == "ABAA"
    # touch holds 0.7 for A there, 0.15 for B and 0.15 for whatever it may be
    less_likely = math.prod(places) * (0.15 + 0.075) / (0.7 + 0.075)
    assert outvoted.measures[Measure.BY_TOUCH] == pytest.approx(log_odds(less_likely))


@pytest.mark.parametrize(
    ("text", "grammar", "twins"),
    [
        ("S0I7", None, 3),
        ("S0I7", Grammar(format="A9A9"), 0),
        ("S0I7", Grammar(expression="[A-Z0-9][0-9][A-Z][0-9]"), 1),
        ("S0I7", Grammar(exclude="O"), 2),
        ("AB27", None, 0),
    ],
)
def test_twins_that_the_format_does_not_tell_apart_are_counted(
    text: str, grammar: Grammar | None, twins: int
) -> None:
    assert unsettled_twins(text, grammar) == twins


TESTED = Score(
    "vision",
    0.0,
    {Measure.ODDS: ODDS},
    (RiskThreshold(0.05, 0.8, 200, 4, 0.046), RiskThreshold(0.02, 0.95, 180, 0, 0.017)),
)


def test_a_smaller_risk_takes_a_higher_score() -> None:
    assert [TESTED.threshold(risk) for risk in (0.3, 0.05, 0.049, 0.02)] == [0.8, 0.8, 0.95, 0.95]
    assert TESTED.least_risk == 0.02
    assert TESTED.threshold(0.001) is None
    assert Score("tactile", 0.0, {}).least_risk == 1.0
    for nothing in (0.0, 1.0, math.nan):
        with pytest.raises(ValueError, match="lies between 0 and 1"):
            TESTED.threshold(nothing)


@pytest.mark.parametrize("source", SOURCES)
def test_the_shipped_thresholds_keep_their_risks(source: str) -> None:
    """Each threshold has the readings that showed it, and the exact bound of their errors is within the risk."""
    tested = score_of(source).thresholds
    assert tested or source == "vision"
    for threshold in tested:
        assert threshold.bound <= threshold.risk
        assert binom.cdf(threshold.wrong, threshold.accepted, threshold.bound) == pytest.approx(
            0.05, abs=2e-3
        )
    assert [threshold.threshold for threshold in tested] == sorted(
        threshold.threshold for threshold in tested
    )


# -------------------------------------------------------------------------------------------------------------- risk

THRESHOLD = None
"""The thresholds of the fit."""


@pytest.mark.parametrize(
    ("text", "risk"),
    [
        ("0.001", 0.001),
        ("1e-3", 0.001),
        ("1/1000", 0.001),
        (" 1 in 1000 ", 0.001),
        ("1 in 1,000", 0.001),
        ("1 IN 500", 0.002),
        ("3/1000", 0.003),
    ],
)
def test_a_risk_is_a_number_or_a_share_in_words(text: str, risk: float) -> None:
    assert parse_risk(text) == pytest.approx(risk)


@pytest.mark.parametrize(
    "text", ["", "often", "0", "1", "1 in 1", "1 in 0", "2/1", "-0.1", "nan", "1 in", "9" * 5000]
)
def test_what_is_no_risk_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"between 0 and 1, such as 0\.001, 1/1000 or 1 in 1000"):
        parse_risk(text)


@pytest.mark.parametrize(
    ("risk", "words"),
    [(0.001, "1 in 1,000"), (0.005, "1 in 200"), (1 / 3000, "1 in 3,000"), (0.3, "0.3"), (0.999, "0.999")],
)
def test_a_risk_is_shown_as_one_in_so_many(risk: float, words: str) -> None:
    assert risk_in_words(risk) == words


@given(st.integers(2, 10_000_000))
def test_words_are_understood_again(parts: int) -> None:
    assert parse_risk(risk_in_words(1.0 / parts)) == pytest.approx(1.0 / parts, rel=1e-9)


@pytest.fixture
def camera_without_small_risks(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The camera keeps 1 in 500, the other senses 1 in 2,000."""
    senses = {
        source: Score(source, 0.0, {}, (RiskThreshold(risk, 0.99, 4000, 0, 0.5 * risk),))
        for source, risk in (("tactile", 0.0005), ("vision", 0.002), ("fused", 0.0005))
    }
    monkeypatch.setattr(room, "score_of", senses.__getitem__)
    threshold_of.cache_clear()
    yield
    threshold_of.cache_clear()


@pytest.mark.parametrize("source", SOURCES)
def test_each_sense_has_its_own_threshold(source: str) -> None:
    for tested in score_of(source).thresholds:
        assert least_score(source, tested.risk) == tested.threshold
        assert risk_findings(source, tested.risk) == ()


@pytest.mark.usefixtures("camera_without_small_risks")
def test_a_sense_that_keeps_no_such_risk_says_what_to_do() -> None:
    assert threshold_of("vision", 0.001) is None
    (finding,) = risk_findings("vision", 0.001)
    assert finding.flag is ReadingFlag.RISK_NOT_KEPT
    assert finding.text == (
        "the camera cannot promise 1 in 1,000 (touch the part, or allow 1 in 500 with accept_risk)"
    )
    assert least_score("vision", 0.001) == 0.999
    assert not risk_findings("vision", 0.002)
    require_kept(0.001)  # touch keeps it
    with pytest.raises(
        MarksError, match=r"the camera cannot promise 1 in 1,000; allow 1 in 500 with accept_risk"
    ):
        require_kept(0.001, ("vision",))


def test_a_risk_that_no_sense_keeps_is_refused_at_once() -> None:
    with pytest.raises(MarksError, match="no sense can promise 1 in 10,000,000"):
        ReaderSettings(accept_risk=1e-7)
