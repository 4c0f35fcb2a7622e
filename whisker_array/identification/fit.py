r"""The bench that a recording speaks of: least squares on the contact simulation, and how sure each number is.

    minimise  sum over samples ((felt - predicted(p)) / sigma)^2  +  sum over numbers ((p - nominal) / sd)^2

The second sum is what the workshop knew before (`bench.known_before`), without which many numbers could not be told
apart; how sure they are, `certainty` says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.surface.display import one_line
from whisker_array.identification.bench import (
    BENCH_GAIN,
    DRAWN,
    LOOSE_GAIN,
    POSE,
    Bench,
    Unknown,
    known_before,
    nominal_bench,
)
from whisker_array.identification.certainty import COARSER, of_grid, scattered
from whisker_array.identification.forward import GRID_MM, Forward, Heights, Trace, traces_of
from whisker_array.scan.scan import Scan
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

STAGES = (
    (1.5, 2.0, (*POSE, Unknown.PRELOAD)),
    (0.4, 2.0, (*POSE, Unknown.PRELOAD, Unknown.FRICTION, Unknown.PLAY)),
    (0.0, 2.0, tuple(Unknown)),
    (0.0, 1.0, tuple(Unknown)),
)
"""What is fitted one after the other: mm over which the signal is averaged, how much coarser strips are, and numbers
beside the gains. A piece that lies a wall's width off would else be explained by anything. Strips are cut for the pose
found so far."""
MOST_STEPS = 25
SETTLED_SDS = 0.01
STEP_SDS = 0.3
"""Of a difference by which the derivative is taken, in standard deviations of what was known before."""
FEWEST_CLUSTERS = 6
HUBER = 4.0
"""Residuals beyond so many sigma count in proportion, not squared: tips slip around steep edges as they like."""


class IdentifyError(MarksError):
    """A recording that tells nothing of its bench."""


@dataclass(frozen=True, eq=False)
class Identified:
    """A bench as found.

    Attributes:
        bench: the numbers.
        nominal: as drawn.
        before: (n,) standard deviations of the numbers before, in the order of `Bench.vector`.
        covariance: (n, n) of the numbers after.
        repeated: (n, n) the same of a bench that is compared with itself: what the fit's own grid does is in both.
        data: (n, n) what the samples alone tell: their share of H.
        whiskers: those that were felt; the gains of others are as before.
        traces: that were fitted.
        predicted: of each trace, (samples,), N mm.
        sigma_n_mm: scatter of a sample.
        settled: whether the fit has come to rest.
        drawn: the whisker as drawn, if it was given.
    """

    bench: Bench
    nominal: Bench
    before: NDArray[np.float64]
    covariance: NDArray[np.float64]
    repeated: NDArray[np.float64]
    data: NDArray[np.float64]
    whiskers: tuple[int, ...]
    traces: tuple[Trace, ...]
    predicted: tuple[NDArray[np.float64], ...]
    sigma_n_mm: float
    settled: bool
    drawn: LShaped | None = None

    __repr__ = one_line

    @property
    def sd(self) -> NDArray[np.float64]:
        """(n,) standard deviations of the numbers."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def misfit(self) -> float:
        """What is left over, rms in parts of the scatter of a sample: 1 where the model explains all."""
        left = [np.nan_to_num(t.felt_n_mm - p) for t, p in zip(self.traces, self.predicted, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(left) ** 2))) / self.sigma_n_mm

    def of(self, name: Unknown) -> tuple[float, float]:
        """A number and its standard deviation."""
        return self.bench[name], float(self.sd[list(Unknown).index(name)])

    def sd_of(self, function: Callable[[Bench], float]) -> float:
        """Standard deviation of whatever depends on the numbers, to first order."""
        at, gradient = self.bench.vector(), np.empty(self.before.size)
        for i, sd in enumerate(self.sd):
            step = np.zeros(at.size)
            step[i] = STEP_SDS * sd
            up, down = (function(Bench.of_vector(at + s)) for s in (step, -step))
            gradient[i] = 0.0 if sd == 0.0 else (up - down) / (2.0 * step[i])
        return float(np.sqrt(gradient @ self.covariance @ gradient))


