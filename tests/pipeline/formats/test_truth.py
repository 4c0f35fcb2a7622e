"""Tables of the truth, and how right readings are."""

from __future__ import annotations

import time
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from glyphs.errors import FileError
from pipeline.common.reading_records import ReadingRecord
from pipeline.formats.truth import Accuracy, PartTexts, load_truth, read_order
from recognition.language.grammar import Grammar


def truth_of(tmp_path: Path, content: bytes) -> dict[str, str]:
    (tmp_path / "truth.csv").write_bytes(content)
    return load_truth(tmp_path / "truth.csv")


@pytest.mark.parametrize(
    "content",
    [
        b"part,text\na,A1\nb,B2\n",
        b"\xef\xbb\xbfPart, Text\r\na, A1\r\n\r\nb,B2",
        b"file,serial,note\na.npz,A1,x\nb.h5,B2,y\n",
        b"text,part\nA1,a\nB2,b\n",
        b'Teil;Seriennummer\na;"=""A1"""\nb;B2\xe2\x80\x8b\n',
        b"Part,Serial,Right serial\na,A7,A1\nb,B2,B2\nc,C3,\n",
    ],
)
def test_truth_tables_of_several_kinds(content: bytes, tmp_path: Path) -> None:
    assert truth_of(tmp_path, content) == {"a": "A1", "b": "B2"}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"part,text\n", "no part"),
        (b"a,AB\n", "columns a, ab"),
        (b"part,text\na\n", "line 2 is not complete"),
        (b"part,text\na,A\na,B\n", "line 3 names a a second time"),
        (b"\xff\xfep\0a\0r", "UTF-16"),
        (b"part,right serial\na,\n", "holds no part"),
        (
            b"part,text\na,1.23457E+11\n",
            r"line 2 holds 1\.23457E\+11, a serial that a spreadsheet has rounded",
        ),
    ],
)
def test_truth_tables_that_are_none(content: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message) as caught:
        truth_of(tmp_path, content)
    assert str(tmp_path / "truth.csv") in str(caught.value)


def row(part: str, text: str) -> ReadingRecord:
    return ReadingRecord("tactile", text, "review", 0.5, part=part)


def score(rows: list[ReadingRecord], truth: dict[str, str]) -> Accuracy:
    accuracy = Accuracy(PartTexts(truth))
    for row in rows:
        accuracy.add(row)
    return accuracy


def test_accuracy_by_its_definition() -> None:
    truth = {"a": "ABCD1234", "b": "EFGH5678", "c": "ONE DIME", "d": "JKLM", "unread": "Z"}
    rows = [
        row("a", "ABCD1234"),
        row("b", "EFH5679"),  # one missing, one wrong
        row("folder/c", "ONEDIME"),  # spaces are not stamped
        row("d", ""),  # four missing
        row("stranger", "X"),
    ]
    accuracy = score(rows, truth)
    assert (accuracy.parts, accuracy.parts_right, accuracy.characters, accuracy.edits) == (4, 2, 27, 6)
    assert accuracy.lines() == [
        "characters 77.78% (6 edits in 27), serials 50.00% (2 of 4); 1 without a truth, 1 of the truth not read",
        "wrong: b (EFGH5678 read as EFH5679), d (JKLM read as nothing)",
    ]
    assert "characters 0.00%" in score([row("a", "X" * 90)], truth).lines()[0]
    assert "no part" in score([row("stranger", "")], truth).lines()[0]
    # an empty cell, or a formula that was never computed
    empty = score([row("a", "A"), row("b", "B")], {"a": "", "b": "B"})
    assert empty.lines() == ["characters 100.00% (0 edits in 1), serials 100.00% (1 of 1); 1 without a truth"]


def test_truths_that_no_serial_of_the_format_can_be_are_named() -> None:
    accuracy = score([], {"a": "BHO193", "b": "bh0193", "c": "BH0193", "other": "X"})
    assert accuracy.outside(Grammar.parse("AA9999"), ("a", "b", "c", "d")) == [
        "a should read 'BHO193', but it does not fit the format AA9999",
        "b should read 'bh0193', but it does not fit the format AA9999",
    ]


@pytest.mark.parametrize(
    ("table", "part", "name"),
    [
        (["0001"], "2026-11-28/0001", "0001"),
        (["28/0001", "29/0001"], "lot/29/0001", "29/0001"),
        (["28/0001", "0001"], "28/0001", "28/0001"),
        (["0001", "28/0001"], "lot/28/0001", "28/0001"),
        (["28/0001", "29/0001"], "0001", None),
        (["lot/28/0001"], "0001", "lot/28/0001"),
        (["x/0001", "y/z/0001"], "0001", None),
        (["8/0001"], "28/0001", None),
        (["A/0001", "a/0001"], "A/0001", "A/0001"),
    ],
)
def test_parts_of_subfolders_find_their_line(table: list[str], part: str, name: str | None) -> None:
    assert PartTexts(dict.fromkeys(table, "")).name_of(part) == name


def workbook(path: Path, *rows: tuple[Any, ...], formats: dict[str, str] | None = None) -> Path:
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    for cell, form in (formats or {}).items():
        book.active[cell].number_format = form
    book.save(path)
    return path


def test_a_workbook_is_read_as_it_is_shown(tmp_path: Path) -> None:
    rows = (
        ("Part", "Serial", "Note"),
        ("a", 123, None),
        (7, "000124", 1.5),
        (None, None, None),
        ("c", 3.0, "x"),
    )
    path = workbook(tmp_path / "truth.xlsx", *rows, formats={"B2": "000000"})
    assert load_truth(path) == {"a": "000123", "7": "000124", "c": "3"}


