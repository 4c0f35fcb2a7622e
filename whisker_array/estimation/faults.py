"""Find faulty signals, whiskers and benches in a recording: names, sizes and remedies.

signal_measures, fault_measures --limits, and the other whiskers--> faults --flag_faults--> usable samples

A whisker is compared with the others of its array, which trace the same part. Faults common to all are the bench's.
Signals come first: with a reversed sign or another unit, a stage at the right height would seem to be far off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from operator import itemgetter

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.arrays import AnyFloats, Mask
from whisker_array.estimation import fault_measures as measures
from whisker_array.estimation import signal_measures as signals
from whisker_array.estimation.estimate import moment_per_lift
from whisker_array.estimation.fault_measures import SweepShares
from whisker_array.scan.scan import Scan, add_flags, only
from whisker_array.simulation.traces import SampleFlag


class FaultKind(StrEnum):
    """Kinds of faults: name, measure and remedy."""

    measure: str
    hint: str

    def __new__(cls, name: str, measure: str, hint: str) -> FaultKind:
        member = str.__new__(cls, name)
        member._value_, member.measure, member.hint = name, measure, hint
        return member

    NO_SIGNAL = (
        "no signal",
        "the signals do not change when the array is lowered",
        "check plugs, supply and amplifier of the bridges first, then whether the tips reach the part",
    )
    REVERSED = (
        "reversed signal",
        "the sign of the signal is reversed, land gives {:.0f} % of the expected moment",
        "exchange the signal wires or turn the sign of scale_factor; leave the stage where it is",
    )
    LIFTED = (
        "lifted samples",
        "the array touches where samples are marked as lifted",
        "exchange them in /stage/phase (columns.lifted of imported traces); leave the stage where it is",
    )
    SHIFTED = (
        "shifted signal",
        "the signals come {} than the stage's phase and positions, by {} sample{}",
        "they are read shifted back; check the trigger and the filter of the converter, and the clock of the stage",
    )
    UNIT = (
        "other unit",
        "land gives {:,.4g} times the expected moment",
        "are the signals in another unit, such as mV for V or uN*m for N*mm? Check units, scale_factor and "
        "amplifier; leave the stage where it is",
    )
    EXCHANGED = (
        "exchanged channels",
        "lines of neighbouring whiskers do not fit each other; they fit {}",
        "check plugs and the order of the channels, and the sign of the positions across the passes",
    )
    DOUBLED = (
        "doubled channel",
        "it has the same signal as whisker {:.0f}",
        "check the list of channels and the plugs",
    )
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
    LOOSE = (
        "loose clamp",
        "its level on land jumps by {:.1f} % from pass to pass",
        "tighten its clamp, check its plug",
    )
    BENT = (
        "bent whisker",
        "gives {:.0f} % of the moment that the others give on the same lines",
        "check its gain; straighten or replace it, then calibrate",
    )
    WORN = (
        "worn tip",
        "marks are {:.0f} % as deep and sharp as under the others",
        "inspect its tip with a magnifier; grind or replace it",
    )
    HEIGHT = (
        "wrong height",
        "land gives {:.0f} % of the expected moment, as if the stage were about {:.2f} mm too {}",
        "check unit, gain and supply of the bridges, then set the stage to the height in the whisker file, calibrate",
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
    COARSE = (
        "coarse signal",
        "the converter's steps are {:.1f} % of the moment of land",
        "raise the gain or use a smaller range of the converter, but leave room for the marks",
    )


@dataclass(frozen=True, repr=False)
class FaultLimits(OneLine):
    """Limits of sound recordings, well above the values of sound sensors, dies, plates and dirt in simulation: shares
    of the land's moment, for a plate preloads."""

    unit: float = 5.0  # ratio of moments above which the unit is in doubt and not the height of the stage
    clear: float = 20.0
    # least mean squared difference of neighbouring lines, share of the land, with exchanged channels
    misfit: float = 0.005
    misfit_left: float = 0.4  # greatest share of it that is left in another order of the channels
    dead_level: float = 0.2
    noise_air: float = 0.01
    noise_land: float = 0.03
    loose_step: float = 0.02
    times_others: float = 4.0  # greatest ratio of a whisker's noise and steps to those of the others
    bent_gain: float = 0.15  # deviation of a gain from the others': five standard deviations of usual gains
    # least sharpness of marks relative to others'; false alarms were counted on the recordings that set it
    blunt: float = 0.45
    # spreads of the others that a worn tip must also be below them, because marks differ
    blunt_spreads: float = 5.0
    # greatest spread of the others on a test piece with grooves; there `alike_blunt` stands for `blunt`
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
    coarse: float = 0.02  # a converter of 10 bits has steps of 0.6 %
    few_spikes: int = 12


