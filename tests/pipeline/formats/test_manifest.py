"""Tables of parts, the list of bad parts, which is such a table, and parts out of nothing."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from glyphs.errors import FileError, MarksError
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.dies import DIES
from glyphs.stamping.faces import Face
from glyphs.stamping.layouts import LAYOUTS
from glyphs.stamping.plates import PLATES
from glyphs.stamping.variation import PRACTICES
from pipeline.cli.main import main
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.row import row_of
from pipeline.common.stamping import DieName, LayoutName, PlateName, PracticeName
from pipeline.formats.find_parts import discover
from pipeline.formats.manifest import COLUMNS, read_manifest
from pipeline.formats.npz import soil_members
from pipeline.formats.part_files import PartFiles
from pipeline.formats.photos import read_photo
from pipeline.formats.synth import SynthSpec, make_part, write_parts
from pipeline.formats.touch_file import read_height_map
from pipeline.formats.truth import load_truth
from pipeline.runs.outputs import write_quarantine
from tests.support.run_tables import csv_rows


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
        ("part,text\nA,KB\n", r"has the columns part, text; its first line must name one of height_map"),
        ("part,heightmap\nA,a.npz\n", r"'heightmap'.*rename it to height_map"),
        ("part,Height Map\nA,a.npz\n", r"'Height Map'.*rename it to height_map"),
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
        ('part,height_map\nA,"a.npz\nB,b.npz\nC,c.npz\n', r"not a CSV table after line 1 .*check its quotes"),
        ('part,height_map\nA,"a.npz\nB,b.npz"\nC,c.npz\n', r"line 3 has a line break .*under height_map"),
        ("part,height_map\nA,a\0.npz\n", r"line 2 has a line break or control character"),
        ("part,height_map\nA," + "a" * 200_000 + "\n", r"not a CSV table after line 1 \(field larger"),
        (b"\xd0\xcf\x11\xe0", r"is a workbook of an old kind; save it as .xlsx or CSV"),
        (b"PK\x03\x04", r"is not a workbook \(.xlsx\), or damaged; save its sheet as CSV"),
        ("part,height_map\n", r"holds no part"),
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


def test_a_part_depends_on_seed_and_number_alone(tmp_path: Path) -> None:
    spec = SynthSpec(format="A9", seed=7, height_mm=3.0)
    few = write_parts(spec, tmp_path / "few", parts=2)
    more = write_parts(spec, tmp_path / "more", parts=3)
    assert more[:2] == few
    for name, text in few:
        assert (tmp_path / "few" / f"{name}.png").read_bytes() == (
            tmp_path / "more" / f"{name}.png"
        ).read_bytes()
        first, second = (read_height_map(tmp_path / f / f"{name}.npz") for f in ("few", "more"))
        np.testing.assert_array_equal(first.z_mm, second.z_mm)
        assert len(text) == 2
    assert make_part(spec, 1).text == more[1][1]
    changed = make_part(SynthSpec(format="A9", seed=8, height_mm=3.0), 1)
    assert changed.text != more[1][1] or changed.height_map.shape != make_part(spec, 1).height_map.shape


def test_the_truth_stands_in_its_table_alone(tmp_path: Path) -> None:
    truth = write_parts(SynthSpec(format="99", height_mm=3.0), tmp_path / "out", parts=2)
    assert load_truth(tmp_path / "out" / "truth.csv") == dict(truth)
    files = [f"part-00{k}.{suffix}" for k in (0, 1) for suffix in ("npz", "png")]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [*files, "truth.csv"]
    with np.load(tmp_path / "out" / "part-000.npz") as content:
        assert sorted(content.files) == ["pitch_mm", "rows", "z_mm"]
    assert [*csv_rows(tmp_path / "out" / "truth.csv")[0]] == ["part", "text"]


def test_a_folder_that_is_not_empty_is_kept(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    spec = SynthSpec(format="9", height_mm=3.0)
    with pytest.raises(FileError, match="--overwrite"):
        write_parts(spec, tmp_path, parts=1)
    write_parts(spec, tmp_path, parts=1, overwrite=True)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "part-000.npz").is_file()
    with pytest.raises(FileError, match="cannot be made"):
        write_parts(spec, tmp_path / "mine.txt" / "deeper", parts=1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"format": ""},
        *({"seed": -1}, {"font": "comic"}, {"height_mm": 0.0}, {"bevel_deg": 90.0}, {"depth_mm": -0.1}),
        *({"light_elevation_deg": 0.0}, {"light_azimuth_deg": float("nan")}, {"pixel_mm": 0.0}),
        *({"die": "oval"}, {"die": "sharp", "face": Face.ROUND}, {"plate": "moon"}, {"layout": "spiral"}),
        *({"practice": "robot"}, {"practice": "hand", "variation": False}),
    ],
)
def test_what_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(MarksError, match=r"\S"):
        SynthSpec(**{"format": "9", **wrong})  # type: ignore[arg-type]


def test_a_soiled_part_is_written_whole(tmp_path: Path) -> None:
    spec = SynthSpec(format="A9", height_mm=3.0, soiling=Soiling(severity=0.7))
    write_parts(spec, tmp_path / "out", parts=2)
    soiled = make_part(spec, 1)
    assert soiled.soil is not None
    np.testing.assert_array_equal(
        read_height_map(tmp_path / "out" / "part-001.npz").z_mm, soiled.height_map.z_mm
    )
    with np.load(tmp_path / "out" / "part-001.npz") as content:
        assert sorted(content.files) == ["friction", "hardness_mpa", "pitch_mm", "rows", "soft_mm", "z_mm"]
        for name, values in soil_members(soiled.soil).items():  # half precision: eleven bits
            np.testing.assert_allclose(content[name].astype(np.float32), values, rtol=2**-11, atol=1e-7)
    photo = spec.photograph(soiled)
    back = read_photo(tmp_path / "out" / "part-001.png")
    np.testing.assert_array_equal(back.pixels, photo.pixels)
    assert photo.pitch_mm == 0.06
    assert back.pitch_mm == pytest.approx(0.06, rel=1e-4)
    width, height = soiled.height_map.size_mm
    assert photo.centre_mm == (width / 2, height / 2)
    assert photo.shape == (round(height / 0.06) + 1, round(width / 0.06) + 1)


def test_dirt_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["--parts", "1", "--format", "A9", "--height-mm", "3"]
    assert main(["synth", str(tmp_path / "a"), *common, "--dirt", "0.5", "--mix", "oil=0,pits=0"]) == 0
    with np.load(tmp_path / "a" / "part-000.npz") as content:
        assert content["soft_mm"].max() > 0.0
        assert content["friction"].min() > 0.19  # no oil
    assert main(["synth", str(tmp_path / "b"), *common, "--mix", "swarf=0.6", "--no-photo"]) == 0
    assert not (tmp_path / "b" / "part-000.png").exists()
    with np.load(tmp_path / "b" / "part-000.npz") as content:
        assert content["soft_mm"].max() == 0.0
    assert main(["synth", str(tmp_path / "c"), *common, "--dirt", "1.5"]) == 2
    assert "severity is 1.5" in capsys.readouterr().err
    assert main(["synth", str(tmp_path / "c"), *common, "--mix", "grime=-1"]) == 2
    assert "grime is -1" in capsys.readouterr().err
    for wrong, complaint in (("dust=1", "the kinds are grime"), ("oil", "write kinds and amounts")):
        assert main(["synth", str(tmp_path / "c"), *common, "--mix", wrong]) == 2
        assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "names"),
    [(DieName, DIES), (PlateName, PLATES), (PracticeName, PRACTICES), (LayoutName, LAYOUTS)],
)
def test_the_words_of_the_command_line_are_the_names_there_are(words: object, names: object) -> None:
    assert list(get_args(words)) == list(names)  # type: ignore[call-overload]
