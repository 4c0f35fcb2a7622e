r"""Measures of signals: tips beyond the part, polarity, channels in another order, channels recorded twice.

    place |  whisker 1, last line   ~~~\_/~~\_/~~     neighbouring lines of two whiskers cross the same marks,
      |   |  whisker 2, first line  ~~~\_/~~\_/~~     but not if their channels are exchanged
      v   |  ...
          |  whisker 3              _______________   beyond the part: no moment from here to the last line

All values are shares of the land's moment, as in `fault_measures`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whisker_array.arrays import AnyFloats, Mask, quantile_of_known
from whisker_array.estimation.fault_measures import (
    MAD,
    SweepShares,
    at_ends,
    by_whisker,
    noises,
    sweep_shares,
)
from whisker_array.scan.scan import Scan, add_flags, only
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag

LOST_LEVEL, FEW_LOST = 0.2, 0.01
"""Moment, over that on the land, below which contact is lost; greatest share of such samples of a clear tip."""
EVEN_SPREAD = 0.1
"""Greatest spread of the levels of a clear tip's lines, over the whisker's own level."""


def _noise(shares: Sequence[SweepShares]) -> AnyFloats:
    air = noises([f.air for f in shares])
    known = np.isfinite(air)
    return air if known.all() else np.where(known, air, noises([f.share for f in shares]))


def _levels_of_lines(shares: Sequence[SweepShares]) -> tuple[AnyFloats, float]:
    lines = np.concatenate([f.levels for f in shares])
    moment = np.fmax.reduce(np.abs(lines), axis=0)
    usual = moment[moment > 20.0 * _noise(shares)]
    return lines, float(np.median(usual)) if usual.size else 0.0


def beyond_part(shares: Sequence[SweepShares], *, least: float) -> list[Mask]:
    """Samples (passes, whiskers, samples) of each sweep whose tips run beyond the part: to the end of a line, or whole
    lines up to the last one of the field. A single whisker that touches nowhere is dead rather than beyond the part."""
    least *= _levels_of_lines(shares)[1]
    silent = [~(np.abs(f.share) >= least) for f in shares]
    alive = ~np.logical_and.reduce([s.all(axis=(0, 2)) for s in silent])
    masks = []
    for f, quiet in zip(shares, silent, strict=True):
        whole = quiet.all(axis=2)
        order, _, _ = f.plan.lines_in_order()
        outer = np.zeros(whole.size, dtype=np.bool_)
        for lines in (order, order[::-1]):
            run = lines[np.logical_and.accumulate(whole.ravel()[lines])]
            whiskers = np.unique(run % whole.shape[1])
            if alive[whiskers].any() or (whiskers.size > 1 and alive.any()):
                outer[run] = True
        masks.append(at_ends(quiet) & (outer.reshape(whole.shape) | ~whole)[..., None])
    return masks


def knows_part(scan: Scan) -> bool:
    """Whether the recording says where tips run beyond the part."""
    return any(bool((s.flags & np.uint8(SampleFlag.OUTSIDE)).any()) for s in scan.sweeps)


def flagged_beyond_part(scan: Scan, shares: Sequence[SweepShares]) -> list[Mask]:
    """Samples (passes, whiskers, samples) of each sweep that the recording flags as beyond the part."""
    bit, dragged = np.uint8(SampleFlag.OUTSIDE), (s for s in scan.sweeps if not s.plan.pushed)
    return [(sweep.flags[f.across] & bit) != 0 for sweep, f in zip(dragged, shares, strict=True)]


def flag_beyond_part(scan: Scan, *, least: float = 0.2) -> Scan:
    """Flag samples whose tips run beyond the part, unless the recording has such flags or there are none."""
    if all(s.plan.pushed for s in scan.sweeps) or knows_part(scan):
        return scan
    shares = sweep_shares(only(scan))
    pairs = zip(shares, beyond_part(shares, least=least), strict=True)
    beyond = {f.plan.direction: f.in_time(mask & np.isfinite(f.share)) for f, mask in pairs}
    return add_flags(scan, SampleFlag.OUTSIDE, beyond)


def without(shares: Sequence[SweepShares], masks: Sequence[Mask]) -> list[SweepShares]:
    """The shares, NaN at some samples."""
    return [
        replace(f, share=np.where(mask, np.nan, f.share)) if mask.any() else f
        for f, mask in zip(shares, masks, strict=True)
    ]


def above_noise(shares: Sequence[SweepShares], level: AnyFloats, *, times: float = 5.0) -> Mask:
    """(whiskers,) whether a signal changes by more than its noise when the array is lowered."""
    return np.abs(level) > times * _noise(shares)


def is_clear(shares: Sequence[SweepShares], level: AnyFloats, *, least: float) -> Mask:
    """(whiskers,) whether a signal is that of a tip on the land, however small: even, and nowhere lost."""
    size = np.abs(level)
    clear = size > least * _noise(shares)
    for w in np.flatnonzero(clear):
        values = np.concatenate([f.share[:, w].ravel() for f in shares]) / level[w]
        lines = np.concatenate([f.levels[:, w] for f in shares]) / level[w]
        spread = MAD * float(np.nanmedian(np.abs(lines - 1.0)))
        clear[w] = (values[np.isfinite(values)] < LOST_LEVEL).mean() < FEW_LOST and spread < EVEN_SPREAD
    return clear


def varies_more_in_air(shares: Sequence[SweepShares], *, times: float = 3.0) -> bool:
    """Whether samples of the lifted array vary more than those on the part: the two are exchanged."""
    air = np.concatenate([f.air.ravel() for f in shares])
    on_part = np.concatenate([(f.share - f.levels[..., None]).ravel() for f in shares])
    spread = [float(quantile_of_known(np.abs(values), 0.9)) for values in (air, on_part)]
    return spread[0] > times * spread[1]


def samples_late(scan: Scan, *, least: float = 0.5, flat: float = 0.5, passes: int = 15) -> int:
    """By how many samples the signals come later than the stage's phase, negative if they come earlier.

    The median over `passes` of each sweep steps where the array is lowered. The shift is sought at which lifted and
    touching samples differ most; it must explain at least the share `least` of a lifted sample. 0 with staggered rows,
    whose samples are in the order of places.
    """
    scan = only(scan)
    sweeps = [s for s in scan.sweeps if s.air_n_mm.shape[2] and not s.plan.offset_mm]
    if not sweeps:
        return 0
    farthest = min(s.plan.n_samples for s in sweeps) // 4
    shifts = np.arange(-farthest, farthest + 1)
    contrast, gain, range_in_air = np.zeros((3, shifts.size))
    for sweep in sweeps:
        n_air, n = sweep.air_n_mm.shape[2], sweep.plan.n_samples
        some = slice(None, None, max(1, len(sweep.air_n_mm) // passes))
        signal = np.concatenate([sweep.air_n_mm[some], sweep.moment_n_mm[some]], axis=2)
        profile = np.median(signal, axis=0).astype(np.float64)
        index = (shifts[:, None] + np.arange(n_air)) % (n_air + n)
        lifted = profile[:, index]
        air = lifted.mean(axis=2)
        step = np.abs((profile.sum(axis=1)[:, None] - n_air * air) / n - air).sum(axis=0)
        contrast += step
        gain += n_air * (step - step[farthest])
        range_in_air += np.ptp(lifted, axis=2).sum(axis=0)
    best = int(np.argmax(contrast))
    clear = gain[best] > least * contrast[best] and range_in_air[best] < flat * contrast[best]
    return int(shifts[best]) if clear else 0


def in_step(scan: Scan, late: int) -> Scan:
    """The scan with its signals `late` samples earlier, as they belong to the stage; what is missing is flagged."""
    return replace(scan, sweeps=tuple(_in_step(s, late) for s in scan.sweeps))


def _in_step(sweep: Sweep, late: int) -> Sweep:
    n_air, of_place = sweep.air_n_mm.shape[2], np.uint8(SampleFlag.OUTSIDE)
    no_flags = np.zeros(sweep.air_n_mm.shape, dtype=np.uint8)
    signal = np.roll(np.concatenate([sweep.air_n_mm, sweep.moment_n_mm], axis=2), -late, axis=2)
    flags = np.roll(np.concatenate([no_flags, sweep.flags & ~of_place], axis=2), -late, axis=2)[..., n_air:]
    if late > 0:
        flags[..., -late:] = SampleFlag.FAULTY
    return replace(
        sweep,
        moment_n_mm=signal[..., n_air:],
        air_n_mm=signal[..., :n_air],
        flags=flags | (sweep.flags & of_place),
    )


def without_value(scan: Scan) -> Mask:
    """(whiskers,) whether a channel has no value at all: every sample of it is missing."""
    missing = np.ones(scan.n_whiskers, dtype=np.bool_)
    for s in scan.sweeps:
        unusable = (s.flags & np.uint8(SampleFlag.OUT_OF_RANGE | SampleFlag.OUTSIDE)) != 0
        still = np.ptp(s.moment_n_mm, axis=2) == 0.0
        still &= np.ptp(s.air_n_mm, axis=2) == 0.0 if s.air_n_mm.shape[2] else True
        missing &= (unusable.all(axis=2) & still).all(axis=0)
    lost = [(s.flags & np.uint8(SampleFlag.OUT_OF_RANGE)).any(axis=(0, 2)) for s in scan.sweeps]
    return np.asarray(missing & np.logical_or.reduce(lost))


def converter_steps(scan: Scan, *, fewest: int = 3, most: int = 100, thin: int = 7) -> AnyFloats:
    """(whiskers,) step of the converter, share of the land's moment; 0 where a signal takes many values."""
    steps = np.zeros(scan.n_whiskers)
    for w in range(scan.n_whiskers):
        touching = [s.moment_n_mm[:, w, ::thin][s.flags[:, w, ::thin] == 0] for s in scan.sweeps]
        lifted = [s.air_n_mm[:, w].ravel() for s in scan.sweeps]
        if np.unique(lifted[0]).size > most:
            continue
        gaps = np.diff(np.unique(np.concatenate([*touching, *lifted])).astype(np.float64))
        if fewest <= gaps.size + 1 <= most:
            multiples = gaps / gaps.min()
            if np.abs(multiples - np.rint(multiples)).max() < 0.05:
                steps[w] = gaps.min() / abs(scan.touch.land_moment_n_mm())
    return steps


