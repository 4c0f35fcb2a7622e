"""The decision without one of its rules."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import pytest

from pipeline.benchmark.readers.modes import expand_groups, leave_out, open_mode, rules
from pipeline.common.settings import SettingsError
from recognition.decision.decide import BROKEN, MEASURE_FLAGS, Decision, ReadingFlag
from recognition.decision.score import SOURCES, Measure, score_of, with_score
from recognition.reader import Reader
from tests.support.readings import reading_of

SURE = reading_of("AB", source="tactile", threshold=0.97)


def test_every_contract_and_term_has_a_name() -> None:
    terms = {term for source in SOURCES for term in score_of(source).terms} - {Measure.ODDS}
    assert set(rules().values()) == {*(BROKEN & ~MEASURE_FLAGS), MEASURE_FLAGS, *terms}
    assert {"unread-marks", "format-not-met", "mark-rules"} <= set(rules())


def test_without_a_contract_a_reading_that_broke_it_alone_is_accepted() -> None:
    for name, rule in rules().items():
        if isinstance(rule, ReadingFlag):
            broken = replace(SURE, flags=rule)
            assert broken.decision is Decision.REVIEW
            assert leave_out(name)(broken).decision is Decision.ACCEPT
            other = ReadingFlag.UNREAD_MARKS if name != "unread-marks" else ReadingFlag.NOT_WHOLE
            assert leave_out(name)(replace(broken, flags=rule | other)).decision is Decision.REVIEW


def test_without_a_term_its_quantity_counts_as_usual(monkeypatch: pytest.MonkeyPatch) -> None:
    term = next(one for one in score_of("tactile").terms if one is not Measure.ODDS)
    worst = min(score_of("tactile").terms[term].points, key=lambda point: point[1])[0]
    measures = {Measure.ODDS: 9.0, term: worst}
    monkeypatch.setattr("recognition.decision.score.measures_of", lambda _: MappingProxyType(measures))
    whole = with_score(SURE)
    less = leave_out(term.name.lower().replace("_", "-"))(whole)
    assert less.confidence > whole.confidence
    assert less.confidence == score_of("tactile").probability({Measure.ODDS: 9.0})


def test_each_mode_is_also_read_without_each_rule() -> None:
    named = expand_groups(("tactile", "vision", "rapidocr relief"), ablate=("unread-marks", "strokes"))
    assert named[3:] == (
        "tactile without unread-marks", "vision without unread-marks",
        "tactile without strokes", "vision without strokes",
    )  # fmt: skip
    assert open_mode(named[3], Reader(format="A9")).uses == ("touch",)
    with pytest.raises(SettingsError, match="no rule 'luck' to leave out; the rules are mismatch"):
        open_mode("tactile without luck", Reader(format="A9"))
