"""The book of trials: what it takes up and what it refuses; what a mode is charged for."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType

import pytest

from glyphs.errors import FileError
from pipeline.benchmark.trials.journal import FORMAT_VERSION, Trial, TrialJournal, answer_of
from recognition.decision.flags import ReadingFlag
from recognition.decision.reading import Decision, Reading

DESCRIPTION = {"seed": 1}
TRIAL = Trial(
    "p",
    0,
    {"severity": 0.3, "font": "gothic"},
    "tactile",
    "A1",
    "A1",
    compute_s=1.0,
    simulated_s=0.25,
)


def with_heading(folder: Path, **changed: object) -> Path:
    """A book of one part whose first line says something else."""
    book = TrialJournal.open(folder, DESCRIPTION)
    book.add("p", (TRIAL,))
    first, rest = book.path.read_text(encoding="utf-8").split("\n", 1)
    heading = {k: v for k, v in {**json.loads(first), **changed}.items() if v is not None}
    book.path.write_text(f"{json.dumps(heading)}\n{rest}", encoding="utf-8")
    return book.path


def test_a_book_tells_its_format_and_comes_back_as_it_was(tmp_path: Path) -> None:
    path = with_heading(tmp_path)
    assert json.loads(path.read_text(encoding="utf-8").split("\n")[0])["format_version"] == FORMAT_VERSION
    (found,) = TrialJournal.open(tmp_path, DESCRIPTION).done["p"]
    assert asdict(found) == asdict(TRIAL)


@pytest.mark.parametrize(
    ("version", "told"),
    [
        (FORMAT_VERSION + 1, "has format version 4; this program writes 3; update this program"),
        (None, "has format version 1; this program writes 3; name another folder"),
        ("new", 'has format version "new"; this program writes 3; name another folder'),
    ],
)
def test_a_book_of_another_format_is_refused_and_kept(tmp_path: Path, version: object, told: str) -> None:
    path = with_heading(tmp_path, format_version=version)
    before = path.read_bytes()
    with pytest.raises(FileError) as refused:
        TrialJournal.open(tmp_path, DESCRIPTION)
    assert told in str(refused.value)
    assert path.read_bytes() == before


def test_a_mode_is_charged_for_what_it_needs_and_the_scan_is_told_apart() -> None:
    steps = {"mount": 0.125, "scan": 0.5, "edge map": 0.25, "search": 1.0}
    reading = Reading((), Decision.REJECT, 0.0, ReadingFlag.NO_CHARACTERS, seconds=MappingProxyType(steps))
    trial = replace(Trial("p", 0, {}, "m", "A"), **answer_of(reading), compute_s=4.0)
    assert (trial.compute_s, trial.simulated_s, trial.reading_s) == (4.0, 0.625, 3.375)


def test_a_reading_that_tells_no_steps_is_all_reading() -> None:
    trial = replace(TRIAL, simulated_s=0.0)
    assert trial.reading_s == trial.compute_s
    # a clock's steps may add up to a little more than what was measured around them
    assert replace(TRIAL, simulated_s=2.0).reading_s == 0.0