class ChannelOrder(NamedTuple):
    """Order of the channels in which neighbouring lines fit best, each whisker's own `backward` or not."""

    channel: tuple[int, ...]
    backward: tuple[bool, bool] = (False, False)
    misfit: float = 0.0
    misfit_now: float = 0.0

    @property
    def moved(self) -> list[int]:
        return [whisker for whisker, channel in enumerate(self.channel) if channel != whisker]

    def describe(self, columns: Sequence[int]) -> str:
        axes = " and ".join(axis for axis, backward in zip("xy", self.backward, strict=True) if backward)
        across = f"with positions across the passes along {axes} in reverse order" if axes else ""
        if all(self.backward) and not self.moved:
            across += ", or all channels"
        channels = [columns[channel] for channel in self.channel]
        if not self.moved:
            order = ""
        elif len(self.moved) == 2:
            order = f"with channels {columns[self.moved[0]]} and {columns[self.moved[1]]} exchanged"
        else:
            order = f"with channels in the order {', '.join(map(str, channels))}"
        return " and ".join(filter(None, (order, across)))


class _Borders(NamedTuple):
    along_x: Mask
    whisker: NDArray[np.intp]
    beside: NDArray[np.intp]
    difference: AnyFloats
    difference_backward: AnyFloats

    @property
    def now(self) -> AnyFloats:
        return self.difference[np.arange(self.whisker.size), self.whisker, self.beside]

    @property
    def most_gain(self) -> float:
        least = np.fmin.reduce(np.minimum(self.difference, self.difference_backward), axis=(1, 2))
        return float(np.nansum(np.maximum(self.now - least, 0.0)))


