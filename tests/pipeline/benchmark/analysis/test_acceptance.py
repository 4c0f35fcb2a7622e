"""Acceptance at a risk: thresholds come from other soils, and only parts that break no contract count."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.benchmark.analysis.acceptance import RiskAcceptance, acceptance_at_risks
from pipeline.benchmark.analysis.groups import group_trials
from pipeline.benchmark.analysis.statistics import statistics_of
from pipeline.benchmark.report.writing import document_of
from pipeline.benchmark.trials.journal import Trial

SOILS = ("rust", "mud", "paint")
PARTS = 400
"""Parts of each soil: those of two soils can prove 1 in 100, which takes 628 accepted ones with 2 wrong."""


def trials(mode: str = "tactile") -> list[Trial]:
    """Of every soil 350 sure and right, 50 doubtful ones, of which half are wrong."""
    made = []
    for soil in SOILS:
        for k in range(PARTS):
            sure = k < 350
            text = "A1" if sure or k % 2 else "B1"
            confidence = 0.995 if sure else 0.6
            made.append(Trial(f"{soil}-{k}", k, {"soil": soil}, mode, "A1", text, "review", confidence))
    return made


def at_risk(rows: list[Trial], *risks: float) -> list[RiskAcceptance]:
    return list(acceptance_at_risks(group_trials(rows).items(), risks))


def test_the_threshold_of_other_soils_is_used_whatever_the_reader_decided() -> None:
    (found,) = at_risk(trials(), 0.01)
    assert (found.risk, found.accepted.count, found.accepted.total) == (0.01, 1050, 1200)
    assert (found.wrong_of_accepted.count, found.wrong_of_accepted.total) == (0, 1050)
    assert 0.6 < found.least[0] <= found.least[1] <= 0.995


def test_wrong_ones_of_the_soil_left_out_are_counted_and_do_not_move_its_own_threshold() -> None:
    rows = [
        replace(t, text="B1") if t.levels["soil"] == "mud" and t.confidence > 0.9 and t.number < 2 else t
        for t in trials()
    ]
    (found,) = at_risk(rows, 0.01)
    assert found.wrong_of_accepted.count == 2
    assert found.accepted.count == 1050


def test_a_reading_that_breaks_a_contract_is_never_accepted() -> None:
    rows = [replace(t, broken=t.number % 2 == 0) for t in trials()]
    rows[1] = replace(rows[1], error="FileError: x", text="")
    rows[3] = replace(rows[3], decision="reject")
    (found,) = at_risk(rows, 0.01)
    assert (found.accepted.count, found.accepted.total) == (598, 1200)


@pytest.mark.parametrize(
    ("rows", "risk"),
    [(trials(), 0.001), ([t for t in trials() if t.levels["soil"] == "mud"], 0.01)],
    ids=["too few parts", "one soil"],
)
def test_what_cannot_be_proven_has_no_row(rows: list[Trial], risk: float) -> None:
    assert at_risk(rows, risk) == []


def test_the_tables_name_risk_thresholds_and_what_was_accepted() -> None:
    document = document_of(statistics_of(trials()))
    line = next(line for line in document.splitlines() if "| 1 in 100 |" in line)
    assert line == "| tactile | 1 in 100 | 0.65 | 87.5 | 0 of 1050 (0.3) |"
    assert "1 in 1,000" not in document
