r"""The bench that a recording speaks of: least squares on the contact simulation, and how sure each number is.

    minimise  sum over samples ((felt - predicted(p)) / sigma)^2  +  sum over numbers ((p - nominal) / sd)^2

    sigma^2 = scatter of a sample^2 + (PLACE_MM dm/du)^2 + (what a wider grid changes)^2

felt - predicted is what a level that walks on leaves of it (`misses`).
The second sum is what the workshop knew before (`bench.known_before`), without which many numbers could not be told
apart; how sure they are, `certainty` says. At edges a sample is as uncertain as its place, for a pass does not come
back to its line; what a screw does to all passes alike is among the numbers. The sum is rough, as contact is: what is
told is the mean of where the descent rests on several grids, and their scatter adds to its uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.surface.display import one_line
from whisker_array.estimation.steadied import steadied
from whisker_array.identification.bench import (
    BENCH_GAIN,
    DRAWN,
    LOOSE_GAIN,
    POSE,
    Bench,
    Unknown,
    known_before,
    nominal_bench,
    of_screw,
    of_whisker,
)
from whisker_array.identification.certainty import COARSER, Fitted
from whisker_array.identification.descent import descended
from whisker_array.identification.forward import GRID_MM, Forward
from whisker_array.identification.misses import Loss, innovations, residuals, sample_sigma_n_mm
from whisker_array.identification.piece_map import Heights
from whisker_array.identification.remembered import LARGEST_LANDS
from whisker_array.identification.tangents import jacobian_of
from whisker_array.identification.traces import Trace, traces_of
from whisker_array.scan.scan import Scan
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

STAGES = (
    (1.5, 4.0, 48, Loss.HUBER, (*POSE, Unknown.PRELOAD)),
    (0.4, 4.0, 48, Loss.HUBER, (*POSE, Unknown.PRELOAD, Unknown.FRICTION, Unknown.PLAY)),
    (0.0, 1.3, 96, Loss.HUBER, tuple(Unknown)),
    (0.0, 1.3, 96, Loss.BOUNDED, tuple(Unknown)),
)
"""What is fitted one after the other: mm over which the signal is averaged, how much coarser the map is, how many
lines, the loss, and numbers beside those of each whisker. A piece that lies a wall's width off would else be explained
by anything. Maps are laid for the tip found so far, and what gauges remember is told by the bench found so far."""
LAST = ((2.0, 96), (1.3, 288), (1.15, 288), (1.0, 288))
"""How much coarser the map is in the end, and how many lines; a sample is as uncertain, too, as a grid twice as wide
makes it. Three times the lines leave angle and radius two thirds as uncertain."""
AVERAGED = 3
"""So many of the last are averaged: contact is rough, and on each grid the descent rests in a dent of its own."""
REACH, SMALL_REACH = 0.3, 0.03
"""Of differences on the way, across the roughness of contact, and in the end; in standard deviations before."""
_PROBE_SDS = 0.1
_JUMPED = 0.02
FEWEST_CLUSTERS = 6


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
        whiskers: those that were felt; the gains of others are as before.
        traces: that were fitted.
        predicted: of each trace, (samples,), N mm.
        scatter_n_mm: of a sample.
        settled: whether the fit has come to rest.
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

    __repr__ = one_line

    @property
    def sd(self) -> NDArray[np.float64]:
        """(n,) standard deviations of the numbers."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def misfit(self) -> float:
        """What is left over, rms in parts of the uncertainty of a sample: 1 where the model explains all.

        The worst `_JUMPED` are left out: where a tip slips or jams otherwise than predicted they say no more than that.
        """
        left = np.concatenate(
            [
                (t.felt_n_mm - p) / sample_sigma_n_mm(t, self.scatter_n_mm)
                for t, p in zip(self.traces, self.predicted, strict=True)
            ]
        )
        squares = np.sort(left[np.isfinite(left)] ** 2)
        return float(np.sqrt(np.mean(squares[: int((1.0 - _JUMPED) * squares.size)])))

    def of(self, name: Unknown) -> tuple[float, float]:
        """A number and its standard deviation."""
        return self.bench[name], float(self.sd[list(Unknown).index(name)])

    def sd_of(self, function: Callable[[Bench], float]) -> float:
        """Standard deviation of whatever depends on the numbers, to first order."""
        at, gradient = self.bench.vector(), np.empty(self.before.size)
        for i, sd in enumerate(self.sd):
            step = np.zeros(at.size)
            step[i] = _PROBE_SDS * sd
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
        grid_mm: of the maps.

    Raises:
        IdentifyError: too few passes over the piece, or a signal that no such bench gives.
        MapError: no line that can be used.
        WhiskerError: a whisker that is no L.
    """
    if isinstance(whisker, Touch):
        only = tuple(name for name in only if name not in DRAWN)
    known = scan.calibration is not None and not scan.calibration.from_land
    nominal = nominal_bench(whisker, scan.touch, n_whiskers=scan.n_whiskers)
    scan = steadied(scan) if known else replace(scan, calibration=None)
    largest_n_mm = LARGEST_LANDS * abs(scan.touch.land_moment_n_mm())
    traces = traces_of(scan, about=nominal, largest_n_mm=largest_n_mm)
    clusters = {trace.cluster for trace in traces}
    if len(clusters) < FEWEST_CLUSTERS:
        raise IdentifyError(
            f"only {len(clusters)} of the passes can be used over the piece",
            hint=f"record {FEWEST_CLUSTERS} or more",
        )
    before = known_before(nominal, gain_sd=BENCH_GAIN if known else LOOSE_GAIN)
    felt_by = tuple(sorted({trace.whisker for trace in traces}))
    free = np.zeros(before.size, dtype=np.bool_)
    free[: len(Unknown)] = [name in only for name in Unknown]
    for whisker_number in felt_by:
        free[of_whisker(whisker_number, n_whiskers=scan.n_whiskers)] = True
    for along_x in {trace.plan.direction.along_x for trace in traces}:
        free[of_screw(before.size, along_x=along_x)] = True
    scatter = _scatter_n_mm(traces)

    def lines_of(about: Bench, most: int) -> tuple[Trace, ...]:
        return traces_of(scan, about=about, largest_n_mm=largest_n_mm, most=most)

    def laid(about: Bench, coarser: float, lines: tuple[Trace, ...]) -> Forward:
        forward = Forward(
            heights,
            lines,
            nominal=whisker,
            about=about,
            setup_friction=scan.touch.friction,
            largest_n_mm=largest_n_mm,
            grid_mm=coarser * grid_mm,
        )
        forward.spare_jams(about)
        return forward

    found, settled = nominal, False
    for blur_mm, coarser, most, loss, names in STAGES:
        stage = free.copy()
        stage[: len(Unknown)] &= [name in names for name in Unknown]
        if blur_mm:
            # memory and screws would be made of walls that are not yet in their place
            stage[len(Unknown) + scan.n_whiskers :] = False
        forward = laid(found, coarser, lines_of(found, most))
        sigma = [
            np.full(t.felt_n_mm.size, scatter) if blur_mm else sample_sigma_n_mm(t, scatter)
            for t in forward.traces
        ]
        found, settled = descended(
            forward,
            found,
            nominal,
            before,
            stage,
            sigma,
            scatter_n_mm=scatter,
            loss=loss,
            reach=REACH,
            blur_mm=blur_mm,
        )
    rested = []
    for coarser, most in LAST:
        forward = laid(found, coarser, lines_of(found, most))
        by_grid = [
            p - wide
            for p, wide in zip(
                forward.moments(found),
                laid(found, COARSER * coarser, forward.traces).moments(found),
                strict=True,
            )
        ]
        sigma = [
            np.hypot(sample_sigma_n_mm(t, scatter), off)
            for t, off in zip(forward.traces, by_grid, strict=True)
        ]
        found, settled = descended(
            forward,
            found,
            nominal,
            before,
            free,
            sigma,
            scatter_n_mm=scatter,
            loss=Loss.BOUNDED,
            reach=SMALL_REACH,
        )
        rested.append(found.vector())
    found = Bench.of_vector(np.mean(rested[-AVERAGED:], axis=0))
    dents = np.cov(rested[-AVERAGED:], rowvar=False) / AVERAGED
    traces = forward.traces
    predicted = forward.moments(found)

    def seen(values: Iterable[NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
        return tuple(innovations(v, s, scatter=scatter) for v, s in zip(values, sigma, strict=True))

    missed = seen(residuals(traces, predicted))
    jacobian = jacobian_of(forward, found, before, free, predicted, sigma, reach=SMALL_REACH)
    fitted = Fitted(
        traces=traces,
        jacobian=seen(jacobian),
        missed=missed,
        weight=tuple(Loss.BOUNDED.weight(r) for r in missed),
        by_grid=seen(by_grid),
        before=before,
        free=free,
    )
    repeated = fitted.scattered() + dents
    return Identified(
        found,
        nominal,
        before,
        repeated + fitted.of_grid(),
        repeated,
        felt_by,
        traces,
        tuple(predicted),
        scatter,
        settled,
        whisker if isinstance(whisker, LShaped) else None,
    )


def _scatter_n_mm(traces: tuple[Trace, ...]) -> float:
    """Scatter of a sample, by the differences of neighbours: robust, for at edges they are no scatter."""
    steps = np.concatenate([np.diff(trace.felt_n_mm) for trace in traces])
    steps = steps[np.isfinite(steps)]
    if steps.size < 100:
        raise IdentifyError("hardly a sample of the recording can be used", hint="see inspect")
    spread = float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))
    level = float(np.nanmedian(np.abs(np.concatenate([t.felt_n_mm for t in traces]))))
    return max(spread, 1e-5 * level)
