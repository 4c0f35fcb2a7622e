"""A colour photograph without its stains: shading stays, what colour explains goes, and grey has none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.see.registered import photo_views, stainless_view
from recognition.see.stains import without_stains
from recognition.see.view import GREY, KNOWN

Floats = NDArray[np.float64]
SHAPE = (120, 300)
STEEL, RUST = np.array([0.34, 0.34, 0.36]), np.array([0.22, 0.09, 0.04])


def ring_shade() -> Floats:
    """(rows, columns) brightness of a round groove under a lamp on the left."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    depth = -3.0 * np.exp(-(((np.hypot(x - 150.0, y - 60.0) - 35.0) / 4.0) ** 2))
    return np.asarray(1.0 - 0.5 * np.gradient(depth, axis=1))


def cover() -> Floats:
    """(rows, columns) share of rust."""
    blotches = cv2.GaussianBlur(np.random.default_rng(3).normal(size=SHAPE), (0, 0), 5.0)
    return np.asarray(1.0 / (1.0 + np.exp(-blotches / blotches.std() / 0.1)))


def photo_of(linear: Floats, *, dtype: type[np.unsignedinteger] = np.uint8) -> Photo:
    """A photograph of linear brightness, with the camera's noise."""
    noisy = np.clip(linear + np.random.default_rng(1).normal(0.0, 0.004, linear.shape), 0.0, 1.0)
    return Photo(np.rint(noisy ** (1 / 2.2) * np.iinfo(dtype).max).astype(dtype), pitch_mm=0.08)


def rusty(**options: type[np.unsignedinteger]) -> Photo:
    albedo = STEEL + (RUST - STEEL) * cover()[..., None]
    return photo_of(albedo * ring_shade()[..., None], **options)


def alike(one: Floats, other: Floats) -> float:
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_rust_is_gone_and_shading_stays(dtype: type[np.unsignedinteger]) -> None:
    photo = rusty(dtype=dtype)
    clean = without_stains(photo)
    assert clean is not None
    assert alike(photo.grey(), ring_shade()) < 0.2
    assert alike(clean, ring_shade()) > 0.7
    assert abs(alike(clean, cover())) < 0.1


@pytest.mark.parametrize(
    "linear",
    [
        0.3 * (1.0 - 0.6 * cover()) * ring_shade(),  # a grey camera
        (0.3 * (1.0 - 0.6 * cover()) * ring_shade())[..., None] * np.ones(3),  # grey stains
        ring_shade()[..., None] * STEEL,  # no stains
        ring_shade()[..., None] * RUST,  # rust all over
    ],
)
def test_what_has_one_colour_has_no_stains(linear: Floats) -> None:
    assert without_stains(photo_of(linear)) is None


def test_the_view_without_stains_lies_where_the_photograph_does() -> None:
    photo = rusty()
    (first,), _ = photo_views(photo)
    clean = stainless_view(photo)
    assert clean is not None
    assert (clean.kind, clean.pitch_mm, clean.origin_mm) == (first.kind, first.pitch_mm, first.origin_mm)
    np.testing.assert_array_equal(clean.layers[KNOWN], first.layers[KNOWN])
    np.testing.assert_allclose(clean.layers[GREY], without_stains(photo), atol=1e-6)
