"""Find faulty whiskers and faults of the bench in a recording: names, sizes and remedies.

fault_measures --limits, and the other whiskers--> faults --flag_faults--> the recording without unusable samples

A whisker is compared with the others of its array, which trace the same part. Faults common to all are the bench's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from operator import itemgetter

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.estimation import fault_measures as measures
from whisker_array.estimation.estimate import moment_per_lift
from whisker_array.estimation.fault_measures import Floats, SweepShares
from whisker_array.scan.scan import Scan, only
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.touch import Touch


class FaultKind(StrEnum):
    """Kinds of faults: name, measure and remedy.

    Attributes:
        measure: message with gaps for the numbers measured.
        hint: remedy of the fault.
    """

    measure: str
    hint: str

    def __new__(cls, name: str, measure: str, hint: str) -> FaultKind:
        """A kind of fault, equal to its name."""
        member = str.__new__(cls, name)
        member._value_, member.measure, member.hint = name, measure, hint
        return member

    DEAD = (
        "dead whisker",
        "gives {:.0f} % of the moment of land",
        "check for breakage, gauge and wire",
    )
    NOISY = (
        "noisy whisker",
        "its noise is {:.1f} % of the moment of land",
        "check its plug, solder joints and shield",
    )
    LOOSE = "loose clamp", "its level on land jumps by {:.1f} % from pass to pass", "tighten its clamp"
    BENT = (
        "bent whisker",
        "gives {:.0f} % of the moment that the others give on the same lines",
        "straighten or replace it, then calibrate",
    )
    WORN = (
        "worn tip",
        "marks are {:.0f} % as deep and sharp as under the others",
        "inspect its tip with a magnifier; grind or replace it",
    )
    HEIGHT = (
        "wrong height",
        "land gives {:.0f} % of the expected moment, the stage is about {:.2f} mm too {}",
        "set the stage to the height in the whisker file, then calibrate",
    )
    TILTED = (
        "tilted plate",
        "it rises by {:.2f} mm along {}, the preload is {:.2f} mm",
        "seat the part flat, clean its rests",
    )
    BOWED = (
        "bowed plate",
        "its middle stands off by {:.2f} mm along {}, the preload is {:.2f} mm",
        "clamp the part flat; a round part needs a stage that follows it",
    )
    VIBRATION = (
        "vibration",
        "all whiskers swing by {:.1f} % at {:.0f} Hz",
        "stop the machine that shakes the bench, or check the amplifier for mains hum",
    )
    SPIKES = (
        "spikes",
        "{} single samples stand out where there are no marks",
        "keep the signal wires away from motors and relays; shield and earth them",
    )
    SATURATED = (
        "saturated signal",
        "{:.1f} % of the samples of {} of {} whiskers stand still at an end of the range; depths there are wrong",
        "lower the gain, or the preload",
    )


@dataclass(frozen=True, repr=False)
class FaultLimits(OneLine):
    """Limits of sound recordings; they are well above the values of sound sensors, dies, plates and dirt in simulation.

    The limit of a worn tip was set on the recordings on which its false alarms are counted.

    Attributes:
        dead_level: least share of the land's moment that a working whisker gives.
        noise_air: noise of a sample with the array lifted, share of the land's moment.
        noise_land: the same on land.
        loose_step: step of the level from one pass to the next, share of the land's moment.
        times_others: greatest ratio of a whisker's noise and steps to those of the others.
        bent_gain: deviation of a gain from the others': five standard deviations of usual gains.
        blunt: least depth and sharpness of marks relative to the other whiskers.
        blunt_spreads: spreads of the others that a worn tip must also be below them, because marks differ.
        alike: greatest spread of the others on a test piece with grooves across all whiskers.
        alike_blunt: limit in place of `blunt` on such a test piece.
        fewest_others: least number of other whiskers for comparing marks.
        height_margin: margin beyond the effect of friction, share of the land's moment.
        frictions: least and greatest friction of land.
        rise: rise of a tilted plate over its length, preloads.
        sag: sag of a bowed plate over its length, preloads.
        tone: amplitude of a vibration, share of the land's moment.
        tone_ratio: power of a vibration over that of frequencies beside it.
        spike: height of a spike, share of the land's moment.
        few_spikes: least number of spikes on bare land and in the air that is reported.
    """

    dead_level: float = 0.2
    noise_air: float = 0.01
    noise_land: float = 0.03
    loose_step: float = 0.02
    times_others: float = 4.0
    bent_gain: float = 0.15
    blunt: float = 0.45
    blunt_spreads: float = 5.0
    alike: float = 0.01
    alike_blunt: float = 0.8
    fewest_others: int = 3
    height_margin: float = 0.2
    frictions: tuple[float, float] = (0.05, 0.6)
    rise: float = 0.25
    sag: float = 0.15
    tone: float = 0.008
    tone_ratio: float = 12.0
    spike: float = 0.05
    few_spikes: int = 12


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        kind: kind of fault.
        text: message with size, place and remedy.
        whisker: number of the whisker from 0; None for faults of the bench.
    """

    kind: FaultKind
    text: str
    whisker: int | None = None


