"""No mode reads the small editions of both exams worse than their floors; these only ever rose.

After an improvement, raise them and commit their files alone::

    MARKS_RAISE_FLOORS=1 pytest -n 0 tests/pipeline/benchmark/test_floors.py
"""

from __future__ import annotations

import json
import os
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from pipeline.benchmark.exam.design import design_named
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from pipeline.workers.options import WorkerSettings
from recognition.language.orientation import Orientation
from recognition.settings import ReaderSettings
from tests.support.floors import (
    EDITIONS,
    MODES,
    Counts,
    counts_of,
    floors_file,
    load_floors,
    objections,
    save_floors,
    tighten,
)

FLOOR = Counts(characters=90, serials=9, accepted=5, accepted_wrong=1)
ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("edition", EDITIONS)
def test_no_mode_reads_an_edition_worse_than_its_floors(edition: str, tmp_path: Path) -> None:
    parts = DesignedParts(design_named(edition), EDITIONS[edition])
    benchmark = Benchmark(parts, MODES, ReaderSettings(orientation=Orientation.UPRIGHT))
    # in a process of its own, which takes its many readers with it
    with WorkerSettings(jobs=1).opened(len(parts.items())) as executor:
        counts = counts_of(run_benchmark(benchmark, tmp_path, executor=executor))
    assert counts.keys() == set(MODES)
    path = floors_file(edition)
    if os.environ.get("MARKS_RAISE_FLOORS") == "1":
        save_floors(tighten(counts, load_floors(path)), path)
    assert objections(counts, load_floors(path)) == []


def test_counts_are_of_one_mode_each() -> None:
    trials = [
        Trial("a", 0, {}, "tactile", "AB12", "AB12", "accept"),
        Trial("b", 1, {}, "tactile", "AB12", "AB13", "accept"),
        Trial("b", 1, {}, "vision", "AB12", "", "reject"),
        Trial("c", 2, {}, "vision", "AB12", "AB12", "review"),
    ]
    assert counts_of(trials) == {"tactile": Counts(7, 1, 2, 1), "vision": Counts(4, 1, 0, 0)}


@pytest.mark.parametrize(
    ("counts", "problems"),
    [
        (FLOOR, []),
        (Counts(91, 9, 6, 0), []),
        (Counts(87, 8, 4, 1), []),
        (Counts(86, 9, 5, 1), ["tactile: characters 86, the floor is 90 (less 3 for rounding)"]),
        (
            Counts(99, 7, 3, 1),
            [
                "tactile: serials 7, the floor is 9 (less 1 for rounding)",
                "tactile: accepted 3, the floor is 5 (less 1 for rounding)",
            ],
        ),
        (Counts(99, 9, 9, 2), ["tactile: accepted but wrong 2, the limit is 1"]),
    ],
)
def test_what_is_worse_is_said(counts: Counts, problems: list[str]) -> None:
    assert objections({"tactile": counts}, {"tactile": FLOOR}) == problems


def test_the_camera_may_lose_a_line_to_rounding() -> None:
    assert objections({"vision": Counts(82, 7, 3, 1)}, {"vision": FLOOR}) == []
    (problem,) = objections({"vision": Counts(81, 7, 3, 1)}, {"vision": FLOOR})
    assert problem == "vision: characters 81, the floor is 90 (less 8 for rounding)"


def test_a_mode_without_a_floor_is_no_pass_and_one_that_is_not_read_is_not_asked() -> None:
    (problem,) = objections({"tactile": FLOOR}, {"vision": FLOOR})
    assert problem.startswith("tactile: has no floor yet")


def test_floors_only_tighten() -> None:
    better_and_worse = Counts(characters=95, serials=8, accepted=6, accepted_wrong=2)
    floors = tighten({"tactile": better_and_worse, "new": FLOOR}, {"tactile": FLOOR})
    assert floors == {"tactile": Counts(95, 9, 6, 1), "new": FLOOR}


def test_floors_come_back_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "floors.json"
    assert load_floors(path) == {}
    save_floors({"tactile": FLOOR}, path)
    assert load_floors(path) == {"tactile": FLOOR}


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
        assert _git("show", "--name-only", "--format=", commit).split() == [str(path)]
        versions.append({m: Counts(**c) for m, c in json.loads(_git("show", f"{commit}:{path}")).items()})
    for before, after in pairwise(versions):
        assert tighten(after, before) == after  # raising the old ones to the new changes nothing of the new