def identify(
    scan: Scan,
    heights: Heights,
    *,
    whisker: LShaped | Touch,
    only: tuple[Unknown, ...] = tuple(Unknown),
    grid_mm: float = GRID_MM,
) -> Identified:
    """Find the bench that has made a recording over a piece of known relief.

    Args:
        scan: the recording; its touch is the nominal one. Gains that a bench has shown are taken off and known well,
            those from land are not used: they hold the friction that is to be found.
        heights: of the piece.
        whisker: as drawn; a touch, where there is no drawing: lengths and angle are not found then.
        only: numbers to be found; the others stay as drawn.
        grid_mm: of the strips.

    Raises:
        IdentifyError: too few passes over the piece, or a signal that no such bench gives.
        MapError: no line that can be used.
        WhiskerError: a whisker that is no L.
    """
    if isinstance(whisker, Touch):
        only = tuple(name for name in only if name not in DRAWN)
    known = scan.calibration is not None and not scan.calibration.from_land
    nominal = nominal_bench(whisker, scan.touch, n_whiskers=scan.n_whiskers)
    scan = scan if known else _bare(scan)
    traces = traces_of(scan)
    clusters = {trace.cluster for trace in traces}
    if len(clusters) < FEWEST_CLUSTERS:
        raise IdentifyError(
            f"only {len(clusters)} of the passes can be used over the piece",
            hint=f"record {FEWEST_CLUSTERS} or more",
        )
    before = known_before(nominal, gain_sd=BENCH_GAIN if known else LOOSE_GAIN)
    felt_by = tuple(sorted({trace.whisker for trace in traces}))
    free = np.array(
        [name in only for name in Unknown] + [w in felt_by for w in range(scan.n_whiskers)], dtype=np.bool_
    )
    sigma = _sigma_n_mm(traces)
    found, settled = nominal, False
    for blur_mm, coarser, names in STAGES:
        stage = free & np.array([name in names for name in Unknown] + [True] * scan.n_whiskers)
        forward = Forward(
            heights,
            traces,
            nominal=whisker,
            about=found,
            setup_friction=scan.touch.friction,
            grid_mm=coarser * grid_mm,
        )
        forward.spare_jams(found)
        found, settled = _fitted(forward, found, nominal, before, stage, sigma, blur_mm)
    traces = forward.traces
    predicted = forward.moments(found)
    residual = _residuals(traces, predicted)
    jacobian = _jacobian(forward, found, before, free, predicted)
    weight = [_weight(r, sigma) for r in residual]
    residual = [w * r for w, r in zip(weight, residual, strict=True)]
    data = np.zeros((before.size, before.size))
    for j, w in zip(jacobian, weight, strict=True):
        data += j.T @ (w[:, None] * j) / sigma**2
    repeated = scattered(jacobian, residual, traces, data, before, free, sigma)
    wide = Forward(
        heights, traces, nominal=whisker, about=found, setup_friction=scan.touch.friction,
        grid_mm=COARSER * grid_mm,
    ).moments(found)  # fmt: skip
    covariance = repeated + of_grid(jacobian, weight, predicted, wide, data, before, free, sigma)
    return Identified(
        found,
        nominal,
        before,
        covariance,
        repeated,
        data,
        felt_by,
        traces,
        tuple(predicted),
        sigma,
        settled,
        whisker if isinstance(whisker, LShaped) else None,
    )


def _bare(scan: Scan) -> Scan:
    from dataclasses import replace

    return replace(scan, calibration=None)


def _sigma_n_mm(traces: tuple[Trace, ...]) -> float:
    """Scatter of a sample, by the differences of neighbours: robust, for at edges they are no scatter."""
    steps = np.concatenate([np.diff(trace.felt_n_mm) for trace in traces])
    steps = steps[np.isfinite(steps)]
    if steps.size < 100:
        raise IdentifyError("hardly a sample of the recording can be used", hint="see inspect")
    spread = float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))
    level = float(np.nanmedian(np.abs(np.concatenate([t.felt_n_mm for t in traces]))))
    return max(spread, 1e-5 * level)


