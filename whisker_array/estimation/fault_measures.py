"""Measures of each whisker and of the bench: levels, noise, steps, sharpness, form, lines of a spectrum.

    moment |      air | lead-in |   marks    | lead-out       level     land moment over the modelled moment
           |          |_____ ___|__   __   __|_______         noise     random changes from sample to sample
           |__________|     '      \\_/  \\_/                  wander    steps of the lead-in from pass to pass
           +---------------------------------------> t        gain, edges of a whisker over those of its neighbour

All measures but lengths are shares of the land's moment. Marks hardly change from one pass to its neighbour; larger
changes come from the bench.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from whisker_array.arrays import AnyFloats, Mask, quantile_of_known
from whisker_array.estimation.edges import usable_moments
from whisker_array.estimation.estimate import is_profiler
from whisker_array.estimation.land import reconcile_steps, whisker_gain
from whisker_array.scan.scan import Scan
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.passes import SweepPlan

MAD = 1.4826
"""Factor from a median absolute deviation to a standard deviation."""
BESIDE = 2
"""Lines compared on either side of a border between two whiskers."""
MARKED_STEPS, MARKED_DEPTH = 0.3, 0.02
"""Least root of the summed squares of a line's steps, and least depth, of lines that cross marks; land: 1."""


@dataclass(frozen=True, eq=False, repr=False)
class SweepShares(OneLine):
    """The dragged passes (passes, whiskers, samples) of one direction as shares of the land's moment, or NaN."""

    plan: SweepPlan
    share: AnyFloats
    air: AnyFloats
    across: NDArray[np.intp]

    @cached_property
    def lines(self) -> tuple[AnyFloats, NDArray[np.intp], AnyFloats]:
        """Usable lines without lead-in and lead-out, in order across the plate; whisker and position of each."""
        samples, lead = self.share.shape[2], self.plan.n_lead
        order, whisker, place = self.plan.lines_in_order()
        traced = self.share.reshape(-1, samples)[order, lead : samples - lead]
        usable = np.isfinite(traced).mean(axis=1) > 0.5
        return traced[usable], whisker[usable], place[usable]

    @cached_property
    def levels(self) -> AnyFloats:
        """(passes, whiskers) median of each line; NaN if unknown."""
        return quantile_of_known(self.share)

    def only(self, good: Mask) -> SweepShares:
        if good.all():
            return self
        share, air = (np.where(good[:, None], values, np.nan) for values in (self.share, self.air))
        return replace(self, share=share, air=air)

    def in_time(self, mask: Mask) -> Mask:
        return mask[np.argsort(self.across)]


def sweep_shares(scan: Scan, *, outside: bool = False) -> list[SweepShares]:
    """The dragged sweeps of a scan of one kind of whisker, without saturated samples."""
    land, of_sweeps = scan.touch.land_moment_n_mm(), []
    for sweep in (s for s in scan.sweeps if not s.plan.pushed):
        across = np.argsort(sweep.plan.line_mm[:, 0], kind="stable")
        if outside:
            sweep = replace(sweep, flags=sweep.flags & np.uint8(~SampleFlag.OUTSIDE & 0xFF))
        share = usable_moments(scan, sweep)[across]
        share[(sweep.flags[across] & np.uint8(SampleFlag.SATURATED)) != 0] = np.nan
        share /= land
        air = sweep.air_n_mm[across].astype(np.float64) / land
        if scan.calibration is not None:
            air /= scan.calibration.gain[:, None]
        air = (air - quantile_of_known(air)[..., None]).astype(np.float32)
        plan = replace(sweep.plan, line_mm=sweep.plan.line_mm[across])
        shares = SweepShares(plan, share.astype(np.float32), air, across)
        level = np.nan_to_num(quantile_of_known(shares.levels.T))
        # the stage's phase changes a sample or more beside the signal: its step is common to all whiskers and no noise;
        # most recordings are in step, and only in others are all lifted samples compared
        if air.shape[2] and _touches(air[..., [0, -1]], level).any():
            moved = at_ends(_touches(air, level))[:, None]
            shares = replace(shares, air=np.where(moved, np.float32(np.nan), air))
        of_sweeps.append(shares)
    return of_sweeps


