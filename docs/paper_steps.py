r"""The paper's experiment: one whisker traces a test piece, and the step F is measured on the trace.

On the slope m / m_land = F (1 + h/d0), a straight line in the height h. But a trace is drawn against the *commanded*
position, and in contact the whisker yields along x by an amount that depends on the force: the tip leaves the edge and
reaches the foot at shifted positions. The heights on the line are therefore taken from the trace itself, at two
positions that need no knowledge of the whisker::

    m/m_land
             F +         the line ends on the floor at its foot, h = -depth. Extended, it reaches
               |\        moment 0 where the surface would no longer lift the tip, h = -d0.
    1 ---------+ \       In between h is linear; extended back to h = 0 the line gives F:
                  \
                   \ foot      F = line(foot) / (1 - depth/d0)
                   |____________
                       .   1 - depth/d0
    0 . . . . . . . . . .  h = -d0
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.surface.maps import HeightMap, TraceDirection
from whisker_array.simulation.surface import prepare_surface
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.simulation.tracing import trace_sweep
from whisker_array.whisker.enhancement import enhancement_factor
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import Touch

# the paper's bench, mm: whisker length and wire diameter, d0, tip radius, depth of the test pieces
L1_MM = 30.0
WIRE_MM = 0.3
PRELOAD_MM = 1.0
TIP_RADIUS_MM = 0.03
DEPTH_MM = 0.5
# fine, because slopes are central differences, which blur the foot by a sample to either side; on a 60 degree slope one
# sample is 0.35 % of the remaining lift
SAMPLE_MM = 0.001
_LAND_MM = 0.6
_VIEW_MM = 1.3
# largest rms residual of line, ramp and floor beyond twice the scatter, as a share of the land's moment
_MOST_MISFIT = 5e-3
# least ratio of the ramp's steepness at the foot to the line's: 8 for the paper's longer arms, 200 for the shortest
_STEEPER = 3.0


class StepError(MarksError):
    """No step can be read off a trace."""


@dataclass(frozen=True)
class Wedge:
    r"""The paper's test piece, Fig. 5(c): a land, a plane that falls away at the intersection angle, a floor.

    ::

          land_mm       run_mm     floor_mm         side view, alike over the whole width;
        ------------.                               traced from left to right (0 deg, columns)
               edge  \ alpha
                      \____________   depth_mm
                     foot
    """

    alpha_rad: float
    depth_mm: float = DEPTH_MM
    land_mm: float = _LAND_MM
    floor_mm: float = 0.5

    @property
    def run_mm(self) -> float:
        """Length of the slope along the trace."""
        return self.depth_mm / math.tan(self.alpha_rad)

    def height_mm(self, x_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height over the land at places along the trace, any shape; x = 0 is the edge."""
        return np.asarray(-np.clip(x_mm * math.tan(self.alpha_rad), 0.0, self.depth_mm))

    def height_map(self, *, pitch_mm: float, rows: int = 3) -> HeightMap:
        """The surface; x = 0 is the beginning of the land."""
        columns = round((self.land_mm + self.run_mm + self.floor_mm) / pitch_mm) + 1
        line = self.height_mm(np.arange(columns, dtype=np.float64) * pitch_mm - self.land_mm)
        return HeightMap(np.broadcast_to(line.astype(np.float32), (rows, columns)), pitch_mm)


@dataclass(frozen=True)
class StepReading:
    """Step parameters read from a trace.

    Attributes:
        factor: F, the step at the edge over the land level.
        land_n_mm: moment on the land.
        line: line on the slope, of the moment over the land's: (rise per mm, value at x = 0).
        edge_mm: commanded position where the line reaches h = 0.
        foot_mm: commanded position where the slope ends on the floor.
        peak: the highest moment, over the land's.
    """

    factor: float
    land_n_mm: float
    line: tuple[float, float]
    edge_mm: float
    foot_mm: float
    peak: float


@dataclass(frozen=True, eq=False)
class Step:
    """A trace over a test piece, and its measured step.

    Attributes:
        k: l2 / l1; 0 is the straight whisker.
        alpha_deg: intersection angle.
        mu: friction coefficient.
        place_mm: (samples,) commanded position of the tip after the edge.
        moment_n_mm: (samples,) moment.
        predicted: F of eq. (16).
    """

    k: float
    alpha_deg: float
    mu: float
    fidelity: Fidelity
    wedge: Wedge
    place_mm: NDArray[np.float64]
    moment_n_mm: NDArray[np.float64]
    predicted: float
    reading: StepReading

    def row(self) -> dict[str, Any]:
        """Row of figures.csv: the step by eq. (16) and as read off, and the highest moment over the land's."""
        return {
            "k": self.k,
            "alpha_deg": self.alpha_deg,
            "mu": self.mu,
            "fidelity": self.fidelity.value,
            "f_predicted": self.predicted,
            "f_read_off": self.reading.factor,
            "error": self.reading.factor / self.predicted - 1.0,
            "peak": self.reading.peak,
        }


def paper_whisker(k: float) -> LShaped:
    """Music wire, l1 = 30 mm, beta = 0, l3 = l2 = k l1; straight at k = 0.

    The test piece does not vary across the trace, so it does not matter that a wire is as soft sideways as upwards.
    """
    if k == 0.0:
        return straight_whisker(L1_MM, 0.0, Round(WIRE_MM))
    return LShaped(L1_MM, k * L1_MM, None, 0.0, Round(WIRE_MM))