def best_order(
    shares: Sequence[SweepShares],
    beyond: Sequence[Mask],
    wrong: Mask,
    *,
    least: float,
    line_pitch_mm: float,
    least_gain: float = 0.0,
    cut: float = 0.2,
    simpler: float = 0.8,
    single_border: float = 10.0,
) -> ChannelOrder:
    """The order of the channels in which lines on both sides of the whiskers' borders differ least.

    Exchanges of two channels are tried until none reduces the difference, from the present and from the reverse order,
    with the lines of each whisker forward and backward. The borders of channels that never touch are no reason for an
    exchange. Beside whiskers that cannot be compared, a single border must gain `single_border` times as much.
    """
    lines, usual = _levels_of_lines(shares)
    level = quantile_of_known(np.where(np.abs(lines) > least * usual, lines, np.nan).T)
    quiet = np.isnan(level) & np.isfinite(lines).any(axis=0) & ~wrong
    level[wrong] = np.nan
    unknown = np.isnan(level) & ~quiet
    at_unknown = np.convolve(unknown, [1, 1, 1])[1:-1] > 0
    of_sweeps = (
        _borders(f, np.where(quiet[:, None], True, mask), level, line_pitch_mm=line_pitch_mm, cut=cut)
        for f, mask in zip(shares, beyond, strict=True)
    )
    borders = _Borders(*map(np.concatenate, zip(*of_sweeps, strict=True)))
    present = np.arange(level.size)
    if borders.most_gain <= least_gain:
        return ChannelOrder(tuple(present.tolist()))
    movable = np.flatnonzero(quiet | np.isfinite(level))
    turned = present.copy()
    turned[movable] = movable[::-1]
    pairs = np.array(list(combinations(movable, 2)), dtype=np.intp).reshape(-1, 2)
    axes = set(borders.along_x.tolist())
    backward = [
        (x, y) for x in (False, True) for y in (False, True) if x <= (True in axes) and y <= (False in axes)
    ]
    candidates = [ChannelOrder(tuple(present.tolist()))]
    for start, ways in product((present, turned), backward):
        orders, change = start[None], np.inf
        while len(orders):
            misfit, misfit_now, n_better = _misfits(borders, orders, ways, quiet)
            k = int(np.argmin(misfit - misfit_now))
            if misfit[k] - misfit_now[k] > change - 1e-4:
                break
            change = misfit[k] - misfit_now[k]
            order = tuple(orders[k].tolist())
            single = n_better[k] <= 1 and at_unknown[(orders[k] != present) | any(ways)].any()
            if not single or misfit_now[k] - misfit[k] > single_border * least_gain:
                candidates.append(ChannelOrder(order, ways, float(misfit[k]), float(misfit_now[k])))
            orders = np.tile(orders[k], (len(pairs), 1))
            each = np.arange(len(pairs))[:, None]
            orders[each, pairs] = orders[each, pairs[:, ::-1]]
    most = min(c.misfit - c.misfit_now for c in candidates)
    simple = (c for c in candidates if c.misfit - c.misfit_now <= simpler * most)
    return min(simple, key=lambda c: len(c.moved) + 2 * sum(c.backward))


