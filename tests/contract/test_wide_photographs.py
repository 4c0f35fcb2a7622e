"""A serial that is a small part of a photograph, among the edges of a machine."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image

from glyphs import Photo
from recognition import Reader
from tests.contract.front_doors import ROOT

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
