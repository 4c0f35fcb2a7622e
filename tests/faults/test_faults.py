"""Writes, fsyncs and renames that fail or tear, ends at any call, losses of power: a sample of `explore`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.faults.explore import preloaded
from tests.faults.power_loss import CHOICES, Call, Disk
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
