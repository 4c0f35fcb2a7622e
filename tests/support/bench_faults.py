"""Recordings of a bench on which something is wrong, made from sound ones: what each fault does to the true moment.

A change of height by s, d0 the preload, adds s / d0 of the land's moment, as eq. (7) has it on land and floors. A worn
tip is felt anew: a ball of a larger radius, on an arm that is shorter by what was worn off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from whisker_array.estimation.faults import FaultKind
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor import draw_sensor_chain, measure
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.touch import Touch

Floats = NDArray[np.float64]
AIR = 16
RANGE_LAND_MOMENTS = 3.0


def worn(touch: Touch, *, radius_mm: float, shorter_mm: float) -> Touch:
    """A whisker whose tip is worn: rounder, and by so much shorter that it presses less."""
    return replace(touch, tip_radius_mm=radius_mm, preload_mm=touch.preload_mm - shorter_mm)


def with_whisker_of(scan: Scan, other: Scan, whisker: int) -> Scan:
    """The scan, one of its whiskers from another scan of the same plan."""
    sweeps = []
    for own, new in zip(scan.sweeps, other.sweeps, strict=True):
        moment, flags = own.moment_n_mm.copy(), own.flags.copy()
        moment[:, whisker], flags[:, whisker] = new.moment_n_mm[:, whisker], new.flags[:, whisker]
        sweeps.append(replace(own, moment_n_mm=moment, flags=flags))
    return replace(scan, sweeps=tuple(sweeps))


def recorded(
    ideal: Scan,
    *,
    rng: np.random.Generator,
    fault: FaultKind | None = None,
    whisker: int = 2,
    size: float = 1.0,
) -> Scan:
    """What sensors as from the bench make of an ideal scan, with a fault of a usual size or of that times `size`."""
    land = ideal.touch.land_moment_n_mm()
    chain = draw_sensor_chain(ideal.n_whiskers, rng=rng, full_scale_n_mm=RANGE_LAND_MOMENTS * abs(land))
    sweeps, at_s = [], 0.0
    for sweep in ideal.sweeps:
        behind = _time_s(sweep, ideal.sample_rate_hz, at_s, rng)
        at_s = float(behind[-1, -1])
        moment = np.concatenate(
            [np.zeros((*sweep.moment_n_mm.shape[:2], AIR)), np.nan_to_num(sweep.moment_n_mm)], axis=2
        )
        touching = np.arange(moment.shape[2]) >= AIR
        on = Recorded(sweep, behind, land, whisker, size, rng)
        if fault in _BEFORE:
            moment = _BEFORE[fault](moment, on) * touching
            # less than none is lost contact
            moment = np.where(moment * land > 0.0, moment, 0.0)
        raw, clipped = measure(moment, chain=chain, sample_rate_hz=ideal.sample_rate_hz, rng=rng)
        if fault in _AFTER:
            raw = _AFTER[fault](raw.astype(np.float64), on).astype(np.float32)
        flags = sweep.flags | np.where(clipped[..., AIR:], np.uint8(SampleFlag.OUT_OF_RANGE), np.uint8(0))
        sweeps.append(replace(sweep, moment_n_mm=raw[..., AIR:], air_n_mm=raw[..., :AIR], flags=flags))
    return replace(ideal, sweeps=tuple(sweeps))


def _time_s(sweep: Sweep, rate_hz: float, start_s: float, rng: np.random.Generator) -> Floats:
    """(passes, air and touching samples): a pass takes its samples, and a turnaround of a quarter second or so."""
    passes, n = sweep.moment_n_mm.shape[0], sweep.plan.n_samples + AIR
    begin = start_s + np.cumsum(n / rate_hz + rng.uniform(0.2, 0.3, passes))
    return begin[:, None] + np.arange(n) / rate_hz


@dataclass(frozen=True)
class Recorded:
    """A sweep as it is recorded.

    Attributes:
        sweep: without the fault.
        time_s: (passes, samples) of its samples, air before those that touch.
        land: moment of the land, N mm.
        whisker: that a fault of one whisker is of.
        size: of the fault, over the usual one.
        rng: of what is drawn.
    """

    sweep: Sweep
    time_s: Floats
    land: float
    whisker: int
    size: float
    rng: np.random.Generator

    @property
    def along_x(self) -> Floats:
        """(passes, whiskers, samples) places along x, from -1 to 1 over what was felt; air stands at the start."""
        direction, line = self.sweep.plan.direction, self.sweep.plan.line_mm
        along = np.r_[np.full(AIR, -1.0), np.linspace(-1.0, 1.0, self.sweep.plan.n_samples)]
        shape = (*line.shape, along.size)
        if direction.along_x:
            return np.broadcast_to(-along if direction.backward else along, shape)
        felt = (self.sweep.flags == 0).mean(axis=2) > 0.5
        low, high = line[felt].min(), line[felt].max()
        return np.broadcast_to((2.0 * (line - low) / (high - low) - 1.0)[..., None], shape)


Change = Callable[[Floats, Recorded], Floats]


def _of_one(change: Change) -> Change:
    def changed(m: Floats, on: Recorded) -> Floats:
        m = m.copy()
        m[:, on.whisker] = change(m[:, on.whisker], on)
        return m

    return changed


def _spiked(m: Floats, on: Recorded) -> Floats:
    """On a whisker at a time, one sample in a thousand, of either sign."""
    hit = on.rng.random(m.shape) < 1e-3
    sign, size = on.rng.choice([-1.0, 1.0], m.shape), on.rng.uniform(0.2, 0.8, m.shape)
    return m + hit * sign * size * on.size * abs(on.land)


def _exchanged(m: Floats, on: Recorded) -> Floats:
    order = list(range(m.shape[1]))
    order[on.whisker], order[on.whisker - 1] = order[on.whisker - 1], order[on.whisker]
    return m[:, order]


def _doubled(m: Floats, on: Recorded) -> Floats:
    order = list(range(m.shape[1]))
    order[on.whisker] = on.whisker - 1
    return m[:, order]


def _shifted(m: Floats, on: Recorded) -> Floats:
    """Three samples late, in the order of time."""
    passes, whiskers, samples = m.shape
    in_time = np.roll(m.swapaxes(0, 1).reshape(whiskers, -1), 3, axis=1)
    return in_time.reshape(whiskers, passes, samples).swapaxes(0, 1)


def _coarse(m: Floats, on: Recorded) -> Floats:
    step = 0.08 * on.size * abs(on.land)
    rounded: Floats = step * np.rint(m / step)
    return rounded


def _as_in_air(m: Floats) -> Floats:
    """Samples of the lifted array, as many as those that touch."""
    again: Floats = np.tile(m[..., :AIR], (1, 1, -(-m.shape[2] // AIR)))
    return again[..., : m.shape[2] - AIR]


_BEFORE: dict[FaultKind | None, Change] = {
    FaultKind.DEAD: _of_one(lambda m, on: 0.0 * m),
    FaultKind.BENT: _of_one(lambda m, on: m - 0.3 * on.size * on.land),
    FaultKind.LOOSE: _of_one(
        lambda m, on: m + 0.1 * on.size * on.land * on.rng.standard_normal((m.shape[0], 1))
    ),
    FaultKind.HEIGHT: lambda m, on: m - 0.5 * on.size * on.land,
    FaultKind.TILTED: lambda m, on: m + 0.3 * on.size * on.land * on.along_x,
    FaultKind.BOWED: lambda m, on: m + 0.3 * on.size * on.land * (0.5 - on.along_x**2),
    FaultKind.VIBRATION: lambda m, on: (
        m * (1.0 + 0.03 * on.size * np.sin(2.0 * np.pi * 50.0 * on.time_s))[:, None]
    ),
}
_AFTER: dict[FaultKind | None, Change] = {
    FaultKind.NOISY: _of_one(
        lambda m, on: m + 0.05 * on.size * abs(on.land) * on.rng.standard_normal(m.shape)
    ),
    FaultKind.SPIKES: _spiked,
    FaultKind.NO_SIGNAL: lambda m, on: np.concatenate([m[..., :AIR], _as_in_air(m)], axis=2),
    FaultKind.REVERSED: _of_one(lambda m, on: -m),
    FaultKind.LIFTED: lambda m, on: np.concatenate([m[..., 2 * AIR : 3 * AIR], _as_in_air(m)], axis=2),
    FaultKind.UNIT: lambda m, on: 1000.0 * on.size * m,
    FaultKind.EXCHANGED: _exchanged,
    FaultKind.DOUBLED: _doubled,
    FaultKind.SHIFTED: _shifted,
    FaultKind.COARSE: _coarse,
    # the range ends above the land: steep walls are cut off
    FaultKind.SATURATED: lambda m, on: np.clip(m, -1.06 * abs(on.land), 1.06 * abs(on.land)),
}
