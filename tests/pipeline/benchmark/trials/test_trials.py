"""The book of trials: what it takes up and what it refuses; what a mode is charged for."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType

import pytest

from pipeline.benchmark.trials.journal import Trial, TrialJournal, answer_of
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.reading import Reading

DESCRIPTION = {"seed": 1}
TRIAL = Trial(
    "p", 0, {"severity": 0.3, "font": "gothic"}, "tactile", "A1", "A1", compute_s=1.0, simulated_s=0.25
)


def test_a_book_comes_back_as_it_was(tmp_path: Path) -> None:
    with TrialJournal(tmp_path, DESCRIPTION) as book:
        book.keep("p", (TRIAL,))
    for again in (TrialJournal.read(tmp_path), TrialJournal(tmp_path, DESCRIPTION)):
        (found,) = again.done["p"]
        assert asdict(found) == asdict(TRIAL)


def test_a_book_that_may_not_be_written_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with TrialJournal(tmp_path, DESCRIPTION) as book:
        book.keep("p", (TRIAL,))
    monkeypatch.setattr("os.access", lambda *_: False)  # the tests may run as root
    before = book.path.stat().st_mtime_ns
    assert "p" in TrialJournal.read(tmp_path).done
    assert book.path.stat().st_mtime_ns == before


def test_a_mode_is_charged_for_what_it_needs_and_the_scan_is_told_apart() -> None:
    steps = {"mount": 0.125, "scan": 0.5, "edge map": 0.25, "search": 1.0}
    reading = Reading((), 0.0, (Finding.of(ReadingFlag.NO_CHARACTERS),), seconds=MappingProxyType(steps))
    trial = replace(Trial("p", 0, {}, "m", "A"), **answer_of(reading), compute_s=4.0)
    assert (trial.compute_s, trial.simulated_s, trial.reading_s) == (4.0, 0.625, 3.375)


def test_a_reading_that_tells_no_steps_is_all_reading() -> None:
    trial = replace(TRIAL, simulated_s=0.0)
    assert trial.reading_s == trial.compute_s
    # a clock's steps may add up to a little more than what was measured around them
    assert replace(TRIAL, simulated_s=2.0).reading_s == 0.0