@dataclass(frozen=True)
class Fault:
    """One fault, of a whisker or of the bench."""

    kind: FaultKind
    text: str
    whisker: int | None = None


def _fault(kind: FaultKind, *numbers: object, whisker: int | None = None, message: str = "") -> Fault:
    place = kind.value if whisker is None else f"whisker {whisker}, {kind.value}"
    return Fault(kind, f"{place}: {(message or kind.measure).format(*numbers)} ({kind.hint})", whisker)


def find_faults(scan: Scan, limits: FaultLimits = FaultLimits()) -> tuple[Fault, ...]:
    """Find faults of signals, whiskers and, if all signals are sound, the bench; empty for a sound recording. Only the
    first kind of whisker is checked. Wear common to all tips is not found, and `calibrate` hides a wrong height."""
    if (checked := _check_signals(scan, limits)) is None:
        return ()
    if any(f.whisker is None for f in checked.faults):
        return (*checked.faults, *checked.corrected)
    scan, shares, level, corrected = checked.scan, checked.shares, checked.level, checked.corrected
    touching = np.isfinite(level) & ~checked.wrong
    dead = touching & (np.abs(level) < limits.dead_level)
    if dead.sum() > 0.5 * touching.sum() and not (level[touching] > 0.5).any() and not checked.faults:
        percent = 100.0 * float(np.median(level[touching]))
        what = "the whiskers hardly touch: {:.0f} % of the moment of land"
        return (*corrected, _fault(FaultKind.HEIGHT, percent, message=what))
    # size of each whisker's fault, NaN without a fault
    noisy = np.full(level.size, np.nan)
    for stacks, least in (
        ([f.air for f in shares], limits.noise_air),
        ([f.share for f in shares], limits.noise_land),
    ):
        rms = np.where(dead | checked.wrong, np.nan, measures.noises(stacks))
        noisy = np.fmax(noisy, _above_others(rms, least, limits))
    by_kind = {FaultKind.DEAD: np.where(dead, level, np.nan), FaultKind.NOISY: noisy}
    bench: list[Fault] = []
    good = touching & ~dead & np.isnan(noisy)
    if good.any():
        sound = [f.only(good) for f in shares]
        n_spikes = measures.count_spikes(sound, least=limits.spike)
        if any(f.kind is FaultKind.COARSE for f in corrected):
            n_spikes = 0  # noise makes single samples a whole step higher
        if n_spikes >= limits.few_spikes:
            bad = [measures.spikes(f, least=limits.spike) for f in sound]
            sound = signals.without(sound, bad)
        loose = _above_others(measures.level_steps(sound), limits.loose_step, limits)
        firm = good & np.isnan(loose)
        gain = measures.gains([f.only(firm) for f in sound])
        gain /= np.nanmedian(gain) if np.isfinite(gain).any() else 1.0
        bent = np.where(np.abs(gain - 1.0) > limits.bent_gain, gain, np.nan)
        straight = [f.only(firm & np.isnan(bent)) for f in sound]
        cutoff = measures.sharpness(straight, line_pitch_mm=scan.line_pitch_mm)
        by_kind |= {FaultKind.LOOSE: loose, FaultKind.BENT: bent, FaultKind.WORN: _blunt(cutoff, limits)}
        if not checked.faults:
            bench = list(_bench_faults(scan, sound, level[good], limits))
        if n_spikes >= limits.few_spikes:
            bench.append(_fault(FaultKind.SPIKES, n_spikes))
    of_whiskers = (
        _fault(kind, 100.0 * values[w], whisker=checked.columns[w])
        for kind, values in by_kind.items()
        for w in np.flatnonzero(np.isfinite(values))
    )
    return (*checked.faults, *corrected, *of_whiskers, *bench)


def find_signal_faults(
    scan: Scan, limits: FaultLimits = FaultLimits(), *, volts: bool = False
) -> tuple[Fault, ...]:
    """Find faults of signals alone, before whiskers and bench can be judged."""
    checked = _check_signals(scan, limits, volts=volts)
    if checked is None:
        return ()
    return (*(f for f in checked.corrected if f.kind is FaultKind.SHIFTED), *checked.faults)


@dataclass(frozen=True)
class _CheckedSignals:
    """Signals of the first kind of whisker."""

    scan: Scan
    columns: list[int]
    shares: list[SweepShares]  # all sweeps, NaN where tips run beyond the part
    level: AnyFloats  # (whiskers,) level of the land; NaN for a whisker that has too few samples on the part
    wrong: Mask
    faults: tuple[Fault, ...]
    corrected: tuple[Fault, ...]  # those that leave all others to be found