def feel_step(
    k: float, alpha_deg: float, mu: float, fidelity: Fidelity, *, tip_radius_mm: float = TIP_RADIUS_MM
) -> Step:
    """Trace a test piece once, and measure the step.

    Raises:
        StepError: the tip jams or leaves the surface, or no step can be read off.
        WhiskerError: eq. (16) has no answer.
    """
    run_mm = DEPTH_MM / math.tan(math.radians(alpha_deg))
    wedge = Wedge(math.radians(alpha_deg), floor_mm=max(0.3, _VIEW_MM - run_mm))
    tip, piece = paper_whisker(k).tip_model(), wedge.height_map(pitch_mm=SAMPLE_MM)
    surface = prepare_surface(piece, tip_radius_mm=tip_radius_mm, friction=mu)
    touch = Touch(tip, PRELOAD_MM, tip_radius_mm, friction=mu)
    line = np.array([[SAMPLE_MM]])
    sweep = SweepPlan(TraceDirection.FORWARD_X, line, 0.0, SAMPLE_MM, surface.shape[1], n_lead=0)
    traces = trace_sweep(
        surface, sweep, touch=touch, fidelity=fidelity, origin_mm=0.0, size_mm=piece.size_mm, commanded=sweep
    )
    wrong = SampleFlag(int(np.bitwise_or.reduce(traces.flags, axis=None)))
    if wrong:
        raise StepError(f"k = {k}, {alpha_deg:g} degrees, mu = {mu}: {wrong.describe()}")
    place = sweep.position_mm() - wedge.land_mm
    moment = np.asarray(traces.moment_n_mm[0, 0], dtype=np.float64)
    return Step(
        k, alpha_deg, mu, fidelity, wedge, place, moment,
        predicted=enhancement_factor(tip, alpha_rad=wedge.alpha_rad, mu=mu),
        reading=read_step(place, moment, wedge=wedge, preload_mm=PRELOAD_MM, blur_mm=SAMPLE_MM),
    )  # fmt: skip


def read_step(
    place_mm: NDArray[np.float64],
    moment_n_mm: NDArray[np.float64],
    *,
    wedge: Wedge,
    preload_mm: float,
    blur_mm: float = 0.0,
) -> StepReading:
    """Measure F on a trace over a test piece, without knowing the whisker, its friction or its fidelity.

    Args:
        place_mm: (samples,) commanded positions, evenly spaced, mm after the edge.
        moment_n_mm: (samples,) moment.
        wedge: the test piece.
        preload_mm: d0, which must exceed the depth of the test piece.
        blur_mm: distance by which a corner shows early: one sample if slopes are central differences.

    Raises:
        StepError: the trace does not fall along the slope and level out on the floor.
    """
    left = 1.0 - wedge.depth_mm / preload_mm
    on_land = (place_mm > -0.8 * wedge.land_mm) & (place_mm < -0.2 * wedge.land_mm)
    # away from the ball's rounding at the edge, and from the foot, which shows early: in contact by 1.5 k tan(alpha) of
    # the run, which is 0.3 of it for the paper's longest arm
    on_slope = (place_mm > 0.2 * wedge.run_mm) & (place_mm < 0.6 * wedge.run_mm)
    land = float(moment_n_mm[on_land].mean())
    ratio = moment_n_mm / land
    rise, start = (float(v) for v in np.polyfit(place_mm[on_slope], ratio[on_slope], 1))
    scatter = float(np.sqrt(np.mean((ratio[on_slope] - (start + rise * place_mm[on_slope])) ** 2)))
    unread = StepError(
        f"the moment does not fall along the slope and level out at {left:g} of the land's",
        hint="check preload, depth and the position of the edge",
    )
    if -rise * wedge.run_mm < 0.2 * (1.0 - left):
        raise unread
    near_foot = (place_mm >= 0.6 * wedge.run_mm) & (place_mm <= 1.4 * wedge.run_mm)
    foot, misfit = _find_foot(place_mm[near_foot], ratio[near_foot], (rise, start), floor=left)
    if misfit > 2.0 * scatter + _MOST_MISFIT:
        raise unread
    # a straight whisker has no step at the foot that could be blurred: the line just crosses the floor's level
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


def _find_foot(
    x: NDArray[np.float64], ratio: NDArray[np.float64], line: tuple[float, float], *, floor: float
) -> tuple[float, float]:
    """Fit the end of the line by least squares; return it and the residual rms.

    In contact the tip waits in the corner while the base moves on, until friction acts as on the floor: the moment
    changes from the line to the floor along a short ramp, whose width is fitted as well. The ramp is much steeper than
    the line; otherwise the two could not be separated.
    """
    from scipy.optimize import minimize

    rise, start = line
    slope = start + rise * x

    def squares(fitted: NDArray[np.float64]) -> float:
        foot, width = fitted  # width of the ramp, as a share of the widest
        corner = start + rise * foot
        widest = abs(corner - floor) / (_STEEPER * abs(rise))
        share = np.clip((x - foot) / max(width * widest, 1e-9), 0.0, 1.0)
        return float(np.mean((np.where(x < foot, slope, corner + (floor - corner) * share) - ratio) ** 2))

    # first without a ramp: the line up to sample j, the floor from there on
    j = int(np.argmin(np.cumsum((ratio - slope) ** 2 - (ratio - floor) ** 2)))
    bounds = [(x[0], x[-1]), (0.0, 1.0)]
    exact = {"xatol": 1e-6, "fatol": 1e-16}
    fit = minimize(squares, (x[j], 0.5), method="Nelder-Mead", bounds=bounds, options=exact)
    return float(fit.x[0]), math.sqrt(fit.fun)