def _fault(kind: FaultKind, *numbers: object, whisker: int | None = None, message: str = "") -> Fault:
    place = kind.value if whisker is None else f"whisker {whisker}, {kind.value}"
    return Fault(kind, f"{place}: {(message or kind.measure).format(*numbers)} ({kind.hint})", whisker)


def find_faults(scan: Scan, limits: FaultLimits = FaultLimits()) -> tuple[Fault, ...]:
    """Find faults of whiskers and bench; empty for a sound recording.

    In a mixed array only the first kind of whisker is checked. Wear common to all tips is not found. Gains calibrated
    on the same land hide faults: in a recording in volts, `calibrate` hides a wrong height and bent whiskers.

    Args:
        scan: a raw or calibrated scan.
        limits: limits of sound recordings.
    """
    columns = np.flatnonzero(np.asarray(scan.kind) == 0)
    if all(s.plan.pushed for s in scan.sweeps):
        return ()
    scan, saturated = _flag_saturated(only(scan))
    shares = measures.sweep_shares(scan)
    level = measures.levels(shares)
    touching = np.isfinite(level)
    if not touching.any():
        return saturated
    dead = touching & (np.abs(level) < limits.dead_level)
    if dead.sum() > 0.5 * touching.sum():
        percent = 100.0 * float(np.median(level[touching]))
        what = "the whiskers hardly touch: {:.0f} % of the moment of land"
        return (*saturated, _fault(FaultKind.HEIGHT, percent, message=what))
    # size of each whisker's fault, NaN without a fault
    noisy = np.full(level.size, np.nan)
    for stacks, least in (
        ([f.air for f in shares], limits.noise_air),
        ([f.share for f in shares], limits.noise_land),
    ):
        rms = np.where(dead, np.nan, measures.noises(stacks))
        noisy = np.fmax(noisy, _above_others(rms, least, limits))
    found = {FaultKind.DEAD: np.where(dead, level, np.nan), FaultKind.NOISY: noisy}
    bench: list[Fault] = []
    good = touching & ~dead & np.isnan(noisy)
    if good.any():
        sound = [f.only(good) for f in shares]
        n_spikes = measures.count_spikes(sound, least=limits.spike)
        if n_spikes >= limits.few_spikes:
            bad = (measures.spikes(f, least=limits.spike) for f in sound)
            sound = [replace(f, share=np.where(b, np.nan, f.share)) for f, b in zip(sound, bad, strict=True)]
        loose = _above_others(measures.level_steps(sound), limits.loose_step, limits)
        firm = good & np.isnan(loose)
        gain = measures.gains([f.only(firm) for f in sound])
        gain /= np.nanmedian(gain) if np.isfinite(gain).any() else 1.0
        bent = np.where(np.abs(gain - 1.0) > limits.bent_gain, gain, np.nan)
        straight = [f.only(firm & np.isnan(bent)) for f in sound]
        kept = measures.sharpness(straight, line_pitch_mm=scan.line_pitch_mm)
        found |= {FaultKind.LOOSE: loose, FaultKind.BENT: bent, FaultKind.WORN: _blunt(kept, limits)}
        bench = list(_bench_faults(scan, sound, level[good], limits))
        if n_spikes >= limits.few_spikes:
            bench.append(_fault(FaultKind.SPIKES, n_spikes))
    of_whiskers = (
        _fault(kind, 100.0 * values[w], whisker=int(columns[w]))
        for kind, values in found.items()
        for w in np.flatnonzero(np.isfinite(values))
    )
    return (*saturated, *of_whiskers, *bench)


def _flag_saturated(scan: Scan) -> tuple[Scan, tuple[Fault, ...]]:
    """Flag the clipped samples of a scan of one kind of whisker; return it and the fault, if any."""
    masks = measures.saturated(scan)
    clipped = np.sum([mask.sum(axis=(0, 2)) for mask in masks], axis=0)
    if not clipped.any():
        return scan, ()
    bit = np.uint8(SampleFlag.SATURATED)
    sweeps = tuple(
        replace(sweep, flags=sweep.flags | np.where(mask, bit, np.uint8(0)))
        for sweep, mask in zip(scan.sweeps, masks, strict=True)
    )
    hit = int(np.count_nonzero(clipped))
    percent = 100.0 * float(clipped.sum()) * clipped.size / (hit * scan.n_samples)
    fault = _fault(FaultKind.SATURATED, percent, hit, clipped.size)
    return replace(scan, sweeps=sweeps), (fault,)


