"""A serial that is a small part of a large photograph; a large one without any."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from glyphs.camera.photo import Photo
from recognition.find.wide import find_wide
from recognition.reader import Reader
from recognition.see.photo_sizes import LARGE, shrunk
from recognition.see.view import photo_view
from tests.benchmarks.wide_frames import clutter, framed

SERIAL = Path(__file__).parents[2] / "data" / "photos" / "1X2100H.jpg"
SHAPE = (3000, 4000)


@pytest.fixture(scope="module")
def ground() -> np.ndarray:
    return clutter(SHAPE, np.random.default_rng(4))


@pytest.mark.parametrize("share", [0.19, 0.3])
def test_a_small_part_of_a_large_photograph_is_read(ground: np.ndarray, share: float) -> None:
    plate = cv2.imread(str(SERIAL), cv2.IMREAD_GRAYSCALE)
    whole = (0.0, 0.0, float(plate.shape[1]), float(plate.shape[0]))
    frame, (x0, y0, x1, y1) = framed(plate, whole, share, ground, np.random.default_rng(1))
    reading = Reader(format="9A9999A").read(Photo(frame))
    assert reading.text == "1X2100H"
    assert reading.box is not None
    x, y = (reading.box.x0_mm + reading.box.x1_mm) / 2, (reading.box.y0_mm + reading.box.y1_mm) / 2
    assert abs(x - (x0 + x1) / 2) < 0.1 * (x1 - x0)
    assert abs(y - (y0 + y1) / 2) < 0.3 * (y1 - y0)
    assert reading.trace.photo is not None
    rows, columns = reading.trace.photo.shape
    assert columns / rows == pytest.approx(SHAPE[1] / SHAPE[0], rel=1e-3)  # all of it


def test_noise_of_a_large_photograph_is_no_line() -> None:
    noise = np.random.default_rng(2).normal(120.0, 2.0, SHAPE)
    view = photo_view(shrunk(Photo(np.rint(noise).astype(np.uint8)), LARGE))
    assert all(line.score < 1.0 for line in find_wide(view))
    assert math.prod(view.layers.shape[1:]) == pytest.approx(LARGE, rel=0.01)
