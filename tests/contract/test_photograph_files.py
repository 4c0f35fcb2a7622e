"""Kinds of picture files: each is read, or refused in words that say what is read."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.contract.front_doors import ROOT, Command
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
