"""Faults: calls that fail or tear, ends at any call, losses of power, damaged files, services that are killed."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.faults.explore import preloaded
from tests.faults.history import DATABASE, Arrival, Kill, judged
from tests.faults.mutated import KINDS, READ_OR_REFUSED, campaign
from tests.faults.plant import FROZEN, played
from tests.faults.power_loss import CHOICES, Call, Disk
from tests.support.postgres_server import PostgresServer
from tests.support.waiting import program

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the shim knows the calls of Linux")

SHARES = {
    "jobs": 0.1,
    "journal of lines": 0.03,
    **dict.fromkeys(("rows.csv", "rows.jsonl", "tokens"), 0.008),
    **dict.fromkeys(("evidence", "rows.parquet", "run into a store", "watched folder"), 0.001),
}


def test_nothing_acknowledged_is_lost_doubled_or_half_there(tmp_path: Path) -> None:
    program("gcc")
    figures = tmp_path / "figures.json"
    subjects = [f"{name}={share}" for name, share in SHARES.items()]
    done = preloaded(
        [*subjects, "--json", str(figures), "-v"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    assert done.returncode == 0, done.stdout[-5000:]
    found = json.loads(figures.read_text())
    assert set(found) == set(SHARES)
    for tally in found.values():
        assert tally["calls"] > 0  # else the shim was not there
        assert sum(tally["tried"].values()) > 0


def _call(op: str, path: Path, data: bytes = b"", *, inode: int = 7, second: Path | str = "") -> Call:
    return Call(op, inode, 0, data, str(path), str(second))


def test_a_loss_of_power_takes_what_was_not_synced(tmp_path: Path) -> None:
    """The usual replacement of a file: synced before it is renamed, its folder after."""
    (tmp_path / "a").write_bytes(b"old")
    new, rng = tmp_path / "new", np.random.default_rng(0)
    calls = [
        _call("O", new),
        _call("W", new, b"content"),
        _call("F", new),
        _call("R", new, second=tmp_path / "a"),
        _call("D", tmp_path),
    ]
    left = {}
    for n in range(len(calls) + 1):
        disk = Disk(tmp_path)
        for call in calls[:n]:
            disk.take(call)
        left[n] = {choice: disk.after_loss(choice, rng) for choice in CHOICES}
    assert [left[n]["strict"] for n in range(5)] == [{"a": b"old"}] * 5
    assert left[2]["names"] == {"a": b"old", "new": b""}
    assert left[2]["torn"] == {"a": b"old", "new": b"con"}
    assert left[4]["names"] == left[4]["torn"] == {"a": b"content"}
    assert all(left[5][choice] == {"a": b"content"} for choice in CHOICES)


def test_an_fsync_that_failed_has_lost_its_data(tmp_path: Path) -> None:
    disk, path = Disk(tmp_path), tmp_path / "a"
    for call in (
        _call("O", path),
        _call("D", tmp_path),
        _call("W", path, b"x"),
        _call("L", path),
        _call("F", path),
    ):
        disk.take(call)
    assert disk.after_loss("names", np.random.default_rng(0)) == {"a": b""}


EACH = 5


def test_a_damaged_file_is_read_or_refused_by_its_name(tmp_path: Path) -> None:
    found = campaign(tuple(KINDS), EACH, 7, 1, tmp_path)
    assert {kind: set(tally) - set(READ_OR_REFUSED) for kind, tally in found.items()} == {
        key: set() for key in KINDS
    }
    assert all(sum(tally.values()) == EACH for tally in found.values())
    # the changes are neither harmless nor all beyond recognition
    total = sum((tally for tally in found.values()), start=type(found["map.npz"])())
    assert all(total[came] > len(KINDS) // 2 for came in READ_OR_REFUSED)


PARTS, KILLS = 9, 1


def test_two_services_lose_double_and_reorder_nothing() -> None:
    with contextlib.closing(PostgresServer()) as server:
        outcome = played(server, "plant", parts=PARTS, kills=KILLS, database=[DATABASE, FROZEN], seed=5)
    assert not outcome.verdict.wrong, outcome.verdict
    assert outcome.parts == PARTS
    assert outcome.kills == KILLS + 2
    assert outcome.deliveries >= 3 * PARTS  # each part is read, and reviewed twice


def _arrived(*numbers: tuple[float, str, int]) -> list[Arrival]:
    return [Arrival(at_s, sender, "p", number) for at_s, sender, number in numbers]


def test_the_judge_sees_what_is_lost_doubled_and_reordered() -> None:
    whole = _arrived((0.0, "a", 1), (1.0, "b", 2))

    def wrong(
        arrivals: list[Arrival], *kills: Kill, wanted: int = 2, stored: tuple[str, ...] = ("p",)
    ) -> list[str]:
        return judged({"k": ["p"]}, {"k": stored}, {"p": wanted}, arrivals, kills, patience_s=3.0).wrong

    assert wrong(whole) == []
    assert wrong(whole, wanted=3) == ["p: 2 of 3 deliveries have arrived"]
    assert wrong(whole, stored=()) == ["k was answered and is not there: ['p']"]
    assert wrong(whole, stored=("p", "q")) == ["k has made ['p', 'q']"]
    assert wrong([*whole, *_arrived((2.0, "b", 1))]) == ["p: 1 by a, 2.00 s later by b", "p: 1 after 2"]
    again = [*whole, *_arrived((2.0, "a", 2))]
    assert wrong(again) == ["p: 2 by b, 1.00 s later by a"]
    assert wrong(again, Kill(1.5, "a", 1.5)) == wrong(again)  # not the one that had sent it
    assert wrong(again, Kill(1.5, "b", 1.5)) == []
    assert wrong(again, Kill(0.5, DATABASE, 1.2)) == []  # was away when it was to be noted
    assert wrong([*whole, *_arrived((4.0, "a", 2))]) == []
