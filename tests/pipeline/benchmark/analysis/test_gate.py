"""The gate's floors: what is worse than they allow, how they rise, and that they only ever rose."""

from __future__ import annotations

import json
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from pipeline.benchmark.analysis import gate
from pipeline.benchmark.analysis.gate import (
    EDITIONS,
    Counts,
    counts_of,
    floors_file,
    load_floors,
    objections,
    save_floors,
    tighten,
)
from pipeline.benchmark.trials import run
from pipeline.benchmark.trials.journal import Trial
from pipeline.cli.main import main

pytestmark = pytest.mark.usefixtures("inline")
FLOOR = Counts(characters=90, serials=9, accepted=5, accepted_wrong=1)
ROOT = Path(__file__).parents[4]


def test_counts_are_of_one_mode_each() -> None:
    trials = [
        Trial("a", 0, {}, "tactile", "AB12", "AB12", "accept"),
        Trial("b", 1, {}, "tactile", "AB12", "AB13", "accept"),
        Trial("b", 1, {}, "vision", "AB12", "", "reject"),
        Trial("c", 2, {}, "vision", "AB12", "AB12", "review"),
    ]
    assert counts_of(trials) == {"tactile": Counts(7, 1, 2, 1), "vision": Counts(4, 1, 0, 0)}


@pytest.mark.parametrize(
    ("found", "said"),
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
def test_what_is_worse_is_said(found: Counts, said: list[str]) -> None:
    assert objections({"tactile": found}, {"tactile": FLOOR}) == said


def test_the_camera_may_lose_a_line_to_rounding() -> None:
    assert objections({"vision": Counts(82, 7, 3, 1)}, {"vision": FLOOR}) == []
    (said,) = objections({"vision": Counts(81, 7, 3, 1)}, {"vision": FLOOR})
    assert said == "vision: characters 81, the floor is 90 (less 8 for rounding)"


def test_a_mode_without_a_floor_is_no_pass_and_one_that_is_not_read_is_not_asked() -> None:
    (said,) = objections({"tactile": FLOOR}, {"vision": FLOOR})
    assert said.startswith("tactile: has no floor yet")


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
    found = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False)
    if found.returncode:
        pytest.skip(f"no history here: {found.stderr.strip()}")
    return found.stdout


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


def test_the_command_compares_every_edition_with_its_own_floors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    right = [Trial("a", 0, {}, "tactile", "AB12", "AB12", "accept")]
    monkeypatch.setattr(run, "run_benchmark", lambda *_, **__: right)
    monkeypatch.setattr(gate, "EDITIONS", {"marks-exam-1-48": 1, "marks-exam-2-80": 1})
    monkeypatch.setattr(gate, "floors_file", lambda edition: tmp_path / f"{edition}.json")
    assert main(["benchmark", "gate"]) == 1
    assert capsys.readouterr().err.count("has no floor yet") == 2
    assert main(["benchmark", "gate", "--raise"]) == 0
    assert load_floors(tmp_path / "marks-exam-2-80.json") == {"tactile": Counts(4, 1, 1, 0)}
    assert main(["benchmark", "gate"]) == 0
    assert "no worse than the floors" in capsys.readouterr().out
    right[0] = Trial("a", 0, {}, "tactile", "AB12", "AB13", "accept")
    assert main(["benchmark", "gate"]) == 1
    assert "marks-exam-2-80, tactile: accepted but wrong 1, the limit is 0" in capsys.readouterr().err
