"""Errors of friction, slope and depth as a mixed array estimates them on known grooves, with noisy sensors."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from paper_steps import Wedge

from glyphs.surface.maps import HeightMap, TraceDirection
from pipeline.plots.pictures import BLUE, GREEN, PURPLE, VERMILION, styled
from whisker_array.estimation.friction import FrictionRoute, land_friction
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.estimation.relief import Relief
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.touch import default_touch, profiling_touch

HEIGHT_MM = 5.0
# the paper's sensor, at the height of the tip
TOUCH = default_touch(HEIGHT_MM).with_whisker(replace(default_whisker(HEIGHT_MM), l3_mm=None))
FRICTIONS = (0.1, 0.3, 0.5)
SCANS = 3
COLOURS = {30.0: BLUE, 45.0: GREEN, 60.0: VERMILION}
"""By the walls' angle, degrees."""
STRAIGHT = straight_whisker(6.0 * HEIGHT_MM, math.radians(25.0), Rectangle(0.06 * HEIGHT_MM, 0.9 * HEIGHT_MM))
PROFILERS = {
    "straight": ("s", profiling_touch(HEIGHT_MM).with_whisker(STRAIGHT)),
    "L with its sensor raised by l2/2": ("o", profiling_touch(HEIGHT_MM)),
    "L-shaped alone": ("x", None),
}
"""Row behind the L-shaped whiskers, by name, and its marker."""
# relative standard deviation of a gain after calibration on a bench
BENCH_GAIN_SD = 0.001
MAP_PITCH_MM = 0.02
LINE_PITCH_MM = 0.04
Errors = dict[str, NDArray[np.float64]]
"""Of friction by either route, of the walls' angle in degrees, and of the floor's height in micrometres."""


@styled
def estimators_figure() -> Figure:
    """Draw bias and standard deviation over mu and alpha, contact fidelity."""
    found = {case: errors_of(*case) for case in product(PROFILERS, COLOURS, FRICTIONS)}
    figure = Figure(figsize=(11.0, 6.8))
    figure.suptitle(
        "Estimates from the moments: errors over μ 0.1 to 0.5 and α 30° to 60°, contact, sensors as from the bench\n"
        "(noise, vibration, drift, 16 bits, creep and hysteresis as the bench knows them; markers: bias, bars: "
        "standard deviation)"
    )
    (friction, slope), (depth, alone) = figure.subplots(2, 2)
    for route, label, colour, aside in (
        (FrictionRoute.TWO_WAYS, "dragged and pushed back (no gain needed)", BLUE, -0.008),
        (FrictionRoute.SHAPES, "ratio of the shapes, gains known to 0.1 %", PURPLE, 0.008),
    ):
        for mu in FRICTIONS:
            each = [e[route.name] for (_, _, at), e in found.items() if at == mu and e[route.name].size]
            bias, spread = np.mean([e.mean() for e in each]), np.sqrt(np.mean([e.var(ddof=1) for e in each]))
            friction.errorbar(
                mu + aside, bias, spread, fmt="o", color=colour, capsize=3, markersize=5,
                label=label if mu == FRICTIONS[0] else None,
            )  # fmt: skip
    _label(friction, "friction of the land", "error of μ", room=0.25, columns=1)
    *mixed, single = PROFILERS
    angle = "error of the wall's angle, degrees"
    _draw(slope, found, mixed, "slope", "slope, from profilers and L-shaped", angle)
    _draw(
        depth, found, [*PROFILERS], "depth", "depth of a floor 500 µm deep", "error of the floor's depth, µm"
    )
    _draw(alone, found, [single], "slope", "slope, L-shaped alone turned about, μ taken for 0.2", angle)
    return figure


def _draw(
    axes: Axes,
    found: dict[tuple[str, float, float], Errors],
    profilers: list[str],
    kind: str,
    title: str,
    label: str,
) -> None:
    """Draw errors over friction: arrays and angles side by side."""
    count = len(profilers) * len(COLOURS)
    for place, (angle, profiler) in enumerate(product(COLOURS, profilers)):
        each = [found[profiler, angle, mu][kind] for mu in FRICTIONS]
        axes.errorbar(
            np.add(FRICTIONS, 0.014 * (place - 0.5 * (count - 1))),
            [e.mean() for e in each],
            [e.std(ddof=1) for e in each],
            fmt=PROFILERS[profiler][0],
            color=COLOURS[angle],
            markersize=5,
            mfc="none",
            capsize=2,
        )
    for profiler in profilers:
        axes.plot([], [], PROFILERS[profiler][0], color="0.3", mfc="none", label=profiler)
    for angle, colour in COLOURS.items():
        axes.plot([], [], "-", color=colour, label=f"α = {angle:g}°")
    _label(axes, title, label, room=0.4)