def test_a_number_that_a_workbook_has_rounded_is_refused(tmp_path: Path) -> None:
    path = workbook(tmp_path / "truth.xlsx", ("part", "text"), ("a", 1234567890123456))
    with pytest.raises(
        FileError, match=r"line 2 holds 1\.23457E\+15, a serial that a spreadsheet has rounded"
    ):
        load_truth(path)


DASHES = ["KX636637-KX636655", "KX636637 - KX636655", "KX636637\u2013KX636655", "KX636637…KX636655"]


@pytest.mark.parametrize("cell", [*DASHES, "KX636637 ... KX636655"])
def test_a_range_with_any_dash_is_all_its_serials(cell: str, tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_text(f"{cell}\n", encoding="utf-8")
    order = read_order(tmp_path / "order.txt", Grammar.parse("AA999999"))
    assert all(order.holds(f"KX{number}") for number in range(636637, 636656))
    assert not order.holds("KX636656")
    assert not order.holds(cell)


@pytest.mark.parametrize(
    ("cell", "format"), [("AA12-AA15", "AA99-AA99"), ("12-34", "99-99"), ("KX15-KX12", None), ("AB-12", None)]
)
def test_a_serial_with_a_dash_is_one_serial(cell: str, format: str | None, tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_text(f"{cell}\n")
    order = read_order(tmp_path / "order.txt", None if format is None else Grammar.parse(format))
    assert (order.serials, order.ranges) == ({cell}, ())


@pytest.mark.parametrize(("cell", "format"), [("KX12-KX15", None), ("12-34", None), ("KX12-KX15", "9999")])
def test_what_may_be_a_range_or_a_serial_is_asked(cell: str, format: str | None, tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_text(f"{cell}\n")
    first, last = cell.split("-")
    told = rf"line 1: {cell} may be one serial, or all .*; write {first}\.\.{last} for a range"
    with pytest.raises(FileError, match=told):
        read_order(tmp_path / "order.txt", None if format is None else Grammar.parse(format))


@pytest.mark.parametrize(
    "lines", ["KX400:KX499", "KX400 to KX499", "kx400\nkx499", "Note", "KX40..KX49\nKX5"]
)
def test_an_order_that_no_line_of_can_be_a_serial_is_refused(lines: str, tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_text(f"{lines}\n")
    with pytest.raises(
        FileError, match=r"line 1 is .*, but it does not fit the format AA999; no other line fits"
    ):
        read_order(tmp_path / "order.txt", Grammar.parse("AA999"))


def test_an_order_may_hold_serials_of_other_parts_and_a_note(tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_text("Lot seven\nB-77\nKX400..KX402\n")
    order = read_order(tmp_path / "order.txt", Grammar.parse("AA999"))
    assert [order.holds(text) for text in ("KX401", "B-77", "KX403")] == [True, True, False]


def _workbook_of(path: Path, sheet: str) -> Path:
    """A workbook with this content of its sheet."""
    whole = workbook(path.with_name("whole.xlsx"), ("part", "text"), ("a", "B"))
    space = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for name in source.namelist():
            content = source.read(name)
            if name.endswith("sheet1.xml"):
                content = f'<worksheet xmlns="{space}"><sheetData>{sheet}</sheetData></worksheet>'.encode()
            target.writestr(name, content)
    return path


def test_a_small_table_cannot_cost_long_work(tmp_path: Path) -> None:
    table = tmp_path / "order.csv"
    table.write_text('part,serial\n"a"' + " " * 200_000 + "x,KX1\n")  # quadratic if blanks are given back
    far_row = _workbook_of(tmp_path / "far.xlsx", '<row r="2000000000"><c t="n"><v>1</v></c></row>')
    wide_line = tmp_path / "wide.csv"
    wide_line.write_text("serial" + ",a" * 20_000 + "\n")
    start = time.process_time()
    for path, problem in (
        (table, "is not a CSV table after line 1"),
        (far_row, "holds no serial"),
        (wide_line, "has over 16,384 cells in line 1"),
    ):
        with pytest.raises(FileError, match=problem):
            read_order(path)
    assert time.process_time() - start < 10.0


def test_the_time_for_a_table_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.errors._SPARE_S", 0.3)
    path = _workbook_of(tmp_path / "order.xlsx", "<row>" + "<c><v>1</v></c>" * 500_000 + "</row>")
    start = time.process_time()
    with pytest.raises(FileError, match=r"order\.xlsx: takes more than 0 s to decode"):
        read_order(path)
    assert time.process_time() - start < 10.0


def test_the_accepted_that_are_wrong_are_named() -> None:
    truth = {f"p{k}": "A1" for k in range(30)}
    rows = [replace(row(f"p{k}", "A7"), decision="accept") for k in range(30)]
    _, wrong, accepted = score([*rows[:25], *(replace(r, text="A1") for r in rows[25:])], truth).lines()
    assert wrong.startswith("wrong: p0 (A1 read as A7), p1 (A1 read as A7)")
    assert wrong.endswith("p19 (A1 read as A7) and 5 more")
    assert accepted.startswith("accepted and wrong: 25 of 30: p0, p1, ")
    (_, none) = score([replace(row("p0", "A1"), decision="accept")], truth).lines()
    assert none == "accepted and wrong: 0 of 1"
