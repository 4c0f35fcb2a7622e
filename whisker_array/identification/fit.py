r"""Identify a bench from a recording: least squares on the contact simulation, with the uncertainty of each number.

    minimise  sum over samples ((measured - predicted(p)) / sigma)^2  +  sum over numbers ((p - nominal) / sd)^2

    sigma^2 = scatter of a sample^2 + (place_mm dm/du)^2 + roughness^2

Residuals are relative to a drifting level (`residuals`). The prediction is a plane through a cloud of benches
(`cloud`), fitted again around each solution. The second sum is the workshop's prior knowledge (`bench.prior_sd`),
without which many numbers could not be separated; `certainty` computes the covariance. At edges a sample is also
uncertain because a pass does not return exactly to its line; screw errors common to all passes are among the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.surface.display import OneLine
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
    screw_slice,
)
from whisker_array.identification.certainty import COARSE_FACTOR, Fitted, left_out_covariance
from whisker_array.identification.cloud import plane_through
from whisker_array.identification.forward import GRID_MM, Forward
from whisker_array.identification.piece_map import Heights
from whisker_array.identification.residuals import innovations, residuals, sample_sigma_n_mm, weight
from whisker_array.identification.traces import MOST_TRACES, Trace, traces_of
from whisker_array.scan.scan import Scan
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch


@dataclass(frozen=True)
class Round:
    """Settings of one round of the fit.

    Attributes:
        coarser: factor by which the map is coarser than requested.
        lines: greatest number of lines.
        turns, cautious: arguments of the cloud (`cloud.plane_through`).
    """

    coarser: float
    lines: int
    turns: int = 1
    cautious: bool = False


ROUNDS = (
    Round(2.0, 48),
    *[Round(1.3, 96)] * 3,
    *[Round(1.0, 144)] * 2,
    *[Round(1.0, 288, 2, cautious=True)] * 2,
)
"""Rounds of the fit, from a cloud as wide as the prior. With three times as many lines, angle and radius are
two thirds as uncertain."""
BOUNDS = (256.0, 128.0, 64.0, 32.0, 16.0, 8.0, *[4.0] * 6)
"""Bounds of the loss in sigmas, which shrink step by step so that the first bench does not decide which samples are
outliers: graduated non-convexity (H. Yang, P. Antonante, V. Tzoumas, L. Carlone, IEEE Robot. Autom. Lett. 5 (2020)
1127)."""
_LEFT_OUT = 0.02
"""Share of the worst samples that the misfit leaves out."""


class IdentifyError(MarksError):
    """A recording from which no bench can be identified."""


@dataclass(frozen=True, eq=False, repr=False)
class Identified(OneLine):
    """An identified bench.

    Attributes:
        bench: the numbers.
        nominal: parameters of the drawing.
        before: (n,) prior standard deviations of the numbers, in the order of `Bench.vector`.
        covariance: (n, n) posterior covariance of the numbers.
        repeated: (n, n) covariance for comparing fits of the same bench, without errors common to both, as of the grid.
        whiskers: whiskers used in the fit; the gains of others keep their prior.
        traces: traces that were fitted.
        predicted: for each trace (samples,), predicted moment, N mm.
        scatter_n_mm: scatter of a sample.
        settled: whether the fit has converged.
        drawn: the whisker as drawn, if it was given.
    """

    bench: Bench
    nominal: Bench
    before: NDArray[np.float64]
    covariance: NDArray[np.float64]
    repeated: NDArray[np.float64]
    whiskers: tuple[int, ...]
    traces: tuple[Trace, ...]
    predicted: tuple[NDArray[np.float64], ...]
    scatter_n_mm: float
    settled: bool
    drawn: LShaped | None = None

    @property
    def sd(self) -> NDArray[np.float64]:
        """(n,) standard deviations of the numbers."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def misfit(self) -> float:
        """Rms misfit divided by the uncertainty of a sample: 1 if the model explains all.

        The worst share `_LEFT_OUT` is left out, because there the tip slips or jams differently from the prediction.
        """
        left = np.concatenate(
            [
                (t.measured_n_mm - p) / sample_sigma_n_mm(t, self.scatter_n_mm)
                for t, p in zip(self.traces, self.predicted, strict=True)
            ]
        )
        squares = np.sort(left[np.isfinite(left)] ** 2)
        return float(np.sqrt(np.mean(squares[: int((1.0 - _LEFT_OUT) * squares.size)])))

    def of(self, name: Unknown) -> tuple[float, float]:
        """Return a number and its standard deviation."""
        return self.bench[name], float(self.sd[list(Unknown).index(name)])

    def sd_of(self, function: Callable[[Bench], float], *, probe_sds: float = 0.1) -> float:
        """Standard deviation of a function of the numbers, to first order, by steps of `probe_sds` times their own."""
        at = self.bench.vector()

        def moved(i: int, off: float) -> float:
            return function(Bench.of_vector(at + np.where(np.arange(at.size) == i, off, 0.0)))

        return first_order_sd(moved, probe_sds * self.sd, self.covariance)


