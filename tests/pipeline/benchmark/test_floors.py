"""Floors of readings: no mode may read the small editions of both exams worse than was stored.

    marks-exam-1-40, the first 10 parts --read--> trials --count--> counts, against designs/EDITION.*.floors.json
    marks-exam-2-96, the first 6

- A floor is a count on these parts, without any randomness: the same program gives the same counts. On another
  processor sums may be rounded differently; `SLACK` and `CAMERA_SLACK` allow for that.
- Characters, serials and accepted may not fall below their floor by more; accepted-wrong may not rise at all.
- `tighten` never loosens a floor. Floors change in a commit that changes nothing else; a test checks the history.

After an improvement, raise them and commit their files alone::

    MARKS_RAISE_FLOORS=1 pytest -n 0 tests/pipeline/benchmark/test_floors.py
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from pipeline.benchmark.analysis.groups import characters_right, group_trials
from pipeline.benchmark.exam.design import design_named
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from pipeline.common.output_paths import write_json
from pipeline.workers.options import WorkerSettings
from recognition.language.orientation import Orientation
from recognition.settings import ReaderSettings

EDITIONS = {"marks-exam-1-40": 10, "marks-exam-2-96": 6}
"""Number of parts of each edition that are read, so that a check does not take too long; another number has floors of
its own."""
MODES = ("tactile", "tactile templates", "rapidocr relief", "vision", "fused")
"""Modes that have a floor: every sense, the templates of touch alone, and the strongest peer, on the felt relief."""
RISK = 0.01
"""Risk at which the floors accept."""
SLACK = {"characters": 3, "serials": 1, "accepted": 1}
"""Characters or parts by which a count may fall below its floor, due to another processor's rounding."""
CAMERA_SLACK = {"characters": 8, "serials": 2, "accepted": 2}
"""The same for the camera, whose doubtful lines depend on rounding: the same program read 111 characters and 10 serials
of 16 parts of the second exam on one processor, and 105 and 8 on another."""


class Counts(NamedTuple):
    """Results of one mode on the edition.

    Attributes:
        characters: number of characters right.
        serials: number of serials right.
        accepted: number of serials accepted.
        accepted_wrong: number of these that are wrong.
    """

    characters: int
    serials: int
    accepted: int
    accepted_wrong: int


Floors = dict[str, Counts]


def counts_of(trials: Sequence[Trial]) -> Floors:
    """Count the trials of every mode."""
    return {
        key.mode: Counts(
            characters=sum(characters_right(t) for t in own),
            serials=sum(t.right for t in own),
            accepted=sum(t.accepted for t in own),
            accepted_wrong=sum(t.accepted and not t.right for t in own),
        )
        for key, own in group_trials(trials).items()
    }


def floors_file(edition: str) -> Path:
    """The file of an edition's floors."""
    name = f"{edition}.first-{EDITIONS[edition]}.floors.json"
    return Path(str(files("pipeline.benchmark.exam") / "designs" / name))


def load_floors(path: Path) -> Floors:
    """Load the stored floors; empty if there is no file yet."""
    if not path.exists():
        return {}
    return {mode: Counts(**counts) for mode, counts in json.loads(path.read_text("utf-8")).items()}


def save_floors(floors: Floors, path: Path) -> None:
    """Write the floors.

    Raises:
        FileError: it cannot be written.
    """
    write_json(path, {mode: counts._asdict() for mode, counts in floors.items()})


def objections(found: Floors, floors: Floors) -> list[str]:
    """List results below the floors; a mode without a floor is one objection."""
    lines: list[str] = []
    for mode, counts in found.items():
        if (floor := floors.get(mode)) is None:
            lines.append(f"{mode}: has no floor yet (give it one with MARKS_RAISE_FLOORS=1)")
            continue
        for name, slack in (CAMERA_SLACK if mode == "vision" else SLACK).items():
            here, least = getattr(counts, name), getattr(floor, name)
            if here < least - slack:
                lines.append(f"{mode}: {name} {here}, the floor is {least} (less {slack} for rounding)")
        if counts.accepted_wrong > floor.accepted_wrong:
            wrong = f"accepted but wrong {counts.accepted_wrong}, the limit is {floor.accepted_wrong}"
            lines.append(f"{mode}: {wrong}")
    return lines


def tighten(found: Floors, floors: Floors) -> Floors:
    """Tighten the floors to the results, number by number; a mode without a floor gets one."""
    tight = dict(floors)
    for mode, counts in found.items():
        *most, wrong = zip(counts, floors.get(mode, counts), strict=True)
        tight[mode] = Counts._make([*map(max, most), min(wrong)])
    return tight


ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("edition", EDITIONS)
def test_no_mode_reads_an_edition_worse_than_its_floors(edition: str, tmp_path: Path) -> None:
    parts = DesignedParts(design_named(edition), EDITIONS[edition])
    benchmark = Benchmark(parts, MODES, ReaderSettings(accept_risk=RISK, orientation=Orientation.UPRIGHT))
    # in a process of its own, which takes its many readers with it
    with WorkerSettings(jobs=1).opened(len(parts.items())) as executor:
        counts = counts_of(run_benchmark(benchmark, tmp_path, executor=executor))
    assert counts.keys() == set(MODES)
    path = floors_file(edition)
    if os.environ.get("MARKS_RAISE_FLOORS") == "1":
        save_floors(tighten(counts, load_floors(path)), path)
    assert objections(counts, load_floors(path)) == []


def _git(*arguments: str) -> str:
    ended = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False)
    if ended.returncode:
        pytest.skip(f"no history here: {ended.stderr.strip()}")
    return ended.stdout


@pytest.mark.parametrize("edition", EDITIONS)
def test_the_floors_have_only_risen_each_time_in_a_commit_of_their_own(edition: str) -> None:
    path = floors_file(edition).relative_to(ROOT)
    commits = _git("log", "--reverse", "--format=%H", "--", str(path)).split()
    versions = []
    for commit in commits:
        changed = _git("show", "--name-only", "--format=", commit).split()
        assert all(name.endswith(".floors.json") for name in changed), changed
        versions.append({m: Counts(**c) for m, c in json.loads(_git("show", f"{commit}:{path}")).items()})
    for before, after in pairwise(versions):
        assert tighten(after, before) == after  # raising the old ones to the new changes nothing of the new
