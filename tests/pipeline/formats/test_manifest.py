"""Tables of parts, good and bad, and the list of bad parts, which is such a table."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.row import row_of
from pipeline.formats.find_parts import discover
from pipeline.formats.manifest import COLUMNS, read_manifest
from pipeline.formats.part_files import PartFiles
from pipeline.runs.outputs import write_quarantine


def table(folder: Path, text: str | bytes) -> str:
    path = folder / "lot.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return str(path)


# --------------------------------------------------------------------------------------------------- good tables


def test_every_column_is_read(tmp_path: Path) -> None:
    source = table(
        tmp_path,
        "part,height_map,scan,photo,expected,format,font\n"
        'A1,a.npz,a.h5,a.png,KB74,"AA99,x",block\n'
        "A2,,,s3://lots/7/b.jpg,,,\n"
        "A3,,,c.png | more/d.png|s3://e.png,,,\n",
    )
    first, second, several = read_manifest(source)
    files = [str(tmp_path / name) for name in ("a.npz", "a.h5", "a.png")]
    assert first == PartFiles("A1", *files[:2], (files[2],), "KB74", "AA99,x", "block")
    assert second == PartFiles("A2", photos=("s3://lots/7/b.jpg",))
    assert several.files == (str(tmp_path / "c.png"), str(tmp_path / "more/d.png"), "s3://e.png")


def test_a_part_without_a_name_is_called_as_its_first_file(tmp_path: Path) -> None:
    source = table(tmp_path, "photo,height_map\np.png,lot1/a.npz\nb.png,\n,lot2/a.npz\n")
    assert [p.name for p in read_manifest(source)] == ["lot1/a", "b", "lot2/a"]


def test_files_lie_beside_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "deep").mkdir()
    monkeypatch.chdir(tmp_path)
    table(tmp_path / "deep", "height_map\na.npz\n./b.npz\n/c.npz\nfile:///d.npz\n../e.npz\n")
    files = [p.height_map for p in read_manifest("deep/lot.csv")]
    assert files == ["deep/a.npz", "deep/b.npz", "/c.npz", "/d.npz", "deep/../e.npz"]
    monkeypatch.chdir("deep")
    assert read_manifest("lot.csv")[0].height_map == "a.npz"
    assert read_manifest(f"file://{tmp_path}/deep/lot.csv")[0].height_map == f"{tmp_path}/deep/a.npz"


def test_beside_a_table_in_a_store_is_in_the_store() -> None:
    import fsspec

    store = fsspec.filesystem("memory")
    text = "height_map,part\na.npz,1\n../b.npz,2\n../../../../../etc/c.npz,3\nsub/d.npz,4\ns3://o/e.npz,5\n"
    store.pipe_file("/lots/seven/lot.csv", text.encode())
    files = [p.height_map for p in read_manifest("memory://lots/seven/lot.csv")]
    assert files == [
        "memory://lots/seven/a.npz",
        "memory://lots/b.npz",
        "memory://lots/etc/c.npz",  # above the store's root there is nothing
        "memory://lots/seven/sub/d.npz",
        "s3://o/e.npz",
    ]
    store.pipe_file("/lots/seven/bad.csv", b"name\n1\n")
    with pytest.raises(FileError, match=r"^memory://lots/seven/bad.csv: has the columns name"):
        read_manifest("memory://lots/seven/bad.csv")


# ---------------------------------------------------------------------------------------------------- bad tables


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("part,height_map\nA,a.npz\nB,b.npz\nA,c.npz\n", r"line 4 names A a second time, after line 2"),
        ("height_map,photo\na.npz,\n,b.png\na.x3p,\n", r"line 4 names a a second time, after line 2"),
        ("part,height_map\nA,a.npz\n\nB,\n", r"line 4 names no file; fill one of height_map, scan, photo"),
        ("part,height_map,remark\n,,what\n", r"line 2 names no file"),
        ("part,text\nA,KB\n", r"has the columns part, text; its first line must name one of height_map"),
        ("part,heightmap\nA,a.npz\n", r"'heightmap'.*rename it to height_map"),
        ("part,Height Map\nA,a.npz\n", r"'Height Map'.*rename it to height_map"),
        ("part,height_map,formats\nA,a.npz,AA\n", r"'formats'.*rename it to format"),
        ("parts,height_map\nA,a.npz\n", r"'parts'.*rename it to part"),
        (
            "height_map;expected\na.npz;1,2E+07\n",
            r"line 2 holds 1,2E\+07, a serial that a spreadsheet has rounded",
        ),
        (
            "height_map\n\\\\press\\lots\\a.npz\n",
            r"this system has no drive \\\\press; give file names relative",
        ),
        ("height_map,part,Part \na.npz,A,B\n", r"has two columns part"),
        ("part,height_map\nA,a,b.npz\n", r"line 2 has more fields than the first line; quote"),
        ("part,height_map\nA,lot/\n", r"line 2 names a folder"),
        ('part,height_map\nA,"a.npz\nB,b.npz\nC,c.npz\n', r"not a CSV table after line 1 .*check its quotes"),
        ('part,height_map\nA,"a.npz\nB,b.npz"\nC,c.npz\n', r"line 3 has a line break .*under height_map"),
        ("part,height_map\nA,a\0.npz\n", r"line 2 has a line break or control character"),
        ("part,height_map\nA," + "a" * 200_000 + "\n", r"not a CSV table after line 1 \(field larger"),
        (b"\xd0\xcf\x11\xe0", r"is a workbook of an old kind; save it as .xlsx or CSV"),
        (b"PK\x03\x04", r"is not a workbook \(.xlsx\), or damaged; save its sheet as CSV"),
        ("part,height_map\n", r"holds no part"),
        ("\n\n", r"has the columns none"),
        (b"", r"is empty"),
        (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), r"lot.csv: "),
    ],
)
def test_a_bad_table_is_refused_with_its_line(tmp_path: Path, text: str | bytes, told: str) -> None:
    with pytest.raises(FileError, match=told) as refused:
        read_manifest(table(tmp_path, text))
    assert refused.value.path == tmp_path / "lot.csv"
    assert refused.value.hint


def test_a_table_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="is not there"):
        read_manifest(str(tmp_path / "none.csv"))
    with pytest.raises(FileError, match=r"memory://none/at/all.csv: is not there"):
        read_manifest("memory://none/at/all.csv")


def test_columns_of_the_results_are_none_of_a_manifests_misspelled(tmp_path: Path) -> None:
    others = [name for name in row_of(ReadingRecord.failed("", "")) if name not in COLUMNS]
    source = table(tmp_path, ",".join(["height_map", *others, "problem"]) + "\na.npz\n")
    assert [p.name for p in read_manifest(source)] == ["a"]


# ---------------------------------------------------------------------------------------------------- quarantine


BAD = [
    PartFiles(
        "lot/a", "maps/a.npz", photos=("s3://lots/a.png",), expected="KB,74", format='A"9"', font="block"
    ),
    PartFiles("b", scan="https://host/b.h5?sign=1,2", photos=("/b.light-1.png", "/b.light-2.png")),
    PartFiles("ü;c", "/maps/ü;c.npz"),
]


def test_bad_parts_are_a_manifest(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    write_quarantine(path, [(part, "is damaged; copy it again") for part in BAD])
    again = read_manifest(str(path))
    assert again[0] == PartFiles(
        "lot/a", os.path.abspath("maps/a.npz"), "", ("s3://lots/a.png",), "KB,74", 'A"9"', "block"
    )
    assert again[1:] == BAD[1:]
    with path.open(encoding="utf-8", newline="") as stream:
        assert next(csv.DictReader(stream))["problem"] == "is damaged; copy it again"
    write_quarantine(path, [])
    assert not path.exists()  # nothing bad, no list


def test_names_that_no_table_holds_cost_their_part_alone(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    odd = [PartFiles("x\ny", "x\ny.npz"), PartFiles("\udcff", "\udcff.npz"), BAD[1]]
    write_quarantine(path, [(part, "is damaged,\nor worse") for part in odd])
    assert [p.name for p in read_manifest(str(path))] == ["x\\ny", "\\udcff", "b"]
    (part,) = discover(["x" * 5000 + ".npz"])
    write_quarantine(tmp_path / "long.csv", [(part, "cannot be opened")])
    assert read_manifest(str(tmp_path / "long.csv"))[0].height_map.endswith("x.npz")
