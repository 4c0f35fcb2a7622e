"""Blank, blurred and noisy pictures have no edges; faint marks and small ones have."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.part import stamp
from recognition.see.edges_seen import PictureFault, has_edges, picture_fault

GREY = 1.0 / 255.0
SHAPE = (300, 400)


def taken(brightness: NDArray[np.float64] | float, *, noise: float = 2.0, seed: int = 1) -> Photo:
    """A photograph of this brightness, grey levels, with noise."""
    grey = brightness + np.random.default_rng(seed).normal(0.0, noise, SHAPE)
    return Photo(np.clip(np.rint(grey), 0, 255).astype(np.uint8))


def written(contrast: float, height: float = 1.0) -> NDArray[np.float64]:
    """Grey levels of a line of text; the height is a factor."""
    picture = np.full(SHAPE, 120, dtype=np.uint8)
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
    assert picture_fault(taken(brightness, noise=noise)) is fault


def test_a_photograph_without_a_sharp_edge_is_out_of_focus() -> None:
    shaded = np.linspace(60.0, 160.0, SHAPE[1]) + np.zeros(SHAPE)
    assert picture_fault(taken(shaded)) is PictureFault.OUT_OF_FOCUS


@pytest.mark.parametrize("height", [0.4, 1.0, 2.5])
def test_faint_and_small_text_has_edges(height: float) -> None:
    assert picture_fault(taken(written(12.0, height))) is None


def test_one_light_that_shows_edges_is_enough() -> None:
    dark, lit = taken(0.0), taken(written(60.0))
    assert picture_fault(Photo(dark.pixels, others=(lit,))) is None
    assert picture_fault(Photo(dark.pixels, others=(dark,))) is PictureFault.NO_CONTRAST


def test_a_flat_map_has_no_edges_and_a_stamped_one_has() -> None:
    rough = np.random.default_rng(2).normal(0.0, 1e-3, SHAPE).astype(np.float32)
    assert not has_edges(rough, step=2e-4)
    rough[40:60, 50:80] = np.nan
    assert not has_edges(rough, step=2e-4)
    assert has_edges(stamp("K7B2", fonts="gothic", seed=1).height_map.z_mm.astype(np.float32), step=2e-4)
