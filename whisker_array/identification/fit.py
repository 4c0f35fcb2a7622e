r"""Identify a bench from a recording: one least squares on the contact simulation, from coarse to fine.

    minimise  sum over samples rho((measured - predicted(p)) / sigma)  +  sum over numbers rho((p - nominal) / sd)

    sigma^2 = scatter of a sample^2 + (place_mm dm/du)^2

The second sum is the workshop's prior knowledge (`bench.prior_sd`), without which many numbers could not be separated:
one row of the problem for each number. rho is that of soft L1, linear beyond `BEND` sigmas, so that the jumps of tips
that slip at steep edges do not dominate. At edges a sample is also uncertain because a pass does not return exactly to
its line. Contact is rough: a small change of a number makes single samples jump. So samples are averaged over `PIXEL`
of them, and derivatives are central differences over a share of the prior standard deviation, without the samples
that jump between (`MOST_BEND`).

The covariance has four parts, linear about the solution: priors; the delete-one jackknife over sweeps, whose samples
share errors of the simulation in that direction, as well as vibration and drift (B. Efron, C. Stein, The jackknife
estimate of variance, Ann. Statist. 9 (1981) 586); errors of the stage's screws and of the piece's form, which all
passes share; and the Newton step that is left where the rough sum has stopped the fit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from glyphs.errors import MarksError
from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.identification.bench import (
    BENCH_GAIN,
    DRAWN,
    GROUND_TIP,
    LOOSE_GAIN,
    Bench,
    Unknown,
    first_order_sd,
    nominal_bench,
    prior_sd,
)
from whisker_array.identification.forward import GRID_MM, Forward
from whisker_array.identification.piece_map import Heights
from whisker_array.identification.traces import Trace, mask_jams, sample_sigma_n_mm, scatter_n_mm, traces_of
from whisker_array.scan.scan import Scan
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch


@dataclass(frozen=True)
class Stage:
    """One resolution of the fit."""

    lines: int
    coarser: float  # pitch of the map over that requested
    place_mm: float  # standard deviation of a position; wide at first, so that edges attract each other
    step: float  # half the width of a difference by a position or the friction, in prior standard deviations
    numbers: tuple[Unknown, ...] = tuple(Unknown)
    # whether samples that jump are left out of the slopes; far from the solution nothing would be left
    smooth: bool = True


POSITIONS = (Unknown.SHIFT_X, Unknown.SHIFT_Y, Unknown.YAW, Unknown.PLAY)
FIRST = (*POSITIONS[:3], Unknown.PRELOAD, Unknown.FRICTION, Unknown.TILT_X, Unknown.TILT_Y)
"""Numbers of the first stage, which put the piece under the lines; the others hardly move an edge."""
STAGES = (
    Stage(48, 2.0, 0.1, 0.5, FIRST, smooth=False),
    Stage(96, 1.3, 0.02, 0.2),
    Stage(192, 1.0, 0.005, 0.1),
)
"""The last `place_mm` is the amplitude of the waves of usual screws within a turn (tolerance grade 5 of ISO 3408-3)."""
STEP, LENGTH_STEP = 0.3, 1.0
"""Half the width of a difference by other numbers, prior standard deviations: the signal is nearly linear
in them, and a wide difference drowns the roughness."""
BEND = 1.5
MOST_BEND = 0.5
"""Most bend of a sample between the ends of a difference, in its slope: a jump on one side has 1."""
FEWEST_SWEEPS = 4
"""Fewest sweeps for the jackknife; with fewer it goes by passes."""
PIXEL = 4
LEVEL_SD, LEVEL_DEGREE = 0.5, 3
"""A pass's level drifts as Legendre polynomials up to this degree, each of this size in scatters of a sample."""
SAME_MM, SCREW_SD_MM, FORM_SD_MM = 1.0, 0.0028, 0.005
"""Length, mm, within which all passes share an error of position: half a turn of a screw, a place of the piece. Rms of
a screw's wave of 8 um from crest to trough (tolerance grade 5 of ISO 3408-3), and of the walls of a milled or eroded
piece, or of a map of one with a pitch of 0.02 mm."""
_WORST = 0.02
"""Share of the worst samples that the misfit leaves out."""