def _label(axes: Axes, title: str, label: str, *, room: float, columns: int = 2) -> None:
    """Label the axes; `room` for the legend above, as a share of the data's height."""
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    low, high = axes.get_ylim()
    axes.set(
        ylim=(low, high + room * (high - low)),
        xticks=FRICTIONS,
        xlabel="true friction μ",
        ylabel=label,
        title=title,
    )
    axes.legend(ncols=columns, loc="upper left")


def errors_of(profiler: str, alpha_deg: float, mu: float, *, seed: int = 0) -> Errors:
    """Feel a groove several times, and compare what was found with what is true."""
    wedge = Wedge(math.radians(alpha_deg), land_mm=4.0, floor_mm=2.0)
    half = wedge.height_map(pitch_mm=MAP_PITCH_MM, rows=130).z_mm
    surface = HeightMap(np.concatenate([half, half[:, ::-1]], axis=1), MAP_PITCH_MM)
    second = PROFILERS[profiler][1]
    turned = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    plan = RasterPlan(
        array=WhiskerArray(8, 8 * LINE_PITCH_MM, kinds=2 if second else 1),
        region_mm=(0.9, 0.02, surface.size_mm[0] - 0.9, surface.size_mm[1] - 0.02),
        line_pitch_mm=LINE_PITCH_MM,
        sample_pitch_mm=MAP_PITCH_MM,
        directions=turned[:1] if second else turned,
        two_way=second is not None,
        lead_mm=0.8,
    )
    slopes, depths = [], []
    friction: dict[str, list[float]] = {route.name: [] for route in FrictionRoute}
    for number in range(SCANS):
        rng = np.random.default_rng([seed, number])
        n = plan.array.n_whiskers * plan.array.kinds
        chain = draw_sensor_chain(n, rng=rng, full_scale_n_mm=3.0 * abs(TOUCH.land_moment_n_mm()))
        scan = trace_scan(
            surface, touch=TOUCH, others=(second,) if second else (), plan=plan, fidelity=Fidelity.CONTACT,
            friction=mu, sensor=chain, rng=rng,
        )  # fmt: skip
        known = chain.gain * (1.0 + BENCH_GAIN_SD * rng.standard_normal(n))
        scan = replace(scan, calibration=Calibration(gain=known, offset_n_mm=np.zeros(n)))
        for one in land_friction(scan):
            friction[one.route.name].append(one.mu - mu)
        wall, floor = _errors(estimate_relief(scan), wedge)
        slopes.append(wall)
        depths.append(floor)
    whole = {"slope": np.concatenate(slopes), "depth": np.concatenate(depths)}
    return {name: np.array(errors) for name, errors in friction.items()} | {
        name: errors[np.isfinite(errors)] for name, errors in whole.items()
    }


def _errors(relief: Relief, wedge: Wedge) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Errors of the walls' inclination, degrees, and of the floor's height, micrometres.

    The ball rounds an edge over its own radius, so walls are looked at that far inside.
    """
    assert relief.slope_x is not None
    inside = TOUCH.tip_radius_mm + 0.5 * LINE_PITCH_MM
    x = relief.origin_mm[0] + relief.pitch_mm * np.arange(relief.height_mm.shape[1])
    # the left half falls, the right half is its mirror image
    middle = wedge.land_mm + wedge.run_mm + wedge.floor_mm + 0.5 * MAP_PITCH_MM
    from_edge = np.abs(x - middle)
    foot = middle - wedge.land_mm - wedge.run_mm
    wall = (from_edge > foot + inside) & (from_edge < foot + wedge.run_mm - inside)
    floor = from_edge < foot - 5.0 * inside
    steep = np.degrees(np.arctan(relief.slope_x.astype(np.float64))) * np.where(x < middle, -1.0, 1.0)
    slope_error = (steep - math.degrees(wedge.alpha_rad))[:, wall].ravel()
    depth_error = 1000.0 * (-relief.height_mm.astype(np.float64)[:, floor] - wedge.depth_mm).ravel()
    return slope_error, depth_error