def _check_signals(scan: Scan, limits: FaultLimits, *, volts: bool = False) -> _CheckedSignals | None:
    if all(s.plan.pushed for s in scan.sweeps):
        return None
    columns = np.flatnonzero(np.asarray(scan.kind) == 0).tolist()
    scan, late = _without_delay(only(scan))
    scan, range_faults = _flag_saturated(scan, limits)
    empty = signals.without_value(scan)
    if empty.all():
        fault = _fault(FaultKind.NO_SIGNAL, message="no sample of any channel has a value")
        return _CheckedSignals(scan, columns, [], np.full(empty.size, np.nan), empty, (fault,), ())
    dead = (_fault(FaultKind.DEAD, whisker=columns[w], message="has no value") for w in np.flatnonzero(empty))
    corrected = (*late, *dead, *range_faults)
    everywhere = measures.sweep_shares(scan, outside=True)
    beyond = signals.beyond_part(everywhere, least=limits.dead_level)
    outside = signals.flagged_beyond_part(scan, everywhere) if signals.knows_part(scan) else beyond
    shares = signals.without(everywhere, outside)
    level = measures.levels(shares)
    touching = np.isfinite(level)
    if not touching.any():
        return _CheckedSignals(scan, columns, shares, level, touching, (), corrected)
    present = touching & signals.above_noise(shares, level)
    usual = float(np.median(np.abs(level[present]))) if present.any() else 0.0
    raw = level
    if volts and usual > 0.0:
        level, usual = level / (usual * np.sign(np.median(level[present]))), 1.0
    clear = np.zeros_like(present)
    if usual < limits.dead_level or not (level[touching] > limits.dead_level * max(usual, 1.0)).all():
        clear = present & signals.is_clear(shares, raw, least=limits.clear)
    reversed_sign = touching & (level < 0.0) & (clear | (level < -limits.dead_level))
    upright = touching & (level > 0.0) & (clear | (level > limits.dead_level))
    faults: list[Fault] = []
    if not present.any():
        faults.append(_fault(FaultKind.NO_SIGNAL))
    elif reversed_sign.any() and not upright.any():
        lifted = signals.varies_more_in_air(shares)
        percent = 100.0 * float(np.median(level[reversed_sign]))
        what = (
            "the sign of the signals is reversed (wiring, bridge), land gives {:.0f} % of the expected moment"
        )
        faults.append(
            _fault(FaultKind.LIFTED) if lifted else _fault(FaultKind.REVERSED, percent, message=what)
        )
    if usual > limits.unit or (usual < limits.dead_level and 2 * clear.sum() > present.sum() > 0):
        faults.append(_fault(FaultKind.UNIT, usual))
    if faults:
        return _CheckedSignals(scan, columns, shares, level, touching, tuple(faults), corrected)
    ratio = np.abs(level) / usual
    other_unit = touching & ((ratio > limits.unit) | (clear & (ratio < limits.dead_level)))
    doubled = signals.doubled_channels(shares)
    for w in np.flatnonzero(reversed_sign):
        faults.append(_fault(FaultKind.REVERSED, 100.0 * level[w], whisker=columns[w]))
    for w in np.flatnonzero(other_unit):
        faults.append(_fault(FaultKind.UNIT, level[w], whisker=columns[w]))
    faults += [_fault(FaultKind.DOUBLED, columns[b], whisker=columns[a]) for a, b in doubled]
    wrong = reversed_sign | other_unit | np.isin(np.arange(level.size), doubled)
    if not doubled:
        order = signals.best_order(
            everywhere, beyond, wrong, least=limits.dead_level, line_pitch_mm=scan.line_pitch_mm,
            least_gain=(1.0 - limits.misfit_left) * limits.misfit,
        )  # fmt: skip
        if order.misfit_now > limits.misfit and order.misfit < limits.misfit_left * order.misfit_now:
            faults.append(_fault(FaultKind.EXCHANGED, order.describe(columns)))
    return _CheckedSignals(scan, columns, shares, level, wrong, tuple(faults), corrected)


def _without_delay(scan: Scan) -> tuple[Scan, tuple[Fault, ...]]:
    if not (late := signals.samples_late(scan)):
        return scan, ()
    way, n = "later" if late > 0 else "earlier", abs(late)
    return signals.in_step(scan, late), (_fault(FaultKind.SHIFTED, way, n, "s" if n > 1 else ""),)


def _flag_saturated(scan: Scan, limits: FaultLimits) -> tuple[Scan, tuple[Fault, ...]]:
    step = float(signals.converter_steps(scan).max())
    if step > limits.coarse:  # equal samples at an end of the range are usual there
        return scan, (_fault(FaultKind.COARSE, 100.0 * step),)
    masks = measures.saturated(scan)
    clipped = np.sum([mask.sum(axis=(0, 2)) for mask in masks], axis=0)
    if not clipped.any():
        return scan, ()
    hit = int(np.count_nonzero(clipped))
    percent = 100.0 * float(clipped.sum()) * clipped.size / (hit * scan.n_samples)
    fault = _fault(FaultKind.SATURATED, percent, hit, clipped.size)
    by_direction = dict(zip(scan.directions, masks, strict=True))
    return add_flags(scan, SampleFlag.SATURATED, by_direction), (fault,)


