"""Runs over many parts, their tables, and how right they are."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
import x3pio

from glyphs.errors import FileError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap, MapError
from pipeline.batch.tables import check_output, write_rows
from pipeline.common.row import Row
from pipeline.files.npz import write_npz
from pipeline.files.parts import discover
from pipeline.files.truth import load_truth, score
from pipeline.reading.part_reader import Senses
from pipeline.reading.rows import read_part
from recognition.reading import (
    Box,
    Candidate,
    CharacterReading,
    Decision,
    MarkDepth,
    Reading,
    ReadingFlag,
)

BOX = Box(0.0, 0.0, 1.0, 1.0)


def reading(text: str, *, confidence: float = 0.97, decision: Decision = Decision.ACCEPT) -> Reading:
    characters = tuple(
        CharacterReading(
            (Candidate(c, 0.9, 0.9), Candidate("X", 0.4, 0.08), Candidate("Y", 0.1, 0.002)), BOX, depth
        )
        for c, depth in zip(text, (MarkDepth(0.23141, 0.21211, 0.25), None), strict=True)
    )
    return Reading(
        characters,
        decision,
        confidence,
        flags=ReadingFlag.DROPOUTS | ReadingFlag.TOO_SHALLOW,
        notes=("too shallow for x: 1 0.212 mm (at least 0.3)",),
        font="gothic",
        height_mm=5.0,
        raised=True,
    )


class FakeReader:
    """Reads the mean height of the top row as a number."""

    def read_height_map(self, height_map: HeightMap, *, soil: Soil | None = None, part_id: str = "") -> Any:
        value = round(float(height_map.z_mm[0].mean()))
        if value == 13:
            raise RuntimeError("a fault\nin the reader")
        if value == 14:
            raise MapError("no such thing")
        if value == 15:
            return felt(reading("15", confidence=0.2, decision=Decision.REVIEW))
        return felt(reading(str(value)))

    def read_scan(self, scan: object) -> Any:
        raise AssertionError("no scan in these tests")


def felt(found: Reading) -> Any:
    return SimpleNamespace(reading=found, lattice=None, open_lattice=None, height_map=None)


def fake_senses() -> Senses:
    readers: Any = SimpleNamespace(touch=FakeReader(), vision=None, grammar=None, told=None)
    return Senses(readers)


def stamped(folder: Path, *values: int) -> Path:
    for value in values:
        write_npz(folder / f"part-{value}.npz", HeightMap(np.full((3, 4), value, np.float32), 0.1))
    return folder


def test_one_bad_file_is_one_row(tmp_path: Path) -> None:
    stamped(tmp_path, 11, 12, 13, 14)
    (tmp_path / "part-12.npz").write_bytes(b"rubbish")
    senses = fake_senses()
    rows = [read_part(part, senses) for part in discover([tmp_path, tmp_path / "none.npz"])]
    assert [r.part for r in rows] == ["part-11", "part-12", "part-13", "part-14", "none"]
    assert [r.text for r in rows] == ["11", "", "", "", ""]
    assert [bool(r.error) for r in rows] == [False, True, True, True, True]
    for row in rows[1:]:
        assert f"{row.part}.npz" in row.error
        assert "\n" not in row.error
        assert row.decision == ""
    assert "RuntimeError" in rows[2].error
    assert rows[3].error.endswith("part-14.npz: no such thing")
    assert rows[0].seconds > 0.0


def test_a_row_tells_the_reading(tmp_path: Path) -> None:
    (row,) = (read_part(part, fake_senses()) for part in discover([stamped(tmp_path, 11)]))
    assert (row.decision, row.confidence, row.source, row.font) == ("accept", 0.97, "tactile", "gothic")
    assert (row.height_mm, row.raised) == (5.0, True)
    assert row.flags == "parts of the map are dropouts; too shallow for x: 1 0.212 mm (at least 0.3)"
    assert (row.depth_min_mm, row.depth_mean_mm) == (0.2121, 0.2314)
    assert row.depths == "1 0.212/0.231 1 ?"
    assert row.alternatives == "1:X 2:X"
    # what nobody asked for is empty
    assert (row.expected, row.verdict, row.verify_probability) == ("", "", None)
    assert (row.states, row.grade, row.grades, row.action) == ("", "", "", "")
    # without a lattice the candidates tell the rivals: 0.9 0.08 and 0.002 a place, over at least (0.982 + 0.018)^2
    assert row.rivals == "1X 0.072, X1 0.072"


def test_a_format_met_with_either_row_first_is_tried_both_ways(tmp_path: Path) -> None:
    z = np.full((4, 5), 15.0)
    z[-1], z[0] = 15.0, 77.0  # by the standard the last row is the top
    x3pio.write(tmp_path / "a.x3p", z * 1e-3, x_scale=1e-4, y_scale=1e-4)
    (row,) = (read_part(part, fake_senses()) for part in discover([tmp_path]))
    assert (row.text, row.confidence) == ("77", 0.97)
    write_npz(tmp_path / "a.npz", HeightMap(z[::-1].astype(np.float32), 0.1))
    (row,) = (read_part(part, fake_senses()) for part in discover([tmp_path / "a.npz"]))
    assert row.text == "15"


# ---------------------------------------------------------------------------------------------------- tables

ROWS = [
    Row(
        "p-0",
        "AB 1",
        "accept",
        0.93,
        "tactile",
        0.25,
        font="gothic",
        raised=True,
        alternatives="1:8B",
        depth_min_mm=0.21,
        depth_mean_mm=0.23,
        depths="A 0.21/0.23",
        expected="AB2",
        verdict="refuted",
        verify_probability=0.0004,
        states="3:mismatch 1/2",
        rivals="AB7 0.02, AB4 0.01",
        grade="C",
        grades="AC?",
        action="clean 2",
    ),
    Row("p,1", "", error='"a", ü\nline two'),
]


def test_tables_hold_the_stated_columns_first(tmp_path: Path) -> None:
    wanted = ["part", "text", "decision", "confidence", "source", "seconds", "error"]
    for suffix in (".csv", ".jsonl", ".parquet", ".CSV"):
        write_rows(ROWS, tmp_path / f"t{suffix}")
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    assert list(table[0])[:7] == wanted
    assert [(r["part"], r["text"], float(r["confidence"]), r["error"]) for r in table] == [
        (r.part, r.text, r.confidence, r.error) for r in ROWS
    ]
    # what is not known is an empty field, and null where the format has one
    assert [(r["depth_min_mm"], r["depths"]) for r in table] == [("0.21", "A 0.21/0.23"), ("", "")]
    assert [(r["verdict"], r["verify_probability"], r["action"]) for r in table] == [
        ("refuted", "0.0004", "clean 2"),
        ("", "", ""),
    ]
    lines = (tmp_path / "t.jsonl").read_text(encoding="utf-8").splitlines()
    assert [Row(**json.loads(line)) for line in lines] == ROWS
    arrow = pyarrow.parquet.read_table(tmp_path / "t.parquet")
    assert arrow.column_names[:7] == wanted
    assert [Row(**r) for r in arrow.to_pylist()] == ROWS


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".parquet"])
def test_an_empty_run_is_an_empty_table(suffix: str, tmp_path: Path) -> None:
    write_rows([], tmp_path / f"t{suffix}")
    assert (tmp_path / f"t{suffix}").is_file()
    if suffix == ".parquet":
        assert pyarrow.parquet.read_table(tmp_path / "t.parquet").num_rows == 0


def test_a_table_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.csv, \.jsonl, \.parquet"):
        check_output(tmp_path / "t.xlsx")
    with pytest.raises(FileError, match="cannot be written"):
        check_output(tmp_path / "none" / "t.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        check_output(tmp_path / "folder.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["folder.csv"]


def test_a_failed_write_leaves_the_old_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "t.csv"
    write_rows(ROWS, path)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pipeline.common.atomic.os.replace", full)
    with pytest.raises(FileError, match="No space"):
        write_rows(ROWS[:1], path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


# ----------------------------------------------------------------------------------------------------- truth


def truth_of(tmp_path: Path, content: bytes) -> dict[str, str]:
    path = tmp_path / "truth.csv"
    path.write_bytes(content)
    return load_truth(path)


@pytest.mark.parametrize(
    "content",
    [
        b"part,text\na,A1\nb,B2\n",
        b"\xef\xbb\xbfPart, Text\r\na, A1\r\n\r\nb,B2",
        b"file,serial,note\na.npz,A1,x\nb.h5,B2,y\n",
        b"text,part\nA1,a\nB2,b\n",
    ],
)
def test_truth_tables_of_several_kinds(content: bytes, tmp_path: Path) -> None:
    assert truth_of(tmp_path, content) == {"a": "A1", "b": "B2"}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"part,text\n", "no part"),
        (b"a,A1\n", "columns a, a1"),
        (b"part,text\na\n", "line 2 is not complete"),
        (b"part,text\na,A\na,B\n", "line 3 speaks of a a second time"),
        (b"part,text\n\xff\xfe,A\n", "UTF-8"),
    ],
)
def test_truth_tables_that_are_none(content: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message) as caught:
        truth_of(tmp_path, content)
    assert str(tmp_path / "truth.csv") in str(caught.value)


def test_accuracy_by_its_definition() -> None:
    truth = {"a": "ABCD1234", "b": "EFGH5678", "c": "ONE DIME", "d": "JKLM", "unread": "Z"}
    rows = [
        Row("a", "ABCD1234"),
        Row("b", "EFH5679"),  # one missing, one wrong
        Row("folder/c", "ONEDIME"),  # spaces are not stamped
        Row("d", "", error="broken"),  # four missing
        Row("stranger", "X"),
    ]
    found = score(rows, truth)
    assert (found.parts, found.parts_right, found.characters, found.edits) == (4, 2, 27, 6)
    assert found.character_accuracy == pytest.approx(1.0 - 6 / 27)
    assert found.serial_accuracy == 0.5
    assert (found.without_truth, found.not_read) == (1, 1)
    assert "77.78%" in found.describe()
    assert score([Row("a", "X" * 90)], truth).character_accuracy == 0.0
    assert "no part" in score([Row("stranger")], truth).describe()
