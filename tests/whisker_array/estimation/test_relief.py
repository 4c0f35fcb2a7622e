"""Height and slopes from an edge map alone."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from glyphs import stamp
from glyphs.stamping.variation import PlateVariation, StampingVariation
from glyphs.surface.maps import EdgeMap, HeightMap, MapError, TraceDirection
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.relief import Relief, Route, relief_from_edges
from whisker_array.scan.scan import trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.touch import default_touch, profiling_touch

HEIGHT = 5.0
TOUCH, PROFILER = default_touch(HEIGHT), profiling_touch(HEIGHT)
FORWARD = (TraceDirection.FORWARD_X,)
BOTH = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)


def edges_of(layers: np.ndarray, directions: tuple[TraceDirection, ...]) -> EdgeMap:
    return EdgeMap(
        enhancement=layers.astype(np.float32),
        directions=directions,
        valid=np.ones(layers.shape[1:], dtype=np.bool_),
        pitch_mm=0.1,
        origin_mm=(1.0, 2.0),
    )


def ideal_edges(
    height_mm: np.ndarray,
    slope_x: np.ndarray,
    slope_y: np.ndarray,
    directions: tuple[TraceDirection, ...],
    mu: float,
) -> EdgeMap:
    """What eq. (16) and the lift say every direction feels: (1 + h / d0) F - 1."""
    lift = 1.0 + height_mm / TOUCH.preload_mm
    layers = []
    for d in directions:
        slope = slope_x if d.along_x else slope_y
        layers.append(lift * moment_ratio(-slope if d.backward else slope, mu, TOUCH.tip) - 1.0)
    return edges_of(np.stack(layers), directions)


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_ideal_maps_give_back_heights_and_slopes(mu: float) -> None:
    rng = np.random.default_rng(0)
    height, p, q = (
        rng.uniform(-0.4, 0.1, (7, 9)),
        rng.uniform(-1.5, 1.5, (7, 9)),
        rng.uniform(-1.5, 1.5, (7, 9)),
    )
    relief = relief_from_edges(ideal_edges(height, p, q, tuple(TraceDirection), mu), TOUCH, friction=mu)
    assert relief.route is Route.TURNED
    assert (relief.pitch_mm, relief.origin_mm) == (0.1, (1.0, 2.0))
    assert (relief.friction, relief.friction_sd, relief.friction_map) == (mu, None, None)
    # edge maps are float32: 1e-7, over 1.5 k and times the steepest slope's square
    np.testing.assert_allclose(relief.height_mm, height, atol=1e-5)
    np.testing.assert_allclose(relief.slope_x, p, atol=1e-4)
    np.testing.assert_allclose(relief.slope_y, q, atol=1e-4)
    np.testing.assert_allclose(relief.steepness, np.hypot(p, q), atol=2e-4)


def test_a_profilers_edges_are_the_profile() -> None:
    depth = np.linspace(-0.5, 0.0, 24).reshape(4, 6)
    noise = 1e-3 * np.array([1.0, -1.0])[:, None, None]
    relief = relief_from_edges(edges_of(depth / PROFILER.preload_mm + noise, BOTH), PROFILER)
    assert relief.route is Route.PROFILED
    assert relief.slope_x is None
    np.testing.assert_allclose(relief.height_mm, depth, atol=1e-6)


def test_nothing_is_said_where_nothing_was_felt() -> None:
    level = np.zeros((4, 6))
    valid = np.ones(level.shape, dtype=np.bool_)
    valid[1, 2:4] = False
    for directions in (FORWARD, BOTH):
        relief = relief_from_edges(
            replace(ideal_edges(level, level, level, directions, 0.2), valid=valid), TOUCH
        )
        np.testing.assert_array_equal(np.isfinite(relief.height_mm), valid)
        if relief.slope_x is not None:
            np.testing.assert_array_equal(np.isfinite(relief.slope_x), valid)


@cache
def part() -> HeightMap:
    """Three characters on a plate as milled, but mounted level: what the land's fit takes off is not asked here."""
    variation = StampingVariation(plate=PlateVariation(tilt_deg=0.0, waviness_um=0.0))
    return stamp("KR8", height_mm=HEIGHT, variation=variation, seed=1).height_map


def stamped(fidelity: Fidelity, *, profiler: bool = False) -> tuple[Relief, np.ndarray]:
    """Relief of a stamped part and the true height at its places."""
    rng = np.random.default_rng(2)
    plan = default_plan((0.0, 0.0, *part().size_mm), character_height_mm=HEIGHT, n_whiskers=8)
    touch = PROFILER if profiler else TOUCH
    scan = trace_scan(
        part(), touch=touch, plan=plan, fidelity=fidelity, sensor=draw_sensor_chain(8, rng=rng), rng=rng
    )
    relief = relief_from_edges(edge_map(scan), touch)
    rows, cols = np.mgrid[: relief.height_mm.shape[0], : relief.height_mm.shape[1]]
    x, y = (o + relief.pitch_mm * i for o, i in zip(relief.origin_mm, (cols, rows), strict=True))
    pitch = part().pitch_mm
    return relief, map_coordinates(
        part().z_mm.astype(np.float64), [y / pitch, x / pitch], order=1, mode="nearest"
    )


@pytest.mark.parametrize("profiler", [False, True])
@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_a_stamped_part_comes_out_to_a_few_micrometres(fidelity: Fidelity, profiler: bool) -> None:
    relief, true = stamped(fidelity, profiler=profiler)
    assert relief.route is (Route.PROFILED if profiler else Route.TURNED)
    error = 1000.0 * (relief.height_mm - true)
    assert np.isfinite(error).mean() > 0.95
    # marks 230 um deep, corners rounded by the ball of 60 um and by pixels of 0.125 mm: 3 to 4 um were seen
    assert np.nanstd(error) < 8.0
    assert abs(float(np.nanmedian(error[true > -0.005]))) < 3.0
    # in the depth of a stroke 0.5 mm wide the ball stands off the walls: -5 to +8 um were seen
    deep = true < -0.15
    assert deep.any()
    assert abs(float(np.nanmean(error[deep]))) < 15.0


def test_refusals_say_what_is_wrong() -> None:
    level = np.zeros((4, 6))
    sticky = replace(TOUCH, tip=TOUCH.tip.pushed())
    # pushed, tan(phi) = 1 / (1.5 k) = 5.7 is where even the land jams
    with pytest.raises(MapError, match="jams on the land"):
        relief_from_edges(edges_of(level[None], FORWARD), sticky, friction=6.0)
    relief = relief_from_edges(edges_of(level[None], FORWARD), TOUCH)
    small = np.zeros((3, 6), dtype=np.float32)
    for name in ("slope_x", "slope_y", "friction_map"):
        with pytest.raises(MapError, match="do not fit the heights"):
            replace(relief, **{name: small})
    for pitch in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(MapError, match="pitch_mm"):
            replace(relief, pitch_mm=pitch)
