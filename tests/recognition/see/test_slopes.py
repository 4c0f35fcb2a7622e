"""The view of the slopes: flanks show wherever the lamps stood, stains do not, and one light makes no view."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recognition.see.slopes import slope_picture

Floats = NDArray[np.float32]
GROOVES = Path(__file__).parents[4] / "shared" / "data" / "grooves"
SHAPE = (120, 300)
AROUND = (20.0, 110.0, 200.0, 290.0)


def ring() -> NDArray[np.float64]:
    """Slopes (2, rows, columns) of a round groove."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    depth = -3.0 * np.exp(-(((np.hypot(x - 150.0, y - 60.0) - 35.0) / 4.0) ** 2))
    return np.stack(np.gradient(depth)[::-1])


def stain() -> NDArray[np.float64]:
    """Reflectance of a mottled coat, three times as bright here as there; nowhere white in a photograph."""
    return np.exp(1.5 * cv2.GaussianBlur(np.random.default_rng(3).normal(size=SHAPE), (0, 0), 3.0) * 3.0)


def under(azimuth_deg: float, *, seed: int, exposure: float = 1.0) -> Floats:
    """A matt, stained plate under one lamp, with the camera's noise."""
    a = np.radians(azimuth_deg)
    gx, gy = ring()
    shade = np.maximum(1.0 - 0.5 * (np.cos(a) * gx + np.sin(a) * gy), 0.02)
    noise = np.random.default_rng(seed).normal(0.0, 0.004, SHAPE)
    return np.asarray(np.clip(0.2 * exposure * stain() * shade + noise, 0.0, 1.0), dtype=np.float32)


def alike(one: NDArray[np.floating], other: NDArray[np.floating]) -> float:
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


def test_flanks_show_and_stains_do_not() -> None:
    picture = slope_picture([under(a, seed=k) for k, a in enumerate(AROUND)])
    assert picture is not None
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
    assert plain is not None
    assert mixed is not None
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
    assert picture is not None
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
