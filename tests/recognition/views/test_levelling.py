"""A part mounted level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap
from recognition.views.levelling import level

Make = Callable[..., StampedPart]


def form(shape: tuple[int, int], pitch_mm: float, *, tilt_deg: float, dome_mm: float) -> np.ndarray:
    rows, cols = shape
    y, x = np.mgrid[:rows, :cols] * pitch_mm
    slope = np.tan(np.radians(tilt_deg))
    u, v = 2.0 * x / x.max() - 1.0, 2.0 * y / y.max() - 1.0
    return 0.7 + slope * x - 0.4 * slope * y + dome_mm * (1.0 - u**2 - v**2)


@pytest.mark.parametrize(("tilt_deg", "dome_mm"), [(0.0, 0.0), (2.0, 0.0), (-3.0, 0.05), (0.5, -0.1)])
@pytest.mark.parametrize("raised", [False, True])
def test_plane_and_dome_go_and_the_serial_stays(
    tilt_deg: float, dome_mm: float, raised: bool, make_part: Make
) -> None:
    flat = make_part("K7B29", calm=True, raised=raised).height_map
    mounted = level(
        HeightMap(
            flat.z_mm + form(flat.shape, flat.pitch_mm, tilt_deg=tilt_deg, dome_mm=dome_mm), flat.pitch_mm
        )
    )
    assert mounted.pitch_mm == flat.pitch_mm
    # the land of the flat part is exactly zero
    assert np.sqrt(np.mean((mounted.z_mm - flat.z_mm) ** 2)) < 1e-3


def test_dropouts_stay_dropouts_and_do_no_harm(make_part: Make) -> None:
    flat = make_part("K7B29", calm=True).height_map
    z = flat.z_mm + form(flat.shape, flat.pitch_mm, tilt_deg=2.0, dome_mm=0.05).astype(np.float32)
    gone = np.random.default_rng(0).random(z.shape) < 0.1
    gone[20:60, 100:180] = True
    z[gone] = np.nan
    mounted = level(HeightMap(z, flat.pitch_mm)).z_mm
    assert np.array_equal(np.isnan(mounted), gone)
    assert np.sqrt(np.mean((mounted - flat.z_mm)[~gone] ** 2)) < 1e-3


def plate(shape: tuple[int, int], seed: int, *, holes: float = 0.0) -> NDArray[np.float32]:
    """A tilted, domed plate with texture, a sunk band, and dropouts."""
    rng = np.random.default_rng(seed)
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    z = 0.4 * u - 0.7 * v + 0.05 * u * u - 0.02 * u * v + rng.normal(0.0, 0.004, shape)
    z[shape[0] // 3 : shape[0] // 2, :: shape[1] // 9] -= 0.2
    z[rng.uniform(size=shape) < holes] = np.nan
    return z.astype(np.float32)


def plain_level(z: NDArray[np.float32], degree: int) -> NDArray[np.float32]:
    """Reweighted least squares over a list of the samples, their medians by numpy."""
    rows, cols = z.shape
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, cols), indexing="ij")
    step = max(1, int(np.sqrt(z.size / 40_000)))
    thin = z[::step, ::step].astype(np.float64)
    known = np.isfinite(thin)
    x, y, target = u[::step, ::step][known], v[::step, ::step][known], thin[known]
    design = np.stack([x**i * y**j for i, j in powers], axis=-1)
    weight = np.ones(target.size)
    for _ in range(12):
        weighted = design * weight[:, None]
        normal = weighted.T @ design + 1e-10 * target.size * np.eye(len(powers))
        coefficients = np.linalg.solve(normal, weighted.T @ target)
        residual = target - design @ coefficients
        off = residual - np.median(residual)
        spread = 1.4826 * np.median(np.abs(off))
        if spread <= 0.0:
            break
        weight = np.clip(1.0 - (off / (3.0 * spread)) ** 2, 0.0, None) ** 2
    form = sum(c * u**i * v**j for c, (i, j) in zip(coefficients, powers, strict=True))
    return (z - form).astype(np.float32)


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("holes", [0.0, 0.2])
@pytest.mark.parametrize("shape", [(40, 90), (310, 420)])
def test_level_is_the_plain_fit(shape: tuple[int, int], holes: float, degree: int) -> None:
    z = plate(shape, 2, holes=holes)
    got = level(HeightMap(z, 0.05), degree=degree).z_mm
    # the form is taken off in float32, whose last place is worth 6e-8 at a millimetre
    np.testing.assert_allclose(got, plain_level(z, degree), rtol=0.0, atol=5e-7)


def test_a_flat_plate_stays_flat() -> None:
    z = np.full((20, 30), 0.25, dtype=np.float32)
    assert (
        np.abs(level(HeightMap(z, 0.1)).z_mm).max() < 1e-6
    )  # the damping leaves 1e-10 of it, float32 the rest