def at_ends(mask: Mask) -> Mask:
    """Where a mask holds up to either end of its last axis."""
    places, whole = np.arange(mask.shape[-1]), mask.all(axis=-1, keepdims=True)
    first, last = (np.argmin(way, axis=-1)[..., None] for way in (mask, mask[..., ::-1]))
    return np.asarray((places < first) | (places >= places.size - last) | whole)


def _touches(air: AnyFloats, level: AnyFloats, *, least: float = 0.2) -> Mask:
    """(passes, samples) lifted samples at which the whiskers touch; level (whiskers,)."""
    reached = np.einsum("pws,w->ps", np.nan_to_num(air), level)
    return np.asarray(reached > least * max(float(level @ level), 1e-30))


def saturated(
    scan: Scan, *, run: int = 4, least_share: float = 2e-3, least_span: float = 0.05, still: float = 0.1
) -> list[Mask]:
    """Masks (passes, whiskers, samples) of clipped samples in each sweep: runs at an end of a whisker's range.

    A signal must span `least_span` of the land's moment, as a bare plate is level. One whose other samples are in runs,
    by the share `still`, has no noise: the floors of marks stand still, too.
    """
    bad, shape = [s.flags != 0 for s in scan.sweeps], (1, scan.n_whiskers, 1)
    values = [np.where(b, np.nan, s.moment_n_mm) for b, s in zip(bad, scan.sweeps, strict=True)]
    low = np.fmin.reduce([np.fmin.reduce(v, axis=(0, 2)) for v in values]).reshape(shape)
    high = np.fmax.reduce([np.fmax.reduce(v, axis=(0, 2)) for v in values]).reshape(shape)
    runs = [_in_runs(v, run) for v in values]
    ends = [(v == low) | (v == high) for v in values]
    clipped = [r & e for r, e in zip(runs, ends, strict=True)]

    def count(masks: list[Mask]) -> AnyFloats:
        return np.asarray(np.sum([m.sum(axis=(0, 2)) for m in masks], axis=0), dtype=np.float64)

    total, at_end = np.maximum(count([~b for b in bad]), 1.0), count(clipped)
    noisy = count(runs) - at_end < still * np.maximum(total - at_end, 1.0)
    wide = (high - low).ravel() > least_span * abs(scan.touch.land_moment_n_mm())
    stuck = (at_end > least_share * total) & wide & (noisy | (not is_profiler(scan.touch.tip)))
    return [c & stuck.reshape(shape) for c in clipped]


def _in_runs(values: AnyFloats, run: int) -> Mask:
    n, same = max(values.shape[2] - run + 1, 0), values[..., 1:] == values[..., :-1]
    first = np.logical_and.reduce([same[..., k : k + n] for k in range(run - 1)])
    inside = np.zeros(values.shape, dtype=np.bool_)
    for k in range(run) if first.any() else ():
        inside[..., k : k + n] |= first
    return inside


def by_whisker(stacks: Sequence[AnyFloats]) -> list[AnyFloats]:
    """All values of each whisker from stacks (passes, whiskers, samples)."""
    return [np.concatenate([stack[:, w].ravel() for stack in stacks]) for w in range(stacks[0].shape[1])]


def levels(shares: list[SweepShares], *, fewest: int = 200) -> AnyFloats:
    """(whiskers,) median of all samples of a whisker; NaN with too few samples on the part."""
    return np.array([quantile_of_known(v, fewest=fewest) for v in by_whisker([f.share for f in shares])])


def noises(stacks: list[AnyFloats], *, fewest: int = 200) -> AnyFloats:
    """(whiskers,) rms innovation of samples (passes, whiskers, samples); NaN where there are too few."""
    changes = by_whisker([np.abs(np.diff(stack, n=2)) for stack in stacks])
    return np.asarray(MAD * np.array([quantile_of_known(v, fewest=fewest) for v in changes]) / np.sqrt(6.0))


