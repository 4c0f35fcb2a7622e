"""The table on the terminal, and the exit status that goes with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from pipeline.cli.read import read
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord, RivalRecord
from pipeline.common.settings import ReadSettings
from pipeline.formats.npz import write_npz
from pipeline.runs.options import RunOptions
from pipeline.runs.read_table import table_lines
from recognition.decide.evidence import SenseEvidence
from recognition.language.lattice import Lattice
from recognition.reader import Reader
from recognition.surface import Surface
from tests.support.evidence import sense_of


def place(char: str, state: str = "read", chars: str = "", **more: Any) -> CharacterRecord:
    candidates = (CandidateRecord(char, 0.9),)
    return CharacterRecord(candidates, None, state, state_chars=tuple(chars), **more)


def record(
    part: str, text: str, decision: str, confidence: float, source: str, seconds: float, **more: Any
) -> ReadingRecord:
    return ReadingRecord(source, text, decision, confidence, part=part, seconds=seconds, **more)


FELT = place("A", depth_min_mm=0.2, depth_mean_mm=0.25)
PLAIN = record(
    "a", "AB12", "accept", 0.98, "tactile", 1.0, rivals=(RivalRecord("A812", 0.012),), characters=(FELT,)
)
DOUBT = record(
    "b",
    "AB12",
    "review",
    0.5,
    "fused",
    1.0,
    messages=("low confidence",),
    rivals=(RivalRecord("A812", 0.4),),
    characters=(
        place("A", grade="A"),
        place("B", "confused", "B8", grade="D", action="clean"),
        *(place(char, grade="A") for char in "12"),
    ),
)

pytestmark = pytest.mark.usefixtures("inline")


LONG = record(
    "line-3/2026-11-22/" + "a" * 60, "KX407251", "accept", 0.998, "tactile", 12.0, characters=(FELT,)
)
BROKEN = ReadingRecord.failed("c", "parts/c.npz: is not there; check the name")
PHOTO = record("p", "KX407251", "accept", 0.99, "vision", 1.0)
VERIFIED = record("v", "A812", "accept", 0.9, "tactile", 1.0, verdict="refuted", expected="AB12")


def test_a_column_without_a_value_is_left_out() -> None:
    assert "depth" not in table_lines([PHOTO], width=None)[0]
    assert "grade" not in table_lines([PLAIN], width=None)[0]
    assert "grade" in table_lines([PLAIN, DOUBT], width=None)[0]


@pytest.mark.parametrize("width", [80, 60, 40])
@pytest.mark.parametrize(
    "rows", [[PLAIN], [PLAIN, DOUBT, LONG, BROKEN, PHOTO] * 40, [PHOTO], [VERIFIED], [BROKEN]]
)
def test_serials_and_headings_are_whole_whatever_the_terminal(rows: list[ReadingRecord], width: int) -> None:
    lines = table_lines(rows, width=width)
    for row in rows:
        assert any(row.text in line.split() for line in lines) or not row.text
        assert any(row.part in line for line in lines)
    heading = next(line for line in lines if "text" in line)
    assert not set(heading.split()) - {"part", "text", "decision", "confidence", "verdict", "depth", "mm", "grade",
                                       "source", "seconds"}  # fmt: skip
    assert "decision" in heading
    long = [word for row in rows for word in (row.part, *row.error.split()) if len(word) + 4 > width]
    assert all(len(line) <= width for line in lines if not any(word in line for word in long))


def test_a_name_cannot_steer_the_terminal() -> None:
    assert not any(
        "\x1b" in line or "\n" in line for line in table_lines([replace(PLAIN, part="a\x1b[2J\nb")], width=80)
    )


# ------------------------------------------------------------------------------------------------- exit status

CHARS = tuple("AB18")


def feel(_: Reader, surface: Surface) -> SenseEvidence:
    """Reads A1, surely, in whatever is felt; nothing below zero."""
    if surface.height_map.z_mm.mean() < 0.0:
        raise RuntimeError("a fault")
    with np.errstate(divide="ignore"):
        return sense_of(Lattice(CHARS, np.log([[float(c == t) * 0.999 for c in CHARS] for t in "A1"])))


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("recognition.reader.Reader.feel", feel)
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
        ("B1", 1, "2 parts, 2 review, 2 refuted"),
        ("part,text\na,A1\nb,A8\n", 1, "1 confirmed, 1 refuted"),
        # three characters where two are felt: neither
        ("part,text\na,A1\nb,A18\n", 1, "1 confirmed, 1 undecided"),
        ("part,text\na,A1\n", 1, "2 accept, 1 confirmed"),
        ("part,text\na,A1\nb,A1\nc,A1\n", 0, "1 parts of wanted.csv were not read: c"),
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
    # made-up lines were read one way up only
    upright = ReadSettings(orientation="upright")
    assert read(str(parts), run=RunOptions(verify=verify, repeats=True), reading=upright) == status
    assert told in capsys.readouterr().out