def identify(
    scan: Scan,
    heights: Heights,
    *,
    whisker: LShaped | Touch,
    only: tuple[Unknown, ...] = tuple(Unknown),
    grid_mm: float = GRID_MM,
    tip_sd: float = GROUND_TIP,
    seed: int = 0,
    fewest_clusters: int = 6,
    finest: float = 0.1,
    wide: float = 3.0,
    averaged: int = 2,
    settled: float = 0.05,
) -> Identified:
    """Identify the bench of a recording over a piece of known relief.

    Args:
        scan: the recording; its touch is the nominal one. Gains calibrated on a bench are removed and have a small
            prior uncertainty; gains from land are ignored, because they contain the friction.
        heights: heights of the test piece.
        whisker: the drawn whisker; a touch, if there is no drawing: lengths and angle are not fitted then.
        only: numbers to fit; the others stay nominal.
        grid_mm: pitch of the maps; those of large tips are coarser (`finest`).
        tip_sd: prior standard deviation of the tip's radius, as a share of the radius.
        seed: seed of the clouds' random rotations.
        fewest_clusters: least number of passes over the piece.
        finest: finest grid as a share of the tip's radius; a finer one adds no detail.
        wide: width of the cloud, in the standard deviations of a fit to `MOST_TRACES` lines; with a cloud narrower than
            the roughness of contact the fit would stop anywhere.
        averaged: number of last rounds whose mean is the result, because the random rotation of a cloud changes the
            effect of roughness.
        settled: greatest relative change of the residuals between the last two rounds of a converged fit.

    Raises:
        IdentifyError: too few passes over the piece, or a signal that no such bench gives.
        MapError: no usable line.
        WhiskerError: the whisker is not L-shaped.
    """
    if isinstance(whisker, Touch):
        only = tuple(name for name in only if name not in DRAWN)
    known = scan.calibration is not None and not scan.calibration.from_land
    nominal = nominal_bench(whisker, scan.touch, n_whiskers=scan.n_whiskers)
    scan = scan if known else replace(scan, calibration=None)
    traces = traces_of(scan)
    clusters = {trace.cluster for trace in traces}
    if len(clusters) < fewest_clusters:
        raise IdentifyError(
            f"only {len(clusters)} passes over the piece can be used",
            hint=f"record {fewest_clusters} or more",
        )
    before = prior_sd(nominal, gain_sd=BENCH_GAIN if known else LOOSE_GAIN, tip_sd=tip_sd)
    used = tuple(sorted({trace.whisker for trace in traces}))
    free = np.zeros(before.size, dtype=np.bool_)
    free[: len(Unknown)] = [name in only for name in Unknown]
    for whisker_number in used:
        free[len(Unknown) + whisker_number] = True
    for along_x in {trace.plan.direction.along_x for trace in traces}:
        free[screw_slice(before.size, along_x=along_x)] = True
    scatter = _scatter_n_mm(traces)
    grid_mm = max(grid_mm, finest * scan.touch.tip_radius_mm)

    def lay_map(about: Bench, coarser: float, lines: tuple[Trace, ...]) -> Forward:
        forward = Forward(
            heights,
            lines,
            nominal=whisker,
            about=about,
            setup_friction=scan.touch.friction,
            grid_mm=coarser * grid_mm,
        )
        forward.exclude_jams(about)
        return forward

    found, cloud, rested, left = nominal, np.diag(before**2), [nominal.vector()], [np.inf]
    for number, each in enumerate(ROUNDS):
        lines = traces_of(scan, most=each.lines)
        forward = lay_map(found, each.coarser, lines)
        around = partial(
            plane_through,
            at=found,
            covariance=cloud,
            free=free,
            scatter_n_mm=scatter,
            turns=each.turns,
            cautious=each.cautious,
            seed=(seed, number),
        )
        plane = around(forward)
        seen = partial(_whiten, sigma=plane.sigma, scatter_n_mm=scatter)
        missed = residuals(forward.traces, plane.moment)
        away = found.vector() - nominal.vector()
        fitted, step = _solve(forward.traces, seen(plane.jacobian), seen(missed), away, before, free)
        if each is ROUNDS[-1]:
            coarse = around(lay_map(found, COARSE_FACTOR * each.coarser, forward.traces))
            by_grid = seen(p - q for p, q in zip(plane.moment, coarse.moment, strict=True))
        repeated = fitted.scatter_covariance()
        width = wide * np.sqrt(len(forward.traces) / MOST_TRACES)
        shrunk = np.minimum(1.0, before / (width * np.sqrt(np.diag(repeated))))
        cloud = width**2 * repeated * np.outer(shrunk, shrunk)
        found = found.moved(step)
        rested.append(found.vector())
        left.append(fitted.rms_left)
    found = Bench.of_vector(np.mean(rested[-averaged:], axis=0))
    repeated = repeated + np.cov(rested[-averaged:], rowvar=False) / averaged
    return Identified(
        found,
        nominal,
        before,
        repeated + fitted.grid_covariance(by_grid) + left_out_covariance(nominal),
        repeated,
        used,
        forward.traces,
        tuple(forward.moments(found)),
        scatter,
        bool(abs(left[-1] / left[-2] - 1.0) < settled),
        whisker if isinstance(whisker, LShaped) else None,
    )


