"""Photographs of every kind, wide ones among clutter, and no telemetry of the libraries that read them."""

from __future__ import annotations

import os
import shutil
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from glyphs import Photo
from recognition import Reader
from tests.contract.front_doors import ROOT, Command, environment, run_process
from tests.support.run_tables import csv_rows

TEXT, FORMAT = "1X2100H", "9A9999A"


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One photograph as files of many kinds."""
    folder = tmp_path_factory.mktemp("lot")
    shutil.copy(ROOT / "tests/data/photos/1X2100H.jpg", folder / "jfif.jfif")
    shown = Image.open(folder / "jfif.jfif").convert("L")
    grey = np.asarray(shown)
    shown.save(folder / "webp.webp", lossless=True)
    shown.save(folder / "gif.gif")
    blank = Image.fromarray(np.full_like(grey, 128))
    blank.save(folder / "pages.tif", save_all=True, append_images=[shown])
    # a dark linear camera of 16 bit with a glint
    deep = (grey.astype(np.uint16) * 12) + 300
    deep[:3, :3] = 65535
    Image.fromarray(deep).save(folder / "deep.png")
    clear = np.zeros((*grey.shape, 4), np.uint8)
    clear[..., 3] = 255 - grey
    Image.fromarray(clear).save(folder / "clear.png")
    return folder


def test_every_kind_is_read_and_what_was_done_is_noted(lot: Path, command: Command, tmp_path: Path) -> None:
    _heic(lot / "phone.HEIC")
    ended = command("read", lot, "--format", FORMAT, "--jobs", "1", "--out", tmp_path / "out.csv")
    assert (tmp_path / "out.csv").exists(), ended.out + ended.err
    texts = {row["part"]: row["text"] for row in csv_rows(tmp_path / "out.csv")}
    assert ended.status in (0, 1), ended.out + ended.err
    assert texts == dict.fromkeys(("clear", "deep", "gif", "jfif", "pages", "webp"), TEXT)
    assert "page 2 of the file's 2 was read" in ended.out
    assert "laid on white" in ended.out
    assert "passed over 1 file (1 .heic): phone.HEIC; photographs must be PNG" in ended.out + ended.err


def _heic(path: Path) -> Path:
    path.write_bytes(struct.pack(">I", 24) + b"ftypheic\0\0\0\0mif1heic" + bytes(200))
    return path


def test_a_kind_that_is_not_read_is_refused_by_name(command: Command, tmp_path: Path) -> None:
    ended = command("read", _heic(tmp_path / "part.heic"), "--jobs", "1", "--out", tmp_path / "out.csv")
    assert ended.status != 0
    assert "HEIC" in ended.out + ended.err
    assert "photographs must be PNG, JPEG, BMP, TIFF, WebP or GIF" in ended.out + ended.err


TEXT, FORMAT = "1X2100H", "9A9999A"
SERIAL_AT = (350, 300)  # x, y of its upper left corner


@pytest.fixture(scope="module")
def photo() -> Photo:
    """A real serial 260 pixels wide among 45 shapes on 840 x 560 pixels: characters are 8 % of the height."""
    rng = np.random.default_rng(5)
    frame = np.full((560, 840), 70, np.uint8)
    for _ in range(45):
        x, y, a, b = (
            int(rng.integers(low, high)) for low, high in ((0, 840), (0, 560), (15, 160), (10, 120))
        )
        colour, thick = int(rng.integers(20, 235)), int(rng.choice([-1, 2, 4]))
        if rng.random() < 0.5:
            cv2.rectangle(frame, (x, y), (x + a, y + b), colour, thick)
        else:
            cv2.ellipse(frame, (x, y), (a, b), float(rng.uniform(0, 180)), 0, 360, colour, thick)
    serial = (
        Image.open(ROOT / "tests/data/photos/1X2100H.jpg")
        .convert("L")
        .resize((260, 67), Image.Resampling.BOX)
    )
    x, y = SERIAL_AT
    frame[y : y + 67, x : x + 260] = np.asarray(serial)
    return Photo(frame)


def test_a_small_line_is_found_among_clutter(photo: Photo) -> None:
    reading = Reader(format=FORMAT).read(photo)
    assert reading.text == TEXT
    x, y = SERIAL_AT
    box = reading.box
    assert box is not None
    assert x < (box.x0_mm + box.x1_mm) / 2 < x + 260
    assert y < (box.y0_mm + box.y1_mm) / 2 < y + 67


def test_where_none_is_read_the_candidates_are_named(photo: Photo) -> None:
    pixels = photo.pixels.copy()
    x, y = SERIAL_AT
    pixels[y : y + 67, x : x + 260] = 128
    reading = Reader(format=FORMAT).read(Photo(pixels))
    assert (reading.text, reading.decision) == ("", "reject")
    assert any("several candidates" in note and "--region" in note for note in reading.notes)


def test_a_region_is_searched_first(photo: Photo) -> None:
    reading = Reader(format=FORMAT, region=(0.4, 0.5, 0.75, 0.7)).read(photo)
    assert reading.text == TEXT


def test_reading_a_photograph_leaves_no_files_of_telemetry(tmp_path: Path) -> None:
    home, temporary = tmp_path / "home", tmp_path / "temporary"
    home.mkdir()
    temporary.mkdir()
    noise = np.random.default_rng(0).integers(90, 160, (30, 60)).astype(np.uint8)
    Image.fromarray(noise).save(tmp_path / "part.png")
    changed = environment(HOME=str(home), XDG_CACHE_HOME=str(home / ".cache"), TMPDIR=str(temporary))
    # a build server's variables switch telemetry off, and would hide the fault
    plain = {name: value for name, value in changed.items() if name != "CI" and not name.startswith("ORT_")}
    asked = ("--format", "AA99", "--experts", "network", "--jobs", "1")
    done = run_process("read", tmp_path / "part.png", *asked, env=plain)
    assert done.status == 0, done.err
    left = [
        Path(folder) / name
        for top in (home, temporary)
        for folder, _, names in os.walk(top)
        for name in names
    ]
    assert not [path for path in left if path.name in {".ses", "deviceid"} or "onnxruntime" in path.name], (
        left
    )
