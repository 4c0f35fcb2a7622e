"""Photographs without stains and of slopes: relief stays and what was painted goes."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.see.registered import photo_views, stainless_view
from recognition.see.slopes import slope_picture
from recognition.see.stains import without_stains
from recognition.see.view import GREY, KNOWN

# ------------------------------------------------------------------------------------------------------------ slopes

Floats = NDArray[np.floating]
GROOVES = Path(__file__).parents[4] / "shared" / "data" / "grooves"
SHAPE = (120, 300)
AROUND = (20.0, 110.0, 200.0, 290.0)


def ring() -> Floats:
    """Slopes (2, rows, columns) of a round groove."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    depth = -3.0 * np.exp(-(((np.hypot(x - 150.0, y - 60.0) - 35.0) / 4.0) ** 2))
    return np.stack(np.gradient(depth)[::-1])


def stain() -> Floats:
    """Reflectance of a mottled coat, three times as bright here as there; nowhere white in a photograph."""
    return np.exp(1.5 * cv2.GaussianBlur(np.random.default_rng(3).normal(size=SHAPE), (0, 0), 3.0) * 3.0)


def under(azimuth_deg: float, *, seed: int, exposure: float = 1.0) -> Floats:
    """A matt, stained plate under one lamp, with the camera's noise."""
    a = np.radians(azimuth_deg)
    gx, gy = ring()
    shade = np.maximum(1.0 - 0.5 * (np.cos(a) * gx + np.sin(a) * gy), 0.02)
    noise = np.random.default_rng(seed).normal(0.0, 0.004, SHAPE)
    return np.asarray(np.clip(0.2 * exposure * stain() * shade + noise, 0.0, 1.0), dtype=np.float32)


def alike(one: Floats, other: Floats) -> float:
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


def test_flanks_show_and_stains_do_not() -> None:
    picture = slope_picture([under(a, seed=k) for k, a in enumerate(AROUND)])
    steepness = np.hypot(*ring())
    # 1 but for noise and the camera's blur
    assert alike(1.0 - picture, steepness) > 0.8
    assert abs(alike(picture, np.log(stain()))) < 0.1


def test_exposures_a_fifth_apart_hardly_matter() -> None:
    gains = (1.0, 0.8, 1.2, 0.9)
    plain = slope_picture([under(a, seed=k) for k, a in enumerate(AROUND)])
    mixed = slope_picture(
        [under(a, seed=k, exposure=g) for k, (a, g) in enumerate(zip(AROUND, gains, strict=True))]
    )
    assert alike(plain, mixed) > 0.8


@pytest.mark.parametrize(
    "photographs",
    [
        [under(20.0, seed=k) for k in range(6)],
        [under(20.0, seed=k, exposure=e) for k, e in enumerate((0.4, 0.8, 1.5, 3.0))],  # white in places
        [under(a, seed=k) for k, a in enumerate(AROUND[:3])],
    ],
    ids=["a burst under one light", "exposures under one light", "three lights"],
)
def test_what_shows_no_slopes_makes_no_view(photographs: list[Floats]) -> None:
    assert slope_picture(photographs) is None


@pytest.mark.skipif(not GROOVES.is_dir(), reason="the measured grooves are not beside this checkout")
def test_real_grooves_show_as_they_were_measured() -> None:
    """Six photographs of three grooves against their measured relief: better than the edges of any one of them."""
    measured = np.load(GROOVES / "grooves.npz")
    heights = cv2.GaussianBlur(measured["z_mm"].astype(np.float64), (0, 0), 1.0)
    gy, gx = np.gradient(heights, float(measured["pitch_mm"]))
    steepness = np.hypot(gx - np.median(gx), gy - np.median(gy))
    steepness = np.minimum(steepness, np.percentile(steepness, 99.0))
    photographs = [
        cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).astype(np.float32) / np.float32(255.0)
        for path in sorted(GROOVES.glob("image*.png"))
    ]
    picture = slope_picture(photographs)
    found = alike(1.0 - picture, steepness)
    edges = []
    for one in photographs:
        log = np.log(one + 0.02)
        size = cv2.GaussianBlur(
            np.hypot(cv2.Sobel(log, cv2.CV_32F, 1, 0), cv2.Sobel(log, cv2.CV_32F, 0, 1)), (0, 0), 1.0
        )
        edges.append(alike(np.minimum(size, np.percentile(size, 99.0)), steepness))
    assert found > 0.8  # measured: 0.87
    assert found > max(edges) + 0.2  # measured: 0.44


# ------------------------------------------------------------------------------------------------------------ stains

STEEL, RUST = np.array([0.34, 0.34, 0.36]), np.array([0.22, 0.09, 0.04])


def ring_shade() -> Floats:
    """(rows, columns) brightness of a round groove under a lamp on the left."""
    return np.asarray(1.0 - 0.5 * ring()[0])


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


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_rust_is_gone_and_shading_stays(dtype: type[np.unsignedinteger]) -> None:
    photo = rusty(dtype=dtype)
    clean = without_stains(photo)
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
    assert (clean.kind, clean.pitch_mm, clean.origin_mm) == (first.kind, first.pitch_mm, first.origin_mm)
    np.testing.assert_array_equal(clean.layers[KNOWN], first.layers[KNOWN])
    np.testing.assert_allclose(clean.layers[GREY], without_stains(photo), atol=1e-6)
