"""The table on the terminal, and the exit status that goes with it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from pipeline.batch.read_table import notes, print_table
from pipeline.cli.read import read
from pipeline.common.row import Row
from pipeline.files.npz import write_npz
from recognition.lattice import Lattice
from recognition.reading import Box, Candidate, CharacterReading, Decision, Reading

PLAIN = Row("a", "AB12", "accept", 0.98, "tactile", 1.0, rivals="A812 0.012", depth_min_mm=0.2)
DOUBT = Row(
    "b",
    "AB12",
    "review",
    0.5,
    "fused",
    1.0,
    flags="a character is uncertain",
    states="2:confused B/8",
    rivals="A812 0.400",
    grade="D",
    grades="ADAA",
    action="clean 2",
)


def test_a_plain_run_has_the_usual_columns(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([PLAIN])
    head, line = capsys.readouterr().out.splitlines()
    assert head.split() == ["part", "text", "decision", "confidence", "depth", "source", "seconds", "notes"]
    assert line.split() == ["a", "AB12", "accept", "0.980", "0.200", "tactile", "1.00"]


def test_doubts_stand_in_the_notes(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([PLAIN, DOUBT])
    shown = capsys.readouterr().out
    assert "grade" in shown.splitlines()[0]
    assert "verdict" not in shown
    assert "a character is uncertain; 2:confused B/8; or A812 0.400; clean 2" in shown


def test_long_notes_are_not_cut_off_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    long = "; ".join(f"note {k}" for k in range(60))
    print_table([Row("a" * 60, "AB12", "review", flags=long), DOUBT])
    assert f"{long}" in capsys.readouterr().out


def test_verdicts_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    refuted = Row("b", "A812", "accept", 0.9, "tactile", 1.0, flags="place 2: 8 stands where B is expected")
    refuted = Row(
        **{**refuted.__dict__, "verdict": "refuted", "expected": "AB12", "states": "2:mismatch 8/B"}
    )
    assert notes(refuted) == "place 2: 8 stands where B is expected; expected AB12"
    undecided = Row(**{**refuted.__dict__, "verdict": "undecided", "verify_probability": 0.98, "flags": ""})
    assert notes(undecided) == "AB12 with probability 0.980"
    print_table([refuted, Row("c", error="broken")])
    shown = capsys.readouterr().out
    assert "verdict" in shown.splitlines()[0]
    assert shown.splitlines()[1].split()[:5] == ["b", "A812", "accept", "0.900", "refuted"]


# ------------------------------------------------------------------------------------------------- exit status

CHARS = tuple("AB18")


class FakeReader:
    """Reads A1, surely, in whatever is felt; nothing below zero."""

    def __init__(self, *_: object, **__: object) -> None:
        pass

    def read_height_map(self, height_map: HeightMap, **_: object) -> Any:
        if height_map.z_mm.mean() < 0.0:
            raise RuntimeError("a fault")
        with np.errstate(divide="ignore"):
            lattice = Lattice(CHARS, np.log([[float(c == t) * 0.999 for c in CHARS] for t in "A1"]))
        box = Box(0.0, 0.0, 1.0, 1.0)
        characters = tuple(CharacterReading((Candidate(t, 0.9, 0.999),), box) for t in "A1")
        found = Reading(characters, Decision.ACCEPT, 0.998)
        return SimpleNamespace(reading=found, lattice=lattice, open_lattice=lattice, height_map=height_map)


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pipeline.reading.readers.Reader", FakeReader)
    folder = tmp_path / "parts"
    folder.mkdir()
    for name, height in (("a", 0.0), ("b", 1.0)):
        write_npz(folder / f"{name}.npz", HeightMap(np.full((5, 6), height, np.float32), 0.1))
    return folder


@pytest.mark.parametrize(
    ("table", "status", "told"),
    [
        (None, 0, "2 parts, 2 accept\n"),
        ("A1", 0, "2 parts, 2 accept, 2 confirmed"),
        ("B1", 1, "2 parts, 2 accept, 2 refuted"),
        ("part,text\na,A1\nb,A8\n", 1, "1 confirmed, 1 refuted"),
        # three characters where two are felt: neither
        ("part,text\na,A1\nb,A18\n", 1, "1 confirmed, 1 undecided"),
        ("part,text\na,A1\n", 1, "2 accept, 1 confirmed"),
        ("part,text\na,A1\nb,A1\nc,A1\n", 0, "1 of the table of wanted.csv not read: c"),
        # a character that nobody looked for is an error of its row
        ("part,text\na,A1\nb,X1\n", 1, "1 confirmed, 1 with an error"),
    ],
)
def test_verified_parts_and_the_exit_status(
    table: str | None, status: int, told: str, parts: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verify = table
    if table is not None and "," in table:
        Path("wanted.csv").write_text(table, encoding="utf-8")
        verify = "wanted.csv"
    assert read(str(parts), verify=verify) == status
    assert told in capsys.readouterr().out


def test_a_fault_is_status_1(parts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_npz(parts / "c.npz", HeightMap(np.full((5, 6), -1.0, np.float32), 0.1))
    assert read(str(parts)) == 1
    assert "1 with an error" in capsys.readouterr().out
    assert read(str(parts), verify="A1") == 1
