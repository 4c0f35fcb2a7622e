"""Tables of the truth, and how right readings are."""

from __future__ import annotations

from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.reading_records import ReadingRecord
from pipeline.formats.truth import Accuracy, PartTexts, load_truth


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
        (b"part,text\n\xff\xfe,A\n", "UTF-8"),
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
    found = Accuracy(PartTexts(truth))
    for row in rows:
        found.add(row)
    return found


def test_accuracy_by_its_definition() -> None:
    truth = {"a": "ABCD1234", "b": "EFGH5678", "c": "ONE DIME", "d": "JKLM", "unread": "Z"}
    rows = [
        row("a", "ABCD1234"),
        row("b", "EFH5679"),  # one missing, one wrong
        row("folder/c", "ONEDIME"),  # spaces are not stamped
        row("d", ""),  # four missing
        row("stranger", "X"),
    ]
    found = score(rows, truth)
    assert (found.parts, found.parts_right, found.characters, found.edits) == (4, 2, 27, 6)
    assert found.describe() == (
        "characters 77.78% (6 edits in 27), serials 50.00% (2 of 4); 1 without a truth, 1 of the truth not read"
    )
    assert "characters 0.00%" in score([row("a", "X" * 90)], truth).describe()
    assert "no part" in score([row("stranger", "")], truth).describe()
