"""Photographs laid over each other: known motions are found whatever the light, and what is unlike is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.stamping.stamp import StampedPart
from recognition.see.registered import photo_views
from recognition.see.view import GREY, KNOWN

SHIFT, TURN_DEG = (5.0, -3.0), 0.8
WITHIN_PIXELS = 0.4
"""Of the known motion: strokes are five pixels wide, and looks a quarter of that apart are alike."""


def lit(part: StampedPart, azimuth_deg: float, *, seed: int) -> NDArray[np.float32]:
    """Brightness of the part with mottled paint on it, the lamp on one side."""
    gy, gx = np.gradient(part.height_map.z_mm.astype(np.float64), part.height_map.pitch_mm)
    paint = cv2.GaussianBlur(np.random.default_rng(0).normal(size=gx.shape), (0, 0), 4.0)
    a = np.radians(azimuth_deg)
    shade = 1.0 - 0.6 * (np.cos(a) * gx + np.sin(a) * gy)
    noise = np.random.default_rng(seed).normal(0.0, 3.0, gx.shape)
    return np.asarray(110.0 * shade * np.exp(2.0 * paint) + noise, dtype=np.float32)


def taken(grey: NDArray[np.float32]) -> Photo:
    return Photo(np.rint(np.clip(grey, 0, 255)).astype(np.uint8), pitch_mm=0.08)


@pytest.fixture(scope="module")
def part(make_part: Callable[..., StampedPart]) -> StampedPart:
    return make_part("K7B29")


@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 180.0])
def test_a_known_motion_is_found_whatever_the_light(part: StampedPart, azimuth_deg: float) -> None:
    steady = lit(part, 0.0, seed=1)
    rows, columns = steady.shape
    motion = cv2.getRotationMatrix2D((columns / 2, rows / 2), TURN_DEG, 1.0)
    motion[:, 2] += SHIFT
    other = lit(part, azimuth_deg, seed=2)
    moved = cv2.warpAffine(other, motion, (columns, rows), borderMode=cv2.BORDER_REPLICATE)
    views, left_out = photo_views(replace(taken(steady), others=(taken(moved),)))
    assert len(views) == 2
    assert not left_out
    back, known = views[1].layers[GREY], views[1].layers[KNOWN] > 0.0
    # laid back it is the photograph before it was moved: what differs is less than a small shift would make
    off = np.abs(back - other / 255.0)[known].mean()
    aside = cv2.warpAffine(
        other, np.array([[1.0, 0.0, WITHIN_PIXELS], [0.0, 1.0, WITHIN_PIXELS]]), (columns, rows)
    )
    assert off < np.abs(aside - other)[known].mean() / 255.0 + 3.0 / 255.0
    assert known.mean() > 0.9


def test_what_shows_something_else_is_left_out(
    part: StampedPart, make_part: Callable[..., StampedPart]
) -> None:
    rng = np.random.default_rng(5)
    steady = lit(part, 0.0, seed=1)
    noise = cv2.GaussianBlur(rng.normal(size=steady.shape), (0, 0), 3.0)
    unlike = np.asarray(110.0 * np.exp(2.0 * noise), dtype=np.float32)
    views, left_out = photo_views(
        replace(taken(steady), others=(taken(unlike), taken(lit(part, 90.0, seed=3))))
    )
    assert len(views) == 2
    assert left_out == (2,)


def test_photographs_of_one_part_are_of_one_size() -> None:
    with pytest.raises(MarksError, match="30 x 40 and 40 x 30 pixels; take them from one place"):
        Photo(np.zeros((30, 40), np.uint8), others=(Photo(np.zeros((40, 30), np.uint8)),))
