"""Measures of each whisker and of the bench: levels, noise, steps, sharpness, form, lines of a spectrum.

    moment |      air | lead-in |   marks    | lead-out       level     land over what the whisker model expects
           |          |_____ ___|__   __   __|_______         noise     what does not repeat from sample to sample
           |__________|     '      \\_/  \\_/                  wander    steps of the lead-in from pass to pass
           +---------------------------------------> t        gain, edges of a whisker over those of its neighbour

All are shares of the land's moment, lengths aside. Marks hardly differ from one pass to the next beside it; what does
is the bench's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from whisker_array.estimation.edges import UNUSABLE, calibrated_moments
from whisker_array.estimation.land import reconcile_steps, whisker_gain
from whisker_array.scan.scan import Scan
from whisker_array.scan.sweep import Sweep

Floats = NDArray[np.float64]
MAD = 1.4826
"""From a median of deviations to a standard deviation."""


@dataclass(frozen=True, eq=False, repr=False)
class SweepShares(OneLine):
    """The dragged passes of one direction as shares of the land's moment, NaN where not usable.

    Attributes:
        sweep: as recorded.
        share: (passes, whiskers, samples).
        air: (passes, whiskers, air samples), each pass about its median.
    """

    sweep: Sweep
    share: Floats
    air: Floats


def sweep_shares(scan: Scan) -> list[SweepShares]:
    """The dragged sweeps of a scan of one kind of whisker."""
    land, found = scan.touch.land_moment_n_mm(), []
    for sweep in (s for s in scan.sweeps if not s.plan.pushed):
        share = calibrated_moments(scan, sweep) / land
        share[(sweep.flags & UNUSABLE) != 0] = np.nan
        air = sweep.air_n_mm.astype(np.float64) / land
        if scan.calibration is not None:
            air /= scan.calibration.gain[:, None]
        if air.shape[2]:
            air -= np.median(air, axis=2, keepdims=True)
        found.append(SweepShares(sweep, share, air))
    return found


def levels(shares: list[SweepShares]) -> Floats:
    """(whiskers,) median of all that a whisker felt; NaN where it was hardly on the part."""
    return np.array([_median(values) for values in _of_whiskers([f.share for f in shares])])


def _of_whiskers(stacks: list[Floats]) -> list[Floats]:
    return [np.concatenate([s[:, w].ravel() for s in stacks]) for w in range(stacks[0].shape[1])]


def _median(values: Floats, *, fewest: int = 200) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size >= fewest else float("nan")


def noises(shares: list[SweepShares]) -> tuple[Floats, Floats]:
    """(whiskers,) rms of what is new in each sample, lifted and touching; NaN where there are too few samples."""
    return _noise([f.air for f in shares]), _noise([f.share for f in shares])


def _noise(stacks: list[Floats]) -> Floats:
    if stacks[0].shape[2] <= 2:
        return np.full(stacks[0].shape[1], np.nan)
    changes = _of_whiskers([np.diff(stack, n=2, axis=2) for stack in stacks])
    return np.array([MAD * _median(np.abs(change)) / np.sqrt(6.0) for change in changes])


def level_steps(shares: list[SweepShares]) -> Floats:
    """(whiskers,) rms step of the lead-in's level from a pass to the one beside it."""
    steps: list[Floats] = []
    for f in shares:
        n = f.sweep.plan.n_lead or f.share.shape[2] // 8
        lead = f.share[:, :, :n]
        known = np.isfinite(lead).sum(axis=2) > n // 2
        level = np.full(known.shape, np.nan)
        level[known] = np.nanmedian(lead[known], axis=1)
        order = np.argsort(f.sweep.plan.line_mm[:, 0], kind="stable")
        steps.append(np.diff(level[order], axis=0))
    joined = np.concatenate(steps)
    found = np.full(joined.shape[1], np.nan)
    for w, own in enumerate(joined.T):
        known = own[np.isfinite(own)]
        if known.size >= 8:
            found[w] = MAD * np.median(np.abs(known)) / np.sqrt(2.0)
    return found


