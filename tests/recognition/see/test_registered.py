"""Photographs that show no edges, and photographs laid over each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.part import stamp
from glyphs.stamping.stamp import StampedPart
from recognition.see.edges_seen import PictureFault, has_edges, picture_fault
from recognition.see.registered import photo_views
from recognition.see.view import GREY, KNOWN

# -------------------------------------------------------------------------------------------------------- registered

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


# -------------------------------------------------------------------------------------------------------- edges seen

PICTURE_SHAPE = (300, 400)


def noisy_photo(brightness: NDArray[np.float64] | float, *, noise: float = 2.0, seed: int = 1) -> Photo:
    """A photograph of this brightness, grey levels, with noise."""
    grey = brightness + np.random.default_rng(seed).normal(0.0, noise, PICTURE_SHAPE)
    return Photo(np.clip(np.rint(grey), 0, 255).astype(np.uint8))


def written(contrast: float, height: float = 1.0) -> NDArray[np.float64]:
    """Grey levels of a line of text; the height is a factor."""
    picture = np.full(PICTURE_SHAPE, 120, dtype=np.uint8)
    cv2.putText(picture, "KXB4071", (60, 150), cv2.FONT_HERSHEY_SIMPLEX, height, 220, 2)
    return 120.0 + (picture.astype(np.float64) - 120.0) * (contrast / 100.0)


@pytest.mark.parametrize(
    ("brightness", "noise", "fault"),
    [
        (0.0, 0.0, PictureFault.NO_CONTRAST),
        (0.0, 3.0, PictureFault.NO_CONTRAST),
        (128.0, 10.0, PictureFault.NO_CONTRAST),
        (255.0, 0.0, PictureFault.OVEREXPOSED),
    ],
)
def test_a_blank_photograph_has_a_fault(brightness: float, noise: float, fault: PictureFault) -> None:
    assert picture_fault(noisy_photo(brightness, noise=noise)) is fault


def test_a_photograph_without_a_sharp_edge_is_out_of_focus() -> None:
    shaded = np.linspace(60.0, 160.0, PICTURE_SHAPE[1]) + np.zeros(PICTURE_SHAPE)
    assert picture_fault(noisy_photo(shaded)) is PictureFault.OUT_OF_FOCUS


@pytest.mark.parametrize("height", [0.4, 1.0, 2.5])
def test_faint_and_small_text_has_edges(height: float) -> None:
    assert picture_fault(noisy_photo(written(12.0, height))) is None


def test_one_light_that_shows_edges_is_enough() -> None:
    dark, lit = noisy_photo(0.0), noisy_photo(written(60.0))
    assert picture_fault(Photo(dark.pixels, others=(lit,))) is None
    assert picture_fault(Photo(dark.pixels, others=(dark,))) is PictureFault.NO_CONTRAST


def test_a_flat_map_has_no_edges_and_a_stamped_one_has() -> None:
    rough = np.random.default_rng(2).normal(0.0, 1e-3, PICTURE_SHAPE).astype(np.float32)
    assert not has_edges(rough, step=2e-4)
    rough[40:60, 50:80] = np.nan
    assert not has_edges(rough, step=2e-4)
    assert has_edges(stamp("K7B2", fonts="gothic", seed=1).height_map.z_mm.astype(np.float32), step=2e-4)
