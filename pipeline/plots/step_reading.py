r"""Reading the step F off a trace over a test piece, as one would off a measured one.

On the slope m / m_land = F (1 + h/d0), a straight line in the height h. A trace is drawn over the *commanded*
place, though, and in contact the tip is ahead of that or behind by what the whisker yields along x, which changes
with the force: the edge is left, and the foot reached, at shifted places. So the heights on the line are taken from
the trace as well, at two places that need no knowledge of the whisker::

    m/m_land
             F +         the line ends on the floor at its foot, h = -depth, and would come to no
               |\        moment at all where the surface no longer holds the tip up, h = -d0.
    1 ---------+ \       In between h is linear; carried back to h = 0 the line reads F:
                  \
                   \ foot      F = line(foot) / (1 - depth/d0)
                   |____________
                       .   1 - depth/d0
    0 . . . . . . . . . .  h = -d0
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from pipeline.plots.wedge import Wedge

_MOST_MISFIT = 5e-3
"""Rms by which line, ramp and floor may miss the trace, of the land's moment, over twice the noise."""
_STEEPER = 3.0
"""Least steepness of the ramp at the foot over the line's: 8 for the paper's longer arms, 200 for the shortest."""


class StepError(MarksError):
    """A trace from which no step can be read."""


@dataclass(frozen=True)
class StepReading:
    """Step parameters read from a trace.

    Attributes:
        factor: F, the step at the edge over the land level.
        land_n_mm: moment on the land, N mm.
        line: moment over the land's on the slope as (rise per mm, value at x = 0).
        edge_mm: commanded position where the line reaches h = 0.
        foot_mm: commanded position where the slope ends on the floor.
        peak: the highest moment over the land's.
    """

    factor: float
    land_n_mm: float
    line: tuple[float, float]
    edge_mm: float
    foot_mm: float
    peak: float


def read_step(
    place_mm: NDArray[np.float64],
    moment_n_mm: NDArray[np.float64],
    *,
    wedge: Wedge,
    preload_mm: float,
    blur_mm: float = 0.0,
) -> StepReading:
    """Read F off a trace over a test piece, without knowing the whisker, its friction or its fidelity.

    Args:
        place_mm: (samples,) commanded place, evenly spaced, mm after the edge.
        moment_n_mm: (samples,) moment, N mm.
        wedge: the test piece.
        preload_mm: d0, more than the test piece is deep.
        blur_mm: how much early a corner is felt: one sample where slopes are central differences.

    Raises:
        StepError: a preload too small, no moment on the land, or no foot to be found.
    """
    if not preload_mm > wedge.depth_mm:
        raise StepError(f"preload_mm is {preload_mm}", hint=f"it must exceed the depth, {wedge.depth_mm} mm")
    left = 1.0 - wedge.depth_mm / preload_mm
    on_land = (place_mm > -0.8 * wedge.land_mm) & (place_mm < -0.2 * wedge.land_mm)
    # clear of the ball's rounding at the edge, and of a foot that is felt early: in contact by 1.5 k tan(alpha)
    # of the run, 0.3 of it for the paper's longest arm
    on_slope = (place_mm > 0.2 * wedge.run_mm) & (place_mm < 0.6 * wedge.run_mm)
    if on_land.sum() < 2 or on_slope.sum() < 3:
        raise StepError("too few samples on the land or on the slope", hint="sample more finely")
    land = float(moment_n_mm[on_land].mean())
    if land == 0.0:
        raise StepError("the land makes no moment", hint="is the whisker pressed on?")
    ratio = moment_n_mm / land
    rise, start = (float(v) for v in np.polyfit(place_mm[on_slope], ratio[on_slope], 1))
    if -rise * wedge.run_mm < 0.2 * (1.0 - left):
        raise StepError("the moment does not fall along the slope", hint="check the place of the edge")
    scatter = _rms(ratio[on_slope] - (start + rise * place_mm[on_slope]))
    rest = (place_mm >= 0.6 * wedge.run_mm) & (place_mm <= 1.4 * wedge.run_mm)
    foot, misfit = _find_foot(place_mm[rest], ratio[rest], (rise, start), floor=left, run_mm=wedge.run_mm)
    if misfit > 2.0 * scatter + _MOST_MISFIT:
        raise StepError(
            f"the moment does not fall along the slope to level out at {left:g} of the land's",
            hint="check preload, depth and the place of the edge",
        )
    # nothing blurs a foot without a step, a straight whisker's: there the line just crosses the floor's level
    crossing = (left - start) / rise
    foot = crossing if abs(foot - crossing) <= 2.0 * blur_mm else foot + blur_mm
    no_lift = -start / rise
    return StepReading(
        factor=(start + rise * foot) / left,
        land_n_mm=land,
        line=(rise, start),
        edge_mm=no_lift - (no_lift - foot) / left,
        foot_mm=foot,
        peak=float(ratio.max()),
    )


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _find_foot(
    x: NDArray[np.float64],
    ratio: NDArray[np.float64],
    line: tuple[float, float],
    *,
    floor: float,
    run_mm: float,
) -> tuple[float, float]:
    """End of the line, fitted by least squares, and the residual rms.

    In contact the tip waits in the corner while the base walks on, until friction points as on the floor: the
    moment changes from the line to the floor along a short ramp, whose width is fitted as well. The ramp is much
    steeper than the line; otherwise the two could not be separated.
    """
    rise, start = line
    slope = start + rise * x
    # first without a ramp: the line up to sample j, the floor from there on
    before = np.concatenate([[0.0], np.cumsum((ratio - slope) ** 2)])
    after = np.concatenate([[0.0], np.cumsum((ratio - floor) ** 2)])
    j = int(np.argmin(before + after[-1] - after))
    foot, ramp = float(x[min(j, x.size - 1)]), 0.0
    reach = 0.2 * run_mm
    misfit = math.inf
    for _ in range(5):  # a grid of places and widths, drawn closer about its best
        feet = foot + reach * np.linspace(-1.0, 1.0, 17)
        ramps = np.maximum(ramp + reach * np.linspace(-1.0, 1.0, 17), 0.0)[:, None]
        costs = []
        for place in feet:
            corner = start + rise * place
            widest = abs(corner - floor) / (_STEEPER * abs(rise))
            share = np.clip((x - place) / np.clip(ramps, 1e-9, max(widest, 1e-9)), 0.0, 1.0)
            model = np.where(x < place, slope, corner + (floor - corner) * share)
            costs.append(np.mean((ratio - model) ** 2, axis=1))
        row, column = divmod(int(np.argmin(costs)), ramps.size)
        foot, ramp, misfit = float(feet[row]), float(ramps[column, 0]), float(np.min(costs))
        reach /= 4.0
    return foot, math.sqrt(misfit)