class IdentifyError(MarksError):
    """A recording from which no bench can be identified."""


@dataclass(frozen=True, eq=False, repr=False)
class Identified(OneLine):
    """An identified bench; unused gains keep their prior. `repeated` (n, n) compares fits of the same bench."""

    bench: Bench
    nominal: Bench
    before: Floats
    covariance: Floats
    repeated: Floats
    whiskers: tuple[int, ...]
    traces: tuple[Trace, ...]
    predicted: tuple[Floats, ...]
    scatter_n_mm: float
    settled: bool
    drawn: LShaped | None = None

    @property
    def sd(self) -> Floats:
        return np.sqrt(np.diag(self.covariance))

    @property
    def misfit(self) -> float:
        """Rms misfit over the uncertainty of a sample, without the worst 2 %: 1 if the model explains all."""
        residuals = np.concatenate(
            [
                (t.measured_n_mm - p) / sample_sigma_n_mm(t, self.scatter_n_mm, place_mm=STAGES[-1].place_mm)
                for t, p in zip(self.traces, self.predicted, strict=True)
            ]
        )
        squares = np.sort(residuals[np.isfinite(residuals)] ** 2)
        return float(np.sqrt(np.mean(squares[: int((1.0 - _WORST) * squares.size)])))

    def of(self, name: Unknown) -> tuple[float, float]:
        return self.bench[name], float(self.sd[list(Unknown).index(name)])

    def sd_of(self, function: Callable[[Bench], float], *, probe_sds: float = 0.1) -> float:
        """Standard deviation of a function of the numbers, to first order, by steps of `probe_sds` times their own."""
        vector = self.bench.vector()

        def moved(i: int, step: float) -> float:
            return function(Bench.of_vector(vector + np.where(np.arange(vector.size) == i, step, 0.0)))

        return first_order_sd(moved, probe_sds * self.sd, self.covariance)


def identify(
    # the recording; its touch is the nominal one. Gains calibrated on a bench are removed and have a small
    # prior uncertainty; gains from land are ignored, because they contain the friction.
    scan: Scan,
    heights: Heights,
    *,
    whisker: LShaped | Touch,
    only: tuple[Unknown, ...] = tuple(Unknown),
    grid_mm: float = GRID_MM,
    tip_sd: float = GROUND_TIP,  # prior standard deviation of the tip's radius, as a share of the radius
    fewest_passes: int = 6,
    finest: float = 0.1,  # finest grid as a share of the tip's radius; a finer one adds no detail
) -> Identified:
    """Identify the bench of a recording over a piece of known relief.

    Raises IdentifyError for too few passes or samples, MapError without a line, WhiskerError for another shape.
    """
    if isinstance(whisker, Touch):
        only = tuple(name for name in only if name not in DRAWN)
    known = scan.calibration is not None and not scan.calibration.from_land
    scan = scan if known else replace(scan, calibration=None)
    nominal = nominal_bench(whisker, scan.touch, n_whiskers=scan.n_whiskers)
    sd = prior_sd(nominal, gain_sd=BENCH_GAIN if known else LOOSE_GAIN, tip_sd=tip_sd)
    traces = traces_of(scan)
    if len({trace.cluster for trace in traces}) < fewest_passes:
        raise IdentifyError(
            f"only {len({trace.cluster for trace in traces})} passes over the piece can be used",
            hint=f"record {fewest_passes} or more",
        )
    if sum(int(np.isfinite(trace.measured_n_mm).sum()) for trace in traces) < 100:
        raise IdentifyError(
            "hardly any sample of the recording can be used", hint="look at the recording with inspect"
        )
    scatter, pitch_mm = scatter_n_mm(traces), max(grid_mm, finest * scan.touch.tip_radius_mm)
    u = np.zeros(sd.size)
    for stage in STAGES:
        about = nominal.moved(sd * u)
        forward = Forward(
            heights,
            traces_of(scan, most=stage.lines),
            nominal=whisker,
            about=about,
            setup_friction=scan.touch.friction,
            grid_mm=stage.coarser * pitch_mm,
        )
        forward.exclude_jams(about)
        rows = _Rows(forward, nominal, sd, only, stage, scatter)
        u = least_squares(
            rows, u, rows.jacobian, loss="soft_l1", f_scale=BEND, ftol=3e-4, xtol=1e-3, max_nfev=16
        ).x
    jacobian, residuals = linear = rows.scaled(u)
    left = -np.linalg.solve(jacobian.T @ jacobian, jacobian.T @ residuals)
    # derivative of each number by its u: some numbers move in proportion (`Bench.moved`)
    above, below = (nominal.moved(sd * (u + off)).vector() for off in (1e-4, -1e-4))
    scale = (above - below) / 2e-4
    repeated = rows.jackknife(linear, lambda trace: trace.cluster, shared=False)
    few = len({id(trace.plan) for trace in forward.traces}) < FEWEST_SWEEPS
    covariance = rows.jackknife(linear, lambda trace: trace.cluster if few else id(trace.plan), shared=True)
    settled = bool((left**2 < np.diag(covariance)).all())
    covariance += np.outer(left, left)
    bench = nominal.moved(sd * u)
    return Identified(
        bench,
        nominal,
        sd,
        covariance * np.outer(scale, scale),
        repeated * np.outer(scale, scale),
        tuple(sorted({trace.whisker for trace in forward.traces})),
        forward.traces,
        tuple(forward.moments(bench)),
        scatter,
        settled,
        whisker if isinstance(whisker, LShaped) else None,
    )