def _others(values: Floats) -> Iterator[Floats]:
    """Yield, for each whisker, the known values of the others."""
    for w in range(values.size):
        others = np.delete(values, w)
        yield others[np.isfinite(others)]


def _above_others(values: Floats, least: float, limits: FaultLimits) -> Floats:
    """Values above a limit and well above those of the others; NaN elsewhere."""
    usual = np.array([np.median(others) if others.size else np.inf for others in _others(values)])
    return np.where((values > least) & (values > limits.times_others * usual), values, np.nan)


def _blunt(kept: Floats, limits: FaultLimits) -> Floats:
    """Relative sharpness of whiskers that are blunter than the others by more than these differ; NaN elsewhere."""
    logs, found = np.log(kept), np.full(kept.size, np.nan)
    for w, others in enumerate(_others(logs)):
        if others.size < limits.fewest_others:
            continue
        middle = float(np.median(others))
        spread = measures.MAD * float(np.median(np.abs(others - middle)))
        most = limits.alike_blunt if spread < limits.alike else limits.blunt
        if logs[w] - middle < -max(-np.log(most), limits.blunt_spreads * spread):
            found[w] = np.exp(logs[w] - middle)
    return found


def _bench_faults(
    scan: Scan, shares: list[SweepShares], level: Floats, limits: FaultLimits
) -> Iterator[Fault]:
    preload = scan.touch.preload_mm
    low, high = _land_range(scan.touch, limits.frictions)
    share = float(np.median(level))
    if not low - limits.height_margin < share < high + limits.height_margin:
        way = "high" if share < 1.0 else "low"
        yield _fault(FaultKind.HEIGHT, 100.0 * share, abs(share - 1.0) * preload, way)
    kinds = (FaultKind.TILTED, limits.rise), (FaultKind.BOWED, limits.sag)
    for (kind, limit), both in zip(kinds, measures.plate_form(shares, preload), strict=True):
        mm, axis = max(zip(map(abs, both), "xy", strict=True), key=itemgetter(0))
        if mm > limit * preload:
            yield _fault(kind, mm, axis, preload)
    tone = measures.strongest_tone(shares, scan.sample_rate_hz)
    if tone.amplitude > limits.tone and tone.ratio > limits.tone_ratio:
        yield _fault(FaultKind.VIBRATION, 100.0 * tone.amplitude, tone.hz)


def _land_range(touch: Touch, frictions: tuple[float, float]) -> tuple[float, float]:
    """Land moments at the least and greatest friction, as shares of the nominal land moment."""
    nominal = float(moment_per_lift(np.arctan(touch.friction), touch.tip))
    ends = [float(moment_per_lift(np.arctan(mu), touch.tip)) / nominal for mu in frictions]
    ends = [v for v in ends if np.isfinite(v)] or [1.0]
    return min(ends), max(ends)


def flag_faults(scan: Scan, faults: Sequence[Fault], limits: FaultLimits = FaultLimits()) -> Scan:
    """Flag samples of dead and noisy whiskers, and spikes, as `SampleFlag.FAULTY`, and clipped ones as saturated.

    Args:
        scan: the recording.
        faults: faults found in it.
        limits: limits with which they were found.

    Returns:
        The scan with the flags, or the scan itself if there is nothing to flag.
    """
    useless = (FaultKind.DEAD, FaultKind.NOISY)
    whiskers = sorted({f.whisker for f in faults if f.kind in useless and f.whisker is not None})
    spiked = {}
    if any(f.kind is FaultKind.SPIKES for f in faults):
        shares = measures.sweep_shares(only(scan))
        spiked = {
            one.plan.direction: measures.spikes(one, least=limits.spike)[np.argsort(one.across)]
            for one in shares
        }
    clipped = {}
    if any(f.kind is FaultKind.SATURATED for f in faults):
        clipped = {s.plan.direction: s.flags for s in _flag_saturated(only(scan))[0].sweeps}
    if not whiskers and not spiked and not clipped:
        return scan
    bad, columns = np.uint8(SampleFlag.FAULTY), np.flatnonzero(np.asarray(scan.kind) == 0)
    sweeps = []
    for sweep in scan.sweeps:
        flags = sweep.flags.copy()
        flags[:, whiskers] |= bad
        if not sweep.plan.pushed and sweep.plan.direction in clipped:
            flags[:, columns] |= clipped[sweep.plan.direction] & np.uint8(SampleFlag.SATURATED)
        if not sweep.plan.pushed and sweep.plan.direction in spiked:
            flags[:, columns] |= np.where(spiked[sweep.plan.direction], bad, np.uint8(0))
        sweeps.append(replace(sweep, flags=flags))
    return replace(scan, sweeps=tuple(sweeps))
