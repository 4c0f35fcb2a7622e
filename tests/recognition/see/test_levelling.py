"""A part mounted level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap
from recognition.see.levelling import fill_gaps, level, square_to_plate
from tests.support.felt import tilted

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


def test_large_holes_stay_dropouts_and_do_no_harm(make_part: Make) -> None:
    flat = make_part(
        "K7B29", calm=True, pitch_mm=5.0 / 150
    ).height_map  # so fine that the fit is of a thinned grid
    z = flat.z_mm + form(flat.shape, flat.pitch_mm, tilt_deg=2.0, dome_mm=0.05).astype(np.float32)
    hole = np.zeros(z.shape, dtype=bool)
    hole[50:150, 250:450] = True
    z[hole | (np.random.default_rng(0).random(z.shape) < 0.1)] = np.nan
    mounted = level(HeightMap(z, flat.pitch_mm)).z_mm
    # its rim is filled over a tenth of a millimetre, three samples
    assert not np.isnan(mounted[~hole]).any()
    assert np.isnan(mounted[54:146, 254:446]).all()
    assert np.sqrt(np.mean((mounted - flat.z_mm)[~hole] ** 2)) < 2e-3


def test_a_flat_plate_stays_flat() -> None:
    z = np.full((20, 30), 0.25, dtype=np.float32)
    assert (
        np.abs(level(HeightMap(z, 0.1)).z_mm).max() < 1e-6
    )  # the damping leaves 1e-10 of it, float32 the rest


def grooved(*, pitch_mm: float = 0.1, depth_mm: float = 0.16) -> HeightMap:
    """A plate of 14 x 8 mm with two grooves 1 mm wide, one each way, with walls of 45 degrees."""
    y, x = np.mgrid[0.0 : 8.0 + 1e-9 : pitch_mm, 0.0 : 14.0 + 1e-9 : pitch_mm]
    reach = np.minimum(np.abs(x - 5.0), np.abs(y - 3.0)) - 0.5
    return HeightMap(-np.clip(-reach, 0.0, depth_mm), pitch_mm)


@settings(deadline=None, max_examples=12)
@given(deg=st.floats(0.0, 45.0), azimuth_deg=st.floats(0.0, 360.0))
def test_depths_are_square_to_the_plate_at_any_tilt(deg: float, azimuth_deg: float) -> None:
    flat = grooved()
    seen, soil = tilted(flat, deg, azimuth_deg)
    squared, moved = square_to_plate(seen, soil)
    mounted = level(squared)
    assert -np.nanpercentile(mounted.z_mm, 2) == pytest.approx(0.16, abs=3e-3)
    # characters keep their width, and soil its place
    known = np.isfinite(mounted.z_mm)
    x, y = (np.flatnonzero(known.any(axis=axis)) * mounted.pitch_mm for axis in (0, 1))
    assert (np.ptp(x), np.ptp(y)) == pytest.approx(flat.size_mm, abs=3.1 * flat.pitch_mm)
    inside = (slice(10, -10), slice(10, -10))
    off = moved.thickness_mm - np.arange(mounted.shape[1]) * mounted.pitch_mm
    assert np.abs(off[inside][known[inside]]).max() < 4.0 * flat.pitch_mm


def test_a_level_map_and_steps_are_not_resampled() -> None:
    flat = grooved()
    assert square_to_plate(flat)[0] is flat
    # a part on a table below it, and saw teeth: the map is not a plane on the slant
    table = np.where(np.indices(flat.shape)[1] > 90, -4.0, 0.0)
    teeth = 0.2 * (np.indices(flat.shape)[1] % 40) * flat.pitch_mm
    for form in (table, teeth):
        stepped = HeightMap(flat.z_mm + form, flat.pitch_mm)
        assert square_to_plate(stepped)[0] is stepped


def random_gaps(shape: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    return rng.random(shape) < share


def missing_rows(shape: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    return np.broadcast_to(rng.random((shape[0], 1)) < 0.5 * share, shape)


def small_clusters(shape: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    seeds = rng.random(shape) < share / 3.0
    return seeds | np.roll(seeds, 1, axis=0) | np.roll(seeds, 1, axis=1)


@settings(deadline=None, max_examples=25)
@given(
    gaps=st.sampled_from([random_gaps, missing_rows, small_clusters]),
    share=st.floats(0.01, 0.4),
    pitch_mm=st.sampled_from([0.05, 0.125]),
    slope=st.floats(-0.5, 0.5),
    seed=st.integers(0, 2**32 - 1),
)
def test_small_gaps_are_filled_and_measured_samples_stay(
    gaps: Callable[..., np.ndarray], share: float, pitch_mm: float, slope: float, seed: int
) -> None:
    flat = grooved(pitch_mm=pitch_mm)
    whole = flat.z_mm + np.float32(slope) * (np.indices(flat.shape)[1] * pitch_mm).astype(np.float32)
    gone = gaps(flat.shape, share, np.random.default_rng(seed))
    holed = HeightMap(np.where(gone, np.nan, whole), pitch_mm)
    filled = fill_gaps(holed).z_mm
    np.testing.assert_array_equal(filled[~gone], holed.z_mm[~gone])
    # hardly anything is left, and what was filled is as deep as the surface, but at the edges of the grooves
    assert np.isnan(filled).mean() < 0.06
    assume((gone & np.isfinite(filled)).any())
    off = np.abs(filled - whole)[gone & np.isfinite(filled)]
    assert np.median(off) < 0.01 * 0.16 + 0.5 * abs(slope) * pitch_mm
    assert off.mean() < 0.1 * 0.16 + 0.5 * abs(slope) * pitch_mm
    assert off.max() < 0.16 + 3.0 * abs(slope) * pitch_mm


def test_holes_wider_than_a_stroke_and_sparse_samples_are_not_invented() -> None:
    flat = grooved(pitch_mm=0.05)
    z = flat.z_mm.copy()
    z[40:60, 60:80] = np.nan
    few = np.random.default_rng(0).random(z.shape) < 0.8
    few[:, :150] = False
    z[few] = np.nan
    filled = fill_gaps(HeightMap(z, 0.05))
    assert np.isnan(filled.z_mm[43:57, 63:77]).all()
    # four of five samples are missing there: strokes between them would be guesses
    assert np.isnan(filled.z_mm[:, 160:][few[:, 160:]]).mean() > 0.95
    assert fill_gaps(flat) is flat
