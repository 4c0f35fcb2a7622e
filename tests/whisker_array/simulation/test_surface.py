"""The felt surface: dilation by the tip, dropouts, orientation, and the grid that a scan wants."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

import whisker_array.simulation.regrid
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from tests.support.trace_frame import sample_lines
from whisker_array.simulation.dilation import dilate_by_ball
from whisker_array.simulation.regrid import fit_pitch
from whisker_array.simulation.surface import fill_dropouts, orient, prepare_surface
from whisker_array.whisker.sections import WhiskerError

PITCH = 0.05
FLOAT32 = 2e-7
"""Rounding of heights below 1 mm in float32."""


def rough(seed: int, shape: tuple[int, int] = (24, 31)) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(0.0, 0.05, shape).astype(np.float32)


def dilate(z: NDArray[np.float32], radius_mm: float) -> NDArray[np.float32]:
    return dilate_by_ball(z, pitch_mm=PITCH, radius_mm=radius_mm)


# --- dilation


def pitted() -> NDArray[np.float32]:
    """Land, which is left as it is, around a pit and a grain."""
    z = np.zeros((40, 300), dtype=np.float32)
    z[15:25, 100:110] = -0.1
    z[20, 200] = 0.03
    return z


@pytest.mark.parametrize(
    ("z", "radius"), [(rough(1), 0.05), (rough(1), 0.12), (rough(1), 0.21), (pitted(), 0.2)]
)
def test_dilation_is_that_of_scipy(z: NDArray[np.float32], radius: float) -> None:
    reach = int(radius / PITCH + 1e-9)
    v, u = np.mgrid[-reach : reach + 1, -reach : reach + 1] * PITCH
    square = radius**2 - u**2 - v**2
    ball = square >= -1e-12
    structure = np.where(ball, np.sqrt(np.maximum(square, 0.0)) - radius, 0.0)
    expected = ndimage.grey_dilation(z.astype(float), footprint=ball, structure=structure, mode="nearest")
    np.testing.assert_allclose(dilate(z, radius), expected, atol=FLOAT32)


@pytest.mark.parametrize("half_width", [0, 1, 2])
def test_a_groove_narrower_than_the_ball_is_shallower_by_geometry(half_width: int) -> None:
    radius = 0.3
    z = np.zeros((9, 61), dtype=np.float32)
    z[:, 30 - half_width : 31 + half_width] = -0.5
    rim = (half_width + 1) * PITCH
    felt = dilate(z, radius)[4]
    assert felt[30] == pytest.approx(np.sqrt(radius**2 - rim**2) - radius, abs=FLOAT32)
    assert felt.min() == felt[30]
    assert (np.delete(felt, np.arange(30 - half_width, 31 + half_width)) == 0.0).all()


def test_refused_tips() -> None:
    z = rough(3)
    for radius in (-0.1, np.nan, np.inf):
        with pytest.raises(WhiskerError, match="zero or positive"):
            dilate(z, radius)
    with pytest.raises(WhiskerError, match="finer tip"):
        dilate(z, 61.5 * PITCH)


# --- dropouts


def test_dropouts_are_filled_and_the_measured_stay() -> None:
    z = rough(4, (40, 50))
    holes = ndimage.binary_dilation(np.random.default_rng(5).random(z.shape) < 0.01, iterations=2)
    filled, dropout = fill_dropouts(np.where(holes, np.nan, z).astype(np.float32))
    np.testing.assert_array_equal(dropout, holes)
    np.testing.assert_array_equal(filled[~holes], z[~holes])
    assert np.isfinite(filled).all()
    # nothing is invented beyond what was measured
    assert z[~holes].min() <= filled.min()
    assert filled.max() <= z[~holes].max()


# --- slopes, orientation, sampling


@pytest.mark.parametrize("direction", list(TraceDirection))
def test_slopes_belong_to_the_trace_frame(direction: TraceDirection) -> None:
    y, x = np.mgrid[:30, :40] * PITCH
    z = (0.1 * np.sin(2.0 * x) + 0.07 * np.cos(3.0 * y) + 0.05 * x * y).astype(np.float32)
    friction = (0.1 + 0.01 * x + 0.02 * y).astype(np.float32)
    surface = prepare_surface(HeightMap(z, PITCH), friction=friction)
    turned = orient(surface, direction)
    expected = z if direction.along_x else z.T
    own = friction if direction.along_x else friction.T
    if direction.backward:
        expected, own = expected[:, ::-1], own[:, ::-1]
    np.testing.assert_array_equal(turned.fields[..., 0], expected)
    np.testing.assert_array_equal(turned.fields[..., 3], own)
    across, along = np.gradient(expected.astype(float), PITCH)
    # float32 heights of 0.5 mm over two pitches
    np.testing.assert_allclose(turned.fields[..., 1], along, atol=2e-6)
    np.testing.assert_allclose(turned.fields[..., 2], across, atol=2e-6)


def test_lines_are_sampled_bilinearly() -> None:
    y, x = np.mgrid[:30, :40] * PITCH
    z = (0.3 * x - 0.2 * y + 0.5 * x * y).astype(np.float32)  # bilinear functions are met exactly
    z[10, 20] = np.nan
    surface = prepare_surface(HeightMap(z, PITCH), friction=0.3)
    lines = np.array([0.213, 0.0, 0.49])
    height, mu, missing = sample_lines(surface, lines_mm=lines, start_mm=0.11, step_mm=0.037, n_samples=40)
    at = 0.11 + 0.037 * np.arange(40)
    exact = 0.3 * at - 0.2 * lines[:, None] + 0.5 * at * lines[:, None]
    assert missing[2].any()
    np.testing.assert_allclose(height[~missing], exact[~missing], atol=1e-6)
    np.testing.assert_allclose(mu, 0.3, rtol=1e-6)
    # the dropout at (1.0, 0.5) is met by the third line alone, within one pitch
    assert not missing[:2].any()
    np.testing.assert_array_equal(missing[2], np.abs(at - 1.0) < PITCH)


# --- fit_pitch


@pytest.mark.parametrize("pitch", [0.2, 0.1, 0.06, 0.05, 0.03, 0.02, 0.01, 0.007])
def test_a_plane_stays_where_it_is(pitch: float) -> None:
    y, x = np.mgrid[:70, :90] * pitch
    plane = (0.1 + 0.2 * x - 0.3 * y).astype(np.float32)
    fitted, mu = fit_pitch(HeightMap(plane, pitch), 0.2, target_mm=PITCH)
    assert mu == 0.2
    # never coarser than asked for, and no finer than a third of it unless the map came so
    assert fitted.pitch_mm <= PITCH * (1 + 1e-6)
    assert fitted.pitch_mm >= min(pitch, PITCH / 3) * (1 - 1e-6)
    rows, cols = (np.arange(n) * fitted.pitch_mm for n in fitted.shape)
    exact = 0.1 + 0.2 * cols - 0.3 * rows[:, None]
    # the rim is replicated: a spline rings for a dozen samples there, a block is half filled
    inside = (rows >= 12 * pitch)[:, None] & (cols >= 12 * pitch)
    inside &= (rows <= (69 - 12) * pitch)[:, None] & (cols <= (89 - 12) * pitch)
    assert inside.sum() > 50
    np.testing.assert_allclose(fitted.z_mm[inside], exact[inside], atol=2e-6)
    # the first sample's centre stays at the origin, the last is not passed by more than half a block
    assert -1e-9 <= 69 * pitch - rows[-1] < fitted.pitch_mm + 1e-9


def test_averaging_is_the_mean_of_centred_blocks() -> None:
    z = rough(10, (61, 61))
    z[30, 30] = np.nan
    fitted, _ = fit_pitch(HeightMap(z, 0.01), 0.2, target_mm=0.1)
    assert fitted.pitch_mm == pytest.approx(0.05)
    assert fitted.z_mm[3, 4] == pytest.approx(z[13:18, 18:23].mean(), abs=1e-6)
    assert fitted.z_mm[6, 6] == pytest.approx(np.nanmean(z[28:33, 28:33]), abs=1e-6)


def test_friction_comes_along_and_stays_a_friction() -> None:
    z = rough(12, (40, 40))
    oily = np.full(z.shape, 0.4, dtype=np.float32)
    oily[10:20, 10:20] = 0.0
    for pitch, target in ((0.2, 0.05), (0.01, 0.1)):
        fitted, mu = fit_pitch(HeightMap(z, pitch), oily, target_mm=target)
        assert mu.shape == fitted.shape
        assert mu.min() >= 0.0  # a cubic would swing below zero beside the patch
        assert mu.max() <= 0.4 + 1e-6
        prepare_surface(fitted, friction=mu)


def test_a_coarse_and_wide_map_does_not_eat_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(whisker_array.simulation.regrid, "MAX_PIXELS", 10_000)
    plate = HeightMap(rough(13, (40, 40)), 1.0)
    assert fit_pitch(plate, 0.2, target_mm=0.5)[0].shape == (79, 79)
    with pytest.raises(MapError, match=r"crop the map.*coarser steps"):
        fit_pitch(plate, 0.2, target_mm=0.1)
