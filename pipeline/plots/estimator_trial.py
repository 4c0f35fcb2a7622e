"""Errors of a mixed array's estimates of height, slope and friction, on known grooves with noisy sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap, TraceDirection
from pipeline.plots.wedge import Wedge
from whisker_array.estimation.friction import FrictionRoute, land_friction
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.estimation.relief import Relief
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.touch import Touch, default_touch, profiling_touch

HEIGHT_MM = 5.0
DEPTH_MM = 0.5
FRICTIONS = (0.1, 0.2, 0.3, 0.4, 0.5)
ANGLES_DEG = (30.0, 45.0, 60.0)
BENCH_GAIN_SD = 0.001
"""Relative standard deviation of a gain after calibration on a bench."""
_MAP_PITCH_MM = 0.02
_LINE_PITCH_MM = 0.04
_STRAIGHT_BETA_DEG = 25.0


@dataclass(frozen=True)
class TrialRow:
    """Errors of one kind of array on one groove, over several scans with their own sensor noise.

    Attributes:
        profiler: "straight" or "raised sensor", the row beside the L-shaped whiskers; "none": L-shaped alone.
        fidelity: how touch was simulated.
        alpha_deg: inclination of both walls, degrees.
        mu: true friction.
        friction_bias, friction_sd: of mu found by dragging and pushing back, over the scans; NaN without.
        shapes_bias, shapes_sd: of mu found by the ratio of the shapes, gains known to 0.1 %; NaN without. Creep and
            hysteresis are known for all of it.
        slope_bias_deg, slope_sd_deg: of the wall's angle, over the samples of both walls.
        depth_bias_um, depth_sd_um: of the floor's depth, over its samples.
    """

    profiler: str
    fidelity: str
    alpha_deg: float
    mu: float
    friction_bias: float
    friction_sd: float
    shapes_bias: float
    shapes_sd: float
    slope_bias_deg: float
    slope_sd_deg: float
    depth_bias_um: float
    depth_sd_um: float


def profiler_of(name: str) -> Touch | None:
    """The second row of the array: "straight", "raised sensor" or "none"."""
    if name == "none":
        return None
    touch = profiling_touch(HEIGHT_MM)
    if name == "straight":
        length, width = 6.0 * HEIGHT_MM, 0.9 * HEIGHT_MM
        whisker = straight_whisker(
            length, math.radians(_STRAIGHT_BETA_DEG), Rectangle(0.06 * HEIGHT_MM, width)
        )
        touch = touch.with_whisker(whisker)
    return touch


def try_estimators(
    *,
    profilers: Sequence[str] = ("straight", "raised sensor", "none"),
    fidelities: Sequence[Fidelity] = (Fidelity.CONTACT,),
    angles_deg: Sequence[float] = ANGLES_DEG,
    frictions: Sequence[float] = FRICTIONS,
    scans: int = 4,
    seed: int = 0,
) -> tuple[TrialRow, ...]:
    """Feel grooves of every angle and friction with every array, and compare what was found with what is true."""
    cases = product(profilers, fidelities, angles_deg, frictions)
    return tuple(_trial(*case, scans=scans, seed=seed) for case in cases)


def _groove(alpha_deg: float) -> tuple[HeightMap, Wedge]:
    wedge = Wedge(alpha_rad=math.radians(alpha_deg), depth_mm=DEPTH_MM, land_mm=4.0, floor_mm=2.0)
    half = wedge.height_map(pitch_mm=_MAP_PITCH_MM, rows=130).z_mm
    return HeightMap(np.concatenate([half, half[:, ::-1]], axis=1), _MAP_PITCH_MM), wedge


def _trial(
    profiler: str, fidelity: Fidelity, alpha_deg: float, mu: float, *, scans: int, seed: int
) -> TrialRow:
    surface, wedge = _groove(alpha_deg)
    second = profiler_of(profiler)
    touch = default_touch(HEIGHT_MM)
    turned = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    plan = RasterPlan(
        array=WhiskerArray(8, 8 * _LINE_PITCH_MM, kinds=2 if second else 1),
        region_mm=(0.9, 0.02, surface.size_mm[0] - 0.9, surface.size_mm[1] - 0.02),
        line_pitch_mm=_LINE_PITCH_MM,
        sample_pitch_mm=_MAP_PITCH_MM,
        directions=turned[:1] if second else turned,
        two_way=second is not None,
        lead_mm=0.8,
    )
    slopes, depths = [], []
    mus: dict[FrictionRoute, list[float]] = {route: [] for route in FrictionRoute}
    for number in range(scans):
        rng = np.random.default_rng([seed, number])
        n = plan.array.n_whiskers * plan.array.kinds
        full_scale = 3.0 * abs(touch.land_moment_n_mm())
        chain = draw_sensor_chain(n, rng=rng, full_scale_n_mm=full_scale)
        scan = trace_scan(
            surface,
            touch=touch,
            others=(second,) if second else (),
            plan=plan,
            fidelity=fidelity,
            friction=mu,
            sensor=chain,
            rng=rng,
        )
        known = chain.gain * (1.0 + BENCH_GAIN_SD * rng.standard_normal(n))
        bench = Calibration(gain=known, offset_n_mm=np.zeros(n), memory=chain.memory)
        scan = replace(scan, calibration=bench)
        for found in land_friction(scan):
            mus[found.route].append(found.mu - mu)
        wall, floor = _errors(estimate_relief(scan), wedge)
        slopes.append(wall)
        depths.append(floor)
    wall, floor = np.concatenate(slopes), np.concatenate(depths)
    return TrialRow(
        profiler,
        fidelity.value,
        alpha_deg,
        mu,
        *_bias_and_sd(np.array(mus[FrictionRoute.TWO_WAYS])),
        *_bias_and_sd(np.array(mus[FrictionRoute.SHAPES])),
        *_bias_and_sd(wall),
        *_bias_and_sd(floor),
    )


def _bias_and_sd(errors: NDArray[np.float64]) -> tuple[float, float]:
    errors = errors[np.isfinite(errors)]
    if not errors.size:
        return math.nan, math.nan
    return float(errors.mean()), float(errors.std(ddof=1)) if errors.size > 1 else math.nan


def _errors(relief: Relief, wedge: Wedge) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Errors of the walls' inclination, degrees, and of the floor's height, micrometres.

    The ball rounds an edge over its own radius, so walls are looked at that far inside.
    """
    assert relief.slope_x is not None
    inside = default_touch(HEIGHT_MM).tip_radius_mm + 0.5 * _LINE_PITCH_MM
    x = relief.origin_mm[0] + relief.pitch_mm * np.arange(relief.height_mm.shape[1])
    # the left half falls, the right half is its mirror image
    middle = wedge.length_mm + 0.5 * _MAP_PITCH_MM
    from_edge = np.abs(x - middle)
    foot = middle - wedge.land_mm - wedge.run_mm
    wall = (from_edge > foot + inside) & (from_edge < foot + wedge.run_mm - inside)
    floor = from_edge < foot - 5.0 * inside
    steep = np.degrees(np.arctan(relief.slope_x.astype(np.float64))) * np.where(x < middle, -1.0, 1.0)
    slope_error = (steep - math.degrees(wedge.alpha_rad))[:, wall].ravel()
    depth_error = 1000.0 * (-relief.height_mm.astype(np.float64)[:, floor] - wedge.depth_mm).ravel()
    return slope_error, depth_error