class Whitener:
    """Make pixels of a trace independent with variance 1: (I + B B^T)^(-1/2), B the drift's shapes over their sigma."""

    def __init__(self, trace: Trace, scatter_n_mm: float, place_mm: float) -> None:
        self._weight = 1.0 / sample_sigma_n_mm(trace, scatter_n_mm, place_mm=place_mm)
        shapes = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, self._weight.size), LEVEL_DEGREE)
        drift = self._pixels(np.asarray(LEVEL_SD * scatter_n_mm * shapes, dtype=np.float64))
        self._axes, size, _ = np.linalg.svd(drift, full_matrices=False)
        self._removed = 1.0 - 1.0 / np.sqrt(1.0 + size**2)

    def _pixels(self, values: Floats) -> Floats:
        n = len(values) // PIXEL
        weighted = (self._weight[:, None] * values)[: n * PIXEL]
        return np.asarray(weighted.reshape(n, PIXEL, -1).sum(axis=1) / np.sqrt(PIXEL))

    def __call__(self, values: Floats) -> Floats:
        """(samples, n) values, N mm, to (samples / PIXEL, n)."""
        pixels = self._pixels(values)
        return np.asarray(pixels - self._axes @ (self._removed[:, None] * (self._axes.T @ pixels)))


class _Rows:
    def __init__(
        self,
        forward: Forward,
        nominal: Bench,
        sd: Floats,
        only: tuple[Unknown, ...],
        stage: Stage,
        scatter: float,
    ) -> None:
        self._forward, self._nominal, self._sd, self._smooth = forward, nominal, sd, stage.smooth
        # stiffness and gains are factors of the moment; the others are varied, the radius last, for it changes the map
        fitted = set(only) & set(stage.numbers)
        varied = [i for i, name in enumerate(Unknown) if name in fitted and name is not Unknown.STIFFNESS]
        self._varied = sorted(varied, key=list(Unknown).index(Unknown.RADIUS).__eq__)
        steps = dict.fromkeys(Unknown, STEP) | dict.fromkeys(DRAWN[:3], LENGTH_STEP)
        self._steps = list((steps | dict.fromkeys((*POSITIONS, Unknown.FRICTION), stage.step)).values())
        self._stiffness = [list(Unknown).index(name) for name in fitted if name is Unknown.STIFFNESS]
        self._whiten = [Whitener(trace, scatter, stage.place_mm) for trace in forward.traces]
        self._measured = [np.nan_to_num(trace.measured_n_mm) for trace in forward.traces]

    def _moments(self, u: Floats) -> list[Floats]:
        return self._forward.moments(self._nominal.moved(self._sd * u))

    def __call__(self, u: Floats) -> Floats:
        residuals = [
            whiten((measured - moment)[:, None])[:, 0]
            for whiten, measured, moment in zip(self._whiten, self._measured, self._moments(u), strict=True)
        ]
        return np.concatenate([*residuals, u])

    def jacobian(self, u: Floats) -> Floats:
        moments, n = self._moments(u), u.size
        sides = {}
        for i in self._varied:
            step = np.where(np.arange(n) == i, self._steps[i], 0.0)
            sides[i] = self._moments(u + step), self._moments(u - step)
        rows = []
        for k, (trace, whiten) in enumerate(zip(self._forward.traces, self._whiten, strict=True)):
            slopes = np.zeros((moments[k].size, n))
            for i, (above, below) in sides.items():
                # a sample of a tip that jams on either side says nothing of the slope
                high, low = mask_jams(above[k], share=0.98), mask_jams(below[k], share=0.98)
                slope, bend = np.nan_to_num([high - low, high + low - 2.0 * moments[k]]) / (
                    2.0 * self._steps[i]
                )
                smooth = np.abs(bend) < MOST_BEND * np.abs(slope) if self._smooth else 1.0
                slopes[:, i] = smooth * slope
            for i in (*self._stiffness, len(Unknown) + trace.whisker):
                slopes[:, i] = moments[k] * self._sd[i]
            rows.append(whiten(slopes))
        return np.concatenate([-np.concatenate(rows), np.eye(n)])

    def scaled(self, u: Floats) -> tuple[Floats, Floats]:
        """Jacobian J and residuals r, scaled by the loss: J^T J is its Hessian, J^T r its gradient."""
        residuals = self(u)
        z = (residuals / BEND) ** 2
        return self.jacobian(u) * (1.0 + z[:, None]) ** -0.75, residuals * (1.0 + z) ** 0.25

    def jackknife(
        self, linear: tuple[Floats, Floats], group_of: Callable[[Trace], Hashable], *, shared: bool
    ) -> Floats:
        """(n, n) covariance of u from what `scaled` returns: of priors, groups, and what screws and form share."""
        (jacobian, residuals), start = linear, 0
        n = jacobian.shape[1]
        groups: dict[Hashable, Floats] = defaultdict(lambda: np.zeros((n, n + 1)))
        effects: dict[Hashable, Floats] = defaultdict(lambda: np.zeros(n))
        for trace in self._forward.traces:
            rows = slice(start, start + trace.measured_n_mm.size // PIXEL)
            j, start = jacobian[rows], rows.stop
            groups[group_of(trace)] += j.T @ np.column_stack([j, residuals[rows]])
            along_x, across = trace.plan.direction.along_x, trace.line_mm // SAME_MM
            turns = trace.plan.position_mm()[: len(j) * PIXEL : PIXEL] // SAME_MM
            for turn, name in product(np.unique(turns) if shared else (), (Unknown.SHIFT_X, Unknown.SHIFT_Y)):
                i, same = list(Unknown).index(name), j[turns == turn]
                effect = same.T @ same[:, i] / self._sd[i]
                along = along_x == (name is Unknown.SHIFT_X)
                effects["screw", name, along, turn if along else across] += SCREW_SD_MM * effect
                effects["form", name, (turn, across) if along_x else (across, turn)] += FORM_SD_MM * effect
        hessian = jacobian.T @ jacobian
        offsets = [np.linalg.solve(hessian - each[:, :n], each[:, n]) for each in groups.values()]
        moved = np.array([*effects.values()]).reshape(-1, n)
        prior = np.linalg.inv(hessian)
        scatter = (len(offsets) - 1) * np.cov(offsets, rowvar=False, bias=True)
        return np.asarray(scatter + prior @ (np.eye(n) + moved.T @ moved) @ prior)