def sharpness(
    shares: list[SweepShares],
    *,
    line_pitch_mm: float,
    beside: int = 2,
    least_steps: float = 0.3,
    least_depth: float = 0.02,
) -> Floats:
    """(whiskers,) depth and steps of marks over what the others feel of them where they meet; NaN if unknown.

    Lines on either side of where two whiskers meet run over the same marks; a worn tip does not reach their floors, and
    rounds their edges. All borders are reconciled by least squares, as gains are.

    Args:
        shares: of all sweeps.
        line_pitch_mm: of the grid: lines more than two of it apart, as in a part felt by a few passes, run over
            different marks and do not compare the tips.
        beside: lines on either side of a border between whiskers.
        least_steps: root sum of squares of the steps along such lines, share of the land: less is no mark.
        least_depth: share of the land: a line that is less deep runs beside the strokes that the other meets.
    """
    n, borders = shares[0].share.shape[1], []
    for f in shares:
        lines, whisker, place = _lines(f)
        marks = lines / np.nanmedian(lines, axis=1, keepdims=True) - 1.0
        gaps = np.diff(place)
        # nor do neighbours meet over the gap that a whisker leaves which is out of use
        for i in np.flatnonzero((whisker[1:] != whisker[:-1]) & (gaps < 2.0 * line_pitch_mm)):
            before, after = slice(i + 1 - beside, i + 1), slice(i + 1, i + 1 + beside)
            if i + 1 < beside or np.ptp(whisker[before]) or np.ptp(whisker[after]):
                continue
            (depth0, steps0), (depth1, steps1) = _contrast(marks[before]), _contrast(marks[after])
            if min(steps0, steps1) < least_steps or min(depth0, depth1) < least_depth:
                continue
            step = 0.5 * float(np.log(depth1 / depth0) + np.log(steps1 / steps0))
            borders.append((int(whisker[i]), int(whisker[i + 1]), step))
    found = np.exp(reconcile_steps(borders, n))
    met = np.bincount([w for before, after, _ in borders for w in (before, after)], minlength=n)
    found[met < 2] = np.nan
    return np.asarray(found)


def _contrast(marks: Floats) -> tuple[float, float]:
    """Depth and total steps of marks, shares of the land."""
    steps = float(np.sqrt(np.nansum(np.diff(marks, axis=1) ** 2)))
    return -float(np.nanquantile(marks, 0.02)), steps


def gains(shares: list[SweepShares]) -> Floats:
    """(whiskers,) gain of each over the others' where they meet, whatever the plate's form; NaN where not known."""
    n = shares[0].share.shape[1]
    logs: list[list[float]] = [[] for _ in range(n)]
    for f in shares:
        lines, whisker, _ = _lines(f)
        if np.unique(whisker).size < 2:
            continue
        found = whisker_gain(lines, whisker)
        for w in np.unique(whisker):
            logs[w].append(float(np.log(found[whisker == w][0])))
    return np.array([np.exp(np.median(one)) if one else np.nan for one in logs])