def _residuals(traces: tuple[Trace, ...], predicted: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """(samples,) of every trace, 0 where it is not to be used."""
    return [np.nan_to_num(t.felt_n_mm - p, nan=0.0) for t, p in zip(traces, predicted, strict=True)]


def _huber(misses: NDArray[np.float64]) -> float:
    """Twice Huber's loss of residuals in sigmas."""
    size = np.abs(misses)
    return float(np.where(size <= HUBER, size**2, 2.0 * HUBER * size - HUBER**2).sum())


def _weight(residual: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    return np.asarray(np.minimum(1.0, HUBER * sigma / np.maximum(np.abs(residual), 1e-12)))


def _averaged(samples: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Each sample the mean of so many about it, along the first axis."""
    if width < 2:
        return samples
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(samples, width, axis=0, mode="nearest"))


def _jacobian(
    forward: Forward,
    at: Bench,
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    here: list[NDArray[np.float64]],
) -> list[NDArray[np.float64]]:
    """(samples, n) of every trace: what each number does to the prediction."""
    vector, n_shared = at.vector(), len(Unknown)
    out = [np.zeros((p.size, vector.size)) for p in here]
    for i in np.flatnonzero(free[:n_shared]):
        step = np.zeros(vector.size)
        # a tip's radius is felt through the grid: a difference across several of its samples
        step[i] = (0.5 if list(Unknown)[i] is Unknown.RADIUS else STEP_SDS) * before[i]
        for k, (there, p) in enumerate(
            zip(forward.moments(Bench.of_vector(vector + step)), here, strict=True)
        ):
            out[k][:, i] = (there - p) / step[i]
    for k, (trace, p) in enumerate(zip(forward.traces, here, strict=True)):
        out[k][:, n_shared + trace.whisker] = p / at.gain[trace.whisker]
        out[k][np.isnan(trace.felt_n_mm)] = 0.0
    return out


def _fitted(
    forward: Forward,
    start: Bench,
    nominal: Bench,
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    sigma: float,
    blur_mm: float,
) -> tuple[Bench, bool]:
    """Levenberg and Marquardt's descent, in units of what was known before."""
    p0, at, damping = nominal.vector(), start, 1e-3
    widths = [max(1, round(blur_mm / trace.plan.step_mm)) for trace in forward.traces]

    def missed(predicted: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        return [_averaged(r, w) for r, w in zip(_residuals(forward.traces, predicted), widths, strict=True)]

    def cost(bench: Bench, predicted: list[NDArray[np.float64]]) -> float:
        misses = sum(_huber(r / sigma) for r in missed(predicted))
        return misses + float((((bench.vector() - p0) / before)[free] ** 2).sum())

    here = forward.moments(at)
    now = cost(at, here)
    for _ in range(MOST_STEPS):
        jacobian = _jacobian(forward, at, before, free, here)
        residual = missed(here)
        scaled = [
            _averaged(j[:, free], width) * before[free] / sigma
            for j, width in zip(jacobian, widths, strict=True)
        ]
        weight = [_weight(r, sigma) for r in residual]
        curvature = np.eye(int(free.sum()))
        downhill = np.zeros(int(free.sum()))
        for j, r, w in zip(scaled, residual, weight, strict=True):
            curvature += j.T @ (w[:, None] * j)
            downhill += j.T @ (w * r) / sigma
        downhill -= ((at.vector() - p0) / before)[free]
        for _ in range(8):
            damped = curvature + damping * np.diag(np.diag(curvature))
            step = np.clip(np.linalg.solve(damped, downhill), -2.0, 2.0)
            moved = at.vector()
            moved[free] += step * before[free]
            try:
                tried = Bench.of_vector(moved)
                there = forward.moments(tried)
                then = cost(tried, there)
            except WhiskerError:
                then = np.inf
            if then < now:
                break
            damping *= 8.0
        else:
            return at, True  # no way leads further down
        gone = float(np.abs(step).max())
        at, here, now, damping = tried, there, then, damping / 4.0
        if gone < SETTLED_SDS:
            return at, True
    return at, False