def _others(values: AnyFloats) -> Iterator[AnyFloats]:
    for w in range(values.size):
        others = np.delete(values, w)
        yield others[np.isfinite(others)]


def _above_others(values: AnyFloats, least: float, limits: FaultLimits) -> AnyFloats:
    usual = np.array([np.median(others) if others.size else np.inf for others in _others(values)])
    return np.where((values > least) & (values > limits.times_others * usual), values, np.nan)


def _blunt(cutoff: AnyFloats, limits: FaultLimits) -> AnyFloats:
    logs, worn = np.log(cutoff), np.full(cutoff.size, np.nan)
    for w, others in enumerate(_others(logs)):
        if others.size < limits.fewest_others:
            continue
        middle = float(np.median(others))
        spread = measures.MAD * float(np.median(np.abs(others - middle)))
        most = limits.alike_blunt if spread < limits.alike else limits.blunt
        if logs[w] - middle < -max(-np.log(most), limits.blunt_spreads * spread):
            worn[w] = np.exp(logs[w] - middle)
    return worn


def _bench_faults(
    scan: Scan, shares: list[SweepShares], level: AnyFloats, limits: FaultLimits
) -> Iterator[Fault]:
    tone = measures.strongest_tone(shares, scan.sample_rate_hz)
    if tone.amplitude > limits.tone and tone.ratio > limits.tone_ratio:
        yield _fault(FaultKind.VIBRATION, 100.0 * tone.amplitude, tone.hz)
        if tone.amplitude > limits.height_margin:
            return  # heights are lost in it
    preload, mus = scan.touch.preload_mm, [scan.touch.friction, *limits.frictions]
    nominal, *others = moment_per_lift(np.arctan(mus), scan.touch.tip)
    land = [ratio for other in others if np.isfinite(ratio := other / nominal)] or [1.0]
    share = float(np.median(level))
    if not min(land) - limits.height_margin < share < max(land) + limits.height_margin:
        way = "high" if share < 1.0 else "low"
        yield _fault(FaultKind.HEIGHT, 100.0 * share, abs(share - 1.0) * preload, way)
    kinds = (FaultKind.TILTED, limits.rise), (FaultKind.BOWED, limits.sag)
    for (kind, limit), both in zip(kinds, measures.plate_form(shares, preload), strict=True):
        mm, axis = max(zip(map(abs, both), "xy", strict=True), key=itemgetter(0))
        if mm > limit * preload:
            yield _fault(kind, mm, axis, preload)


def flag_faults(scan: Scan, faults: Sequence[Fault], limits: FaultLimits = FaultLimits()) -> Scan:
    """Flag unusable samples: of faulty whiskers, spikes, and tips beyond the part; clipped ones as saturated."""
    useless = (FaultKind.DEAD, FaultKind.NOISY, FaultKind.REVERSED, FaultKind.DOUBLED)
    whiskers = sorted({f.whisker for f in faults if f.kind in useless and f.whisker is not None})
    bad, kinds = np.uint8(SampleFlag.FAULTY), {f.kind for f in faults}
    if FaultKind.SHIFTED in kinds:
        scan = signals.in_step(scan, signals.samples_late(scan))
    if FaultKind.NO_SIGNAL in kinds:
        whiskers += np.flatnonzero(np.asarray(scan.kind) == 0)[signals.without_value(only(scan))].tolist()
    # spikes are sought before tips beyond the part are flagged
    shares = measures.sweep_shares(only(scan)) if FaultKind.SPIKES in kinds else []
    spiked = {f.plan.direction: f.in_time(measures.spikes(f, least=limits.spike)) for f in shares}
    scan = signals.flag_beyond_part(scan, least=limits.dead_level)
    if FaultKind.SATURATED in kinds:
        clipped = _flag_saturated(only(scan), limits)[0].sweeps
        saturated = {s.plan.direction: (s.flags & np.uint8(SampleFlag.SATURATED)) != 0 for s in clipped}
        scan = add_flags(scan, SampleFlag.SATURATED, saturated)
    scan = add_flags(scan, SampleFlag.FAULTY, spiked)
    if whiskers:
        every = np.isin(np.arange(scan.n_whiskers), whiskers)[:, None] * bad
        # a channel without a value has not left the converter's range
        kept = np.where(every, ~np.uint8(SampleFlag.OUT_OF_RANGE), np.uint8(0xFF))
        scan = replace(scan, sweeps=tuple(replace(s, flags=s.flags & kept | every) for s in scan.sweeps))
    return scan
