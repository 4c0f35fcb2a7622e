"""Folders of files: every file is a part's, or is counted and named as passed over."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glyphs import stamp
from pipeline import NothingFoundError, discover, read_height_map, write_photo
from tests.contract.front_doors import Command
from tests.support.run_tables import csv_rows


@pytest.fixture
def exports(tmp_path: Path) -> Path:
    """A folder as an instrument leaves it; its one .npz holds nothing that can be read."""
    folder = tmp_path / "lot"
    folder.mkdir()
    (folder / "a.npz").write_bytes(b"no archive")
    for name in ("b.heic", "c.txt", "notes.docx", "d.xlsx", "no_suffix"):
        (folder / name).write_bytes(b"x")
    Image.new("L", (20, 20)).save(folder / "lone.png")
    Image.new("L", (20, 20)).save(folder / "a.png")
    (folder / ".hidden").write_bytes(b"x")
    return folder


def test_files_that_are_passed_over_are_counted_and_named(exports: Path, command: Command) -> None:
    summary = exports.parent / "summary.json"
    ended = command("read", exports, "--format", "A9", "--summary", summary, "--jobs", "1")
    said = next(line for line in ended.out.splitlines() if line.startswith("passed over"))
    assert said.startswith("passed over 5 files (1 .docx, 1 .heic, 1 .txt, 1 .xlsx, 1 no suffix): ")
    for name in ("b.heic", "c.txt", "notes.docx", "d.xlsx", "no_suffix"):
        assert name in said
    assert json.loads(summary.read_text())["passed_over"][".heic"] == 1
    by_touch = command("read", exports, "--format", "A9", "--mode", "tactile", "--jobs", "1").out
    assert "passed over 6 files (1 .docx, 1 .heic, 1 .png" in by_touch
    assert "lone photographs are read without --mode" in by_touch


def test_every_part_of_a_tree_is_read_by_the_senses_that_it_has_files_for(
    height_map: Path, tmp_path: Path, command: Command
) -> None:
    days = tmp_path / "days"
    for place in ("tray-1", "tray-2/night"):
        (days / place).mkdir(parents=True)
    shutil.copy(height_map, days / "1.npz")
    shutil.copy(height_map, days / "tray-1" / "1.npz")
    write_photo(days / "tray-1" / "1.png", stamp("K7", fonts="gothic", height_mm=4.0, seed=3).photograph())
    shutil.copy(days / "tray-1" / "1.png", days / "tray-2" / "night" / "1.png")
    rows = tmp_path / "rows.csv"
    assert (
        command("read", days, "--format", "A9", "--font", "gothic", "--jobs", "1", "--out", rows).status == 0
    )
    read = {row["part"]: (row["text"], row["source"]) for row in csv_rows(rows)}
    assert read == {"1": ("K7", "tactile"), "tray-1/1": ("K7", "fused"), "tray-2/night/1": ("K7", "vision")}


def test_a_folder_without_parts_says_what_lies_in_it(exports: Path) -> None:
    (exports / "a.npz").unlink()
    (exports / "a.png").unlink()
    (exports / "lone.png").unlink()
    with pytest.raises(NothingFoundError, match=r"passed over 5 files .*b\.heic"):
        discover([exports])


def test_heights_in_pictures_are_parts_where_they_are_said_to_be(exports: Path) -> None:
    names = {part.name: part.height_map for part in discover([exports], height_images=True)}
    assert names["lone"] == str(exports / "lone.png")


def test_a_float_tiff_is_read_as_heights(height_map: Path, tmp_path: Path, command: Command) -> None:
    plate = read_height_map(height_map)
    Image.fromarray(np.asarray(plate.z_mm)).save(tmp_path / "K7.tif")
    flags = ("--format", "A9", "--font", "gothic", "--height-mm", "4", "--jobs", "1")
    ended = command("read", tmp_path, *flags, "--height-image", "--pitch-mm", f"{plate.pitch_mm}")
    assert (ended.status, "K7" in ended.out) == (0, True)
    ended = command("read", tmp_path, *flags)
    assert "not a photograph; read heights with --height-image" in ended.out


def test_a_csv_of_heights_is_a_part_and_no_list_of_parts(
    height_map: Path, tmp_path: Path, command: Command
) -> None:
    plate = read_height_map(height_map)
    y, x = np.indices(plate.z_mm.shape) * plate.pitch_mm
    rows = np.column_stack([x.ravel(), y.max() - y.ravel(), plate.z_mm.ravel()])
    np.savetxt(tmp_path / "part.csv", rows, "%.4f", ";", header="x;y;z", comments="")
    flags = ("--format", "A9", "--font", "gothic", "--height-mm", "4", "--jobs", "1")
    ended = command("read", tmp_path / "part.csv", *flags)
    assert (ended.status, "K7" in ended.out) == (0, True)