def _lines(f: SweepShares) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Lines that were felt, without lead-in and -out, in their order across; the whisker and the place of each."""
    passes, n, samples = f.share.shape
    lead = f.sweep.plan.n_lead
    order = np.argsort(f.sweep.plan.line_mm, axis=None, kind="stable")
    lines = f.share.reshape(-1, samples)[order, lead : samples - lead]
    keep = np.isfinite(lines).mean(axis=1) > 0.5
    return lines[keep], np.tile(np.arange(n), passes)[order][keep], f.sweep.plan.line_mm.ravel()[order][keep]


@dataclass(frozen=True)
class Form:
    """Form of the plate, mm over the length and width that were felt: a plane's rise, a parabola's sag."""

    rise_x_mm: float
    rise_y_mm: float
    sag_x_mm: float
    sag_y_mm: float


def plate_form(shares: list[SweepShares], preload_mm: float) -> Form:
    """Rise and sag of the land along the travel of the sweeps; zero where none ran.

    The middle of all lines at each place is land, and has no gain of one whisker in it; a parabola is laid through
    most of them. (The estimator's own land may settle on another form where a plate is far off.)
    """
    found: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for f in shares:
        lines, _, _ = _lines(f)
        if lines.shape[0] < 8 or lines.shape[1] < 16:
            continue
        known = np.isfinite(lines).any(axis=0)
        middle = np.full(known.size, np.nan)
        middle[known] = np.nanmedian(lines[:, known], axis=0)
        u = np.linspace(-1.0, 1.0, middle.size)
        keep = np.isfinite(middle)
        for _ in range(4):
            if keep.sum() < 16:
                break
            bend, slope, level = np.polyfit(u[keep], middle[keep], 2)
            off = np.abs(middle - (level + u * (slope + u * bend)))
            keep = off <= 2.5 * MAD * float(np.median(off[keep])) + 1e-9
        else:
            forward = -1.0 if f.sweep.plan.direction.backward else 1.0
            scale = preload_mm / level if level else 0.0
            found[f.sweep.plan.direction.along_x].append((2.0 * forward * slope * scale, bend * scale))
    (rise_x, sag_x), (rise_y, sag_y) = (
        np.median(found[axis], axis=0) if found[axis] else (0.0, 0.0) for axis in (True, False)
    )
    return Form(float(rise_x), float(rise_y), float(sag_x), float(sag_y))


@dataclass(frozen=True)
class Tone:
    """A line in the spectrum that all whiskers share: frequency, amplitude, and its power over that beside it."""

    hz: float
    amplitude: float
    ratio: float


def strongest_tone(
    shares: list[SweepShares], sample_rate_hz: float, *, least_hz: float = 10.0, locked: float = 0.5
) -> Tone:
    """The strongest line in what changes from pass to pass: marks stand still, a vibration does not.

    Neighbouring passes of a whisker differ by noise and by the phase of a vibration; the mean over whiskers leaves what
    they share.

    Args:
        shares: of all sweeps.
        sample_rate_hz: of the converter.
        least_hz: lowest frequency that counts.
        locked: agreement of phases from pass to pass, above which a wave stands on the plate.
    """
    best = Tone(0.0, 0.0, 0.0)
    for f in shares:
        order = np.argsort(f.sweep.plan.line_mm[:, 0], kind="stable")
        known = np.isfinite(f.share).mean(axis=2) > 0.9
        change = np.nan_to_num(np.diff(f.share[order], axis=0))
        both = (known[order][1:] & known[order][:-1]).astype(np.float64)
        rows = both.sum(axis=1) > 0
        if rows.sum() < 4 or change.shape[2] < 64:
            continue
        # beyond what a vibration changes is a mark that the one pass met and the other did not
        cut = 4.0 * MAD * np.median(np.abs(change[both > 0.0]))
        shared = (np.clip(change, -cut, cut) * both[..., None]).sum(axis=1)[rows] / both.sum(axis=1)[
            rows, None
        ]
        window = np.hanning(shared.shape[1])
        spectrum = np.fft.rfft((shared - shared.mean(axis=1, keepdims=True)) * window)
        power = (np.abs(spectrum) ** 2).mean(axis=0)
        hz = np.fft.rfftfreq(shared.shape[1], 1.0 / sample_rate_hz)
        # a peak is held against what lies three to eight lines beside it
        padded = np.pad(power[1:], (9, 8), constant_values=np.nan)
        around = np.lib.stride_tricks.sliding_window_view(padded, 17)
        at = np.flatnonzero((hz >= least_hz) & (hz < 0.4 * sample_rate_hz))
        at = at[power[at] >= np.nanmax(around[at, 7:10], axis=1)]
        beside = np.nanmedian(around[at][:, [*range(6), *range(11, 17)]], axis=1)
        for k, other in zip(at, beside, strict=True):
            ratio = float(power[k] / max(float(other), 1e-30))
            # of a sine of amplitude a, differences between passes of any phase have 2 a^2 on average
            amplitude = float(np.sqrt(0.5 * power[k]) * 2.0 / window.sum())
            if ratio > best.ratio and abs(np.mean(np.exp(2j * np.angle(spectrum[:, k])))) < locked:
                best = Tone(float(hz[k]), amplitude, ratio)
    return best


def _median_of_five(a: Floats, b: Floats, c: Floats, d: Floats, e: Floats) -> Floats:
    """Return the median at each place, NaN where any is: a sorting network, ten times as fast as `np.median`."""
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    median: Floats = np.maximum(np.minimum(e, low), np.minimum(np.maximum(e, low), high))
    return median


SPIKE_REACH = 6
"""Samples beyond a stretch on which its spikes depend."""


def spikes(f: SweepShares, *, least: float) -> NDArray[np.bool_]:
    """(passes, whiskers, samples) single samples that stand out alone: neither their neighbours nor the pass beside do.

    Args:
        f: of one direction.
        least: how far they stand out, share of the land.
    """
    x = f.share
    out = np.zeros(x.shape)
    middle = _median_of_five(*(x[..., k : x.shape[2] - 4 + k] for k in range(5)))
    out[..., 2:-2] = np.abs(np.nan_to_num(x[..., 2:-2] - middle))
    order = np.argsort(f.sweep.plan.line_mm[:, 0], kind="stable")
    seen = out[order]
    widest = np.max([np.roll(seen, k, axis=2) for k in (-2, -1, 0, 1, 2)], axis=0)
    beside = (
        np.maximum(np.r_[widest[1:2], widest[:-1]], np.r_[widest[1:], widest[-2:-1]])
        if len(x) > 1
        else 0.0 * seen
    )
    found = np.empty(x.shape, dtype=np.bool_)
    found[order] = (seen > least) & (seen > 4.0 * beside)
    return found