def _borders(f: SweepShares, beyond: Mask, level: AnyFloats, *, line_pitch_mm: float, cut: float) -> _Borders:
    order, whisker, place = f.plan.lines_in_order()
    row = order // level.size
    near = np.diff(place) < 2.0 * line_pitch_mm
    neighbours = np.flatnonzero(near & (whisker[1:] != whisker[:-1]))
    height = np.where(beyond, -cut, np.clip(f.share / level[:, None] - 1.0, -cut, cut))
    height[~np.isfinite(f.share)] = np.nan
    # lines of two passes each
    first, second = row[neighbours], row[neighbours + 1]
    passes, pair = np.unique(np.column_stack([first, second]), axis=0, return_inverse=True)
    forward, backward = (
        np.array([_mean_squares(lines[a], lines[b]) for a, b in passes]).reshape(-1, level.size, level.size)
        for lines in (height, height[::-1])
    )
    along_x = np.full(neighbours.size, f.plan.direction.along_x)
    return _Borders(
        along_x, whisker[neighbours], whisker[neighbours + 1], forward[pair.ravel()], backward[pair.ravel()]
    )


def _mean_squares(lines: AnyFloats, others: AnyFloats, *, fewest: int = 20) -> AnyFloats:
    known, known_others = (np.isfinite(values).astype(np.float64) for values in (lines, others))
    lines, others = (np.nan_to_num(values) for values in (lines, others))
    both = known @ known_others.T
    squares = lines**2 @ known_others.T + known @ (others**2).T - 2.0 * lines @ others.T
    return np.where(both >= fewest, np.maximum(squares, 0.0) / np.maximum(both, 1.0), np.nan)


def _misfits(
    borders: _Borders, orders: NDArray[np.intp], backward: tuple[bool, bool], quiet: Mask
) -> tuple[AnyFloats, AnyFloats, NDArray[np.intp]]:
    each, now = np.arange(borders.whisker.size), borders.now
    turned = np.where(borders.along_x, *backward)
    whisker, beside = orders[:, borders.whisker], orders[:, borders.beside]
    then = np.where(
        turned,
        borders.difference_backward[each, whisker, beside],
        borders.difference[each, whisker, beside],
    )
    moved = (whisker != borders.whisker) | (beside != borders.beside) | turned
    moved &= np.isfinite(now) & np.isfinite(then)
    loud = ~(quiet[borders.whisker] | quiet[borders.beside])
    misfit, misfit_now = np.where(moved, then, 0.0).sum(axis=1), np.where(moved & loud, now, 0.0).sum(axis=1)
    less = np.where(moved & loud, now - then, 0.0)
    least = 0.05 * (misfit_now - misfit)
    first = np.minimum(borders.whisker, borders.beside)
    n_better = np.sum([less[:, first == w].sum(axis=1) > least for w in range(quiet.size)], axis=0)
    return misfit, misfit_now, n_better


def doubled_channels(
    shares: Sequence[SweepShares], *, alike: float = 0.999, fewest: int = 64
) -> list[tuple[int, int]]:
    """Channels, each with another that has the same noise while the array is lifted: one signal, recorded twice."""
    changes = np.array(by_whisker([np.diff(f.air, n=4) for f in shares]))
    if changes.shape[1] < fewest:
        return []
    changes[:, np.isnan(changes).any(axis=0)] = 0.0
    changes -= changes.mean(axis=1, keepdims=True)
    size = np.sqrt((changes**2).sum(axis=1))
    noise = np.divide(changes, size[:, None], out=np.zeros_like(changes), where=size[:, None] > 0.0)
    return [(int(a), int(b)) for a, b in np.argwhere(noise @ noise.T > alike) if a != b]