def level_steps(shares: list[SweepShares]) -> AnyFloats:
    """(whiskers,) rms step of the lead-in's level from a pass to its neighbour."""
    steps: list[AnyFloats] = []
    for f in shares:
        n = f.plan.n_lead or f.share.shape[2] // 8
        steps.append(np.diff(quantile_of_known(f.share[:, :, :n], fewest=n // 2 + 1), axis=0))
    return np.asarray(MAD * quantile_of_known(np.abs(np.concatenate(steps)).T, fewest=8) / np.sqrt(2.0))


def sharpness(shares: list[SweepShares], *, line_pitch_mm: float) -> AnyFloats:
    """(whiskers,) depth and steps of marks, relative to the other whiskers on the same lines; NaN if unknown. Lines on
    both sides of a border cross the same marks; all borders are reconciled by least squares, like gains."""
    n = shares[0].share.shape[1]
    borders: list[tuple[int, int, float]] = []
    for f in shares:
        lines, whisker, place = f.lines
        # whiskers on either side of an unused one are no neighbours
        first = np.flatnonzero((whisker[1:] != whisker[:-1]) & (np.diff(place) < 2.0 * line_pitch_mm))
        first = first[(first + 1 >= BESIDE) & (first + BESIDE < whisker.size)]
        # (borders, sides, lines)
        near = first[:, None, None] + np.arange(1 - BESIDE, 1 + BESIDE).reshape(2, BESIDE)
        near = near[(np.ptp(whisker[near], axis=2) == 0).all(axis=1)]
        marks = lines[near] / quantile_of_known(lines[near])[..., None] - 1.0
        depth = -quantile_of_known(marks.reshape(len(near), 2, BESIDE * lines.shape[1]), 0.02)
        steps = np.sqrt(np.nansum(np.diff(marks, axis=3) ** 2, axis=(2, 3)))
        marked = ((steps >= MARKED_STEPS) & (depth >= MARKED_DEPTH)).all(axis=1)
        step = 0.5 * np.diff(np.log(depth[marked]) + np.log(steps[marked]), axis=1)[:, 0]
        borders += zip(*whisker[near[marked, :, 0]].T.tolist(), step.tolist(), strict=True)
    ratios = np.exp(reconcile_steps(borders, n))
    met = np.bincount([w for before, after, _ in borders for w in (before, after)], minlength=n)
    return np.where(met < 2, np.nan, ratios)


def gains(shares: list[SweepShares]) -> AnyFloats:
    """(whiskers,) gain relative to the others on the same lines, for any form of the plate; NaN if unknown."""
    logs = np.full((len(shares), shares[0].share.shape[1]), np.nan)
    for log, f in zip(logs, shares, strict=True):
        lines, whisker, _ = f.lines
        if np.unique(whisker).size > 1:
            log[whisker] = np.log(whisker_gain(lines, whisker))
    return np.exp(quantile_of_known(logs.T))


def plate_form(
    shares: list[SweepShares], preload_mm: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Rise of the land's plane and sag of its parabola along (x, y), mm over the scanned length; 0 without a sweep. A
    parabola is fitted robustly to the median of all lines at each position."""
    pairs: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for f in shares:
        lines, _, _ = f.lines
        if lines.shape[0] < 8 or lines.shape[1] < 16:
            continue
        middle = quantile_of_known(lines.T)
        terms = np.vander(np.linspace(-1.0, 1.0, middle.size), 3)
        keep = np.isfinite(middle)
        for _ in range(4):
            if keep.sum() < 16:
                break
            bend, slope, level = fit = np.linalg.lstsq(terms[keep], middle[keep], rcond=None)[0]
            off = np.abs(middle - terms @ fit)
            keep = off <= 2.5 * MAD * float(np.median(off[keep])) + 1e-9
        else:
            direction, scale = f.plan.direction, preload_mm / level if level else 0.0
            pairs[direction.along_x].append((2.0 * direction.sign * slope * scale, bend * scale))
    x, y = (np.median(pairs[axis], axis=0).tolist() if pairs[axis] else (0.0, 0.0) for axis in (True, False))
    return (x[0], y[0]), (x[1], y[1])


class Tone(NamedTuple):
    """A spectral line common to all whiskers: its power relative to nearby frequencies, frequency, amplitude."""

    ratio: float = 0.0
    hz: float = 0.0
    amplitude: float = 0.0


def strongest_tone(
    shares: list[SweepShares], sample_rate_hz: float, *, least_hz: float = 10.0, locked: float = 0.5
) -> Tone:
    """The strongest spectral line in the changes from pass to pass: marks do not change, a vibration does."""
    tones = [Tone()]
    for f in shares:
        known = np.isfinite(f.share).mean(axis=2) > 0.9
        both = (known[1:] & known[:-1]).astype(np.float64)
        rows, samples = both.sum(axis=1) > 0, f.share.shape[2]
        if rows.sum() < 4 or samples < 64:
            continue
        change = np.diff(f.share, axis=0)
        change[np.isnan(change)] = 0.0
        # larger changes come from marks that only one of the two passes crosses
        cut = 4.0 * MAD * quantile_of_known(np.abs(change[both > 0.0]).ravel())
        np.clip(change, -cut, cut, out=change)
        shared = np.einsum("pws,pw->ps", change, both)[rows] / both.sum(axis=1)[rows, None]
        window = np.hanning(samples)
        spectrum = np.fft.rfft((shared - shared.mean(axis=1, keepdims=True)) * window)
        power = (np.abs(spectrum) ** 2).mean(axis=0)
        hz = np.fft.rfftfreq(samples, 1.0 / sample_rate_hz)
        # compare a peak with the spectrum three to eight lines beside it
        padded = np.pad(power[1:], (9, 8), constant_values=np.nan)
        around = np.lib.stride_tricks.sliding_window_view(padded, 17)
        peaks = np.flatnonzero((hz >= least_hz) & (hz < 0.4 * sample_rate_hz))
        peaks = peaks[power[peaks] >= np.fmax.reduce(around[peaks, 7:10], axis=1)]
        beside = quantile_of_known(around[peaks][:, [*range(6), *range(11, 17)]])
        ratio = power[peaks] / np.maximum(beside, 1e-30)
        ratio[np.abs(np.mean(np.exp(2j * np.angle(spectrum[:, peaks])), axis=0)) >= locked] = 0.0
        if peaks.size:
            k = int(np.argmax(ratio))
            # sines of amplitude a and random phase differ from pass to pass by 2 a^2 in mean squared amplitude
            amplitude = float(np.sqrt(0.5 * power[peaks[k]]) * 2.0 / window.sum())
            tones.append(Tone(float(ratio[k]), float(hz[peaks[k]]), amplitude))
    return max(tones)


def spikes(f: SweepShares, *, least: float) -> Mask:
    """Mask (passes, whiskers, samples) of single samples that stand out by `least` (land: 1) from all beside them."""
    from scipy.ndimage import maximum_filter1d

    x = f.share
    seen = np.zeros(x.shape)
    seen[..., 2:-2] = np.abs(np.nan_to_num(x[..., 2:-2] - _medians_of_five(x)))
    alone = seen > least
    if len(x) > 1:
        widest = maximum_filter1d(seen, 5, axis=2, mode="wrap")
        beside = np.maximum(np.r_[widest[1:2], widest[:-1]], np.r_[widest[1:], widest[-2:-1]])
        alone &= seen > 4.0 * beside
    return alone


def _medians_of_five(values: AnyFloats) -> AnyFloats:
    """Medians of five neighbours along the last axis, as `np.median` gives them far more slowly."""
    a, b, c, d, e = np.moveaxis(np.lib.stride_tricks.sliding_window_view(values, 5, axis=-1), -1, 0)
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(e, np.maximum(low, high))))


def count_spikes(shares: list[SweepShares], *, least: float, reach: int = 6) -> int:
    """Count `spikes` in lead-ins, lead-outs and in the air, where there are no marks."""
    count = sum(int((np.abs(f.air) > least).sum()) for f in shares)
    for f in (f for f in shares if f.plan.n_lead):
        for ahead in (f.share, f.share[..., ::-1]):
            near = replace(f, share=ahead[..., : f.plan.n_lead + reach])
            count += int(spikes(near, least=least)[..., : f.plan.n_lead].sum())
    return count
