"""A run into a store keeps every part once, however often the same command is given."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from PIL import Image

from glyphs import stamp
from tests.contract.front_doors import Command


def photograph(path: Path, text: str) -> None:
    Image.fromarray(stamp(text, fonts="gothic", height_mm=4.0, seed=3).photograph().pixels).save(path)


def stored(folder: Path) -> list[str]:
    with sqlite3.connect(folder / "parts.db") as connection:
        return [text for (text,) in connection.execute("select upper(text_folded) from parts order by id")]


def test_the_same_run_given_again_keeps_no_part_twice(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plates").mkdir()
    photograph(tmp_path / "plates" / "a.png", "K7")
    run = ("read", "plates", "--format", "A9", "--mode", "vision", "--jobs", "1")
    first = command(*run, "--out", "sqlite:///parts.db")
    assert (first.status, stored(tmp_path)) == (0, ["K7"])
    # its journal is gone: the store alone knows
    assert not list(tmp_path.glob("tactile-marks-*"))
    again = command(*run, "--out", "sqlite:///parts.db")
    assert (again.status, stored(tmp_path)) == (0, ["K7"])
    assert "1 parts were in the store already" in again.out
    # another plate under the name of the first is another part
    photograph(tmp_path / "plates" / "a.png", "M4")
    assert command(*run, "--out", "sqlite:///parts.db").status == 0
    assert stored(tmp_path) == ["K7", "M4"]