def _whiten(
    values: Iterable[NDArray[np.float64]], *, sigma: tuple[NDArray[np.float64], ...], scatter_n_mm: float
) -> tuple[NDArray[np.float64], ...]:
    """Innovations of every trace about a drifting level, in sigmas."""
    return tuple(innovations(v, s, scatter=scatter_n_mm) for v, s in zip(values, sigma, strict=True))


def _solve(
    traces: tuple[Trace, ...],
    jacobian: tuple[NDArray[np.float64], ...],
    missed: tuple[NDArray[np.float64], ...],
    away: NDArray[np.float64],
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
) -> tuple[Fitted, NDArray[np.float64]]:
    """Solve least squares on a plane; return the step (n,) from its middle, which is `away` from nominal."""
    step = np.zeros(before.size)
    for bound in BOUNDS:
        left = tuple(r - j @ step for r, j in zip(missed, jacobian, strict=True))
        weights = tuple(weight(r, bound=bound) for r in left)
        fitted = Fitted(traces, jacobian, left, weights, before, free)
        step = fitted.step(missed, away)
    return fitted, step


def _scatter_n_mm(traces: tuple[Trace, ...]) -> float:
    """Scatter of a sample from differences of neighbours, robust against edges."""
    steps = np.concatenate([np.diff(trace.measured_n_mm) for trace in traces])
    steps = steps[np.isfinite(steps)]
    if steps.size < 100:
        raise IdentifyError(
            "hardly any sample of the recording can be used", hint="look at the recording with inspect"
        )
    spread = float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))
    level = float(np.nanmedian(np.abs(np.concatenate([t.measured_n_mm for t in traces]))))
    return max(spread, 1e-5 * level)
