"""The accepted risk: how it is written, the threshold that keeps it, and a sense that keeps none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.errors import MarksError
from recognition.decide import risk as room
from recognition.decide.decision import ReadingFlag
from recognition.decide.risk import (
    least_score,
    require_kept,
    risk_findings,
    threshold_of,
)
from recognition.decide.risk_text import parse_risk, risk_in_words
from recognition.decide.score import SOURCES, RiskThreshold, Score, score_of
from recognition.settings import ReaderSettings

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
