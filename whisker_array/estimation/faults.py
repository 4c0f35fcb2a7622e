"""Worn and wrong: what a recording says is the matter with whiskers and bench, by name, and what to do about it.

fault_measures --limits, and the other whiskers--> faults --left_out--> the recording without what cannot be used

A whisker is compared with the others of its array: they meet the same part. What all of them share is the bench's.
Limits stand well above what sound sensors, dies, plates and dirt do in simulated recordings of an exam's parts; that of
a worn tip was set on the same recordings on which its false alarms are counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from whisker_array.estimation import fault_measures as measures
from whisker_array.estimation.estimate import moment_per_lift
from whisker_array.estimation.fault_measures import Felt, Floats
from whisker_array.scan.scan import Scan
from whisker_array.scan.scan import only as of_kind
from whisker_array.whisker.touch import Touch

Mask = NDArray[np.bool_]

DEAD_LEVEL = 0.2
"""Of the land's moment: a whisker that gives less does not feel it."""
NOISY_AIR, NOISY_LAND = 0.01, 0.03
"""Noise of a sample, share of the land's moment, lifted and touching."""
LOOSE_STEP = 0.02
"""From one pass to the next."""
TIMES_OTHERS = 4.0
"""What a whisker's own noise and steps are above those of the others."""
BENT_GAIN = 0.15
"""Off the others: five standard deviations of usual gains."""
BLUNT, BLUNT_SPREADS, FEWEST_OTHERS = 0.45, 5.0, 3
"""Share of what the others feel of marks, and the others' spreads below it: marks are not alike under all whiskers."""
ALIKE, ALIKE_BLUNT = 0.01, 0.8
"""Spread on a test piece with grooves across all whiskers, and the share that is enough there."""
HEIGHT_MARGIN = 0.2
"""Of the land's moment, beyond what friction may make of it."""
FRICTIONS = (0.05, 0.6)
TILTED_RISE, BOWED_SAG = 0.25, 0.15
"""Of the preload, over what was felt."""
TONE_AMPLITUDE, TONE_RATIO = 0.008, 12.0
SPIKE, FEW_SPIKES = 0.05, 12
"""Of the land's moment; on bare land and in the air, where there is nothing to be felt."""


class FaultKind(StrEnum):
    """What may be the matter."""

    DEAD = "dead whisker"
    NOISY = "noisy whisker"
    LOOSE = "loose clamp"
    BENT = "bent whisker"
    WORN = "worn tip"
    HEIGHT = "wrong height"
    TILTED = "tilted plate"
    BOWED = "bowed plate"
    VIBRATION = "vibration"
    SPIKES = "spikes"

    @property
    def hint(self) -> str:
        """What to do about it."""
        return _HINTS[self]


_HINTS = {
    FaultKind.DEAD: "see whether it is broken, then to its gauge and wire",
    FaultKind.NOISY: "see to its plug, solder joints and screen",
    FaultKind.LOOSE: "tighten its clamp",
    FaultKind.BENT: "straighten or replace it, then calibrate",
    FaultKind.WORN: "look at its tip under a glass, grind or replace it",
    FaultKind.HEIGHT: "set the stage to the height that the whisker file says, then calibrate",
    FaultKind.TILTED: "seat the part flat, clean its rests",
    FaultKind.BOWED: "clamp the part flat; a round part needs a stage that follows it",
    FaultKind.VIBRATION: "stop the machine that shakes the bench, or see to mains hum in the amplifier",
    FaultKind.SPIKES: "keep the signal wires away from motors and relays, screen and earth them",
}
UNUSABLE = (FaultKind.DEAD, FaultKind.NOISY)
"""Of these nothing can be used."""


@dataclass(frozen=True)
class Fault:
    """One thing that is the matter.

    Attributes:
        kind: what.
        text: with its size and place, and what to do.
        whisker: which one, from 0; None where it is the bench's.
    """

    kind: FaultKind
    text: str
    whisker: int | None = None


def find_faults(scan: Scan) -> tuple[Fault, ...]:
    """What a recording shows to be wrong; nothing for a sound one.

    Of a mixed array the first kind of whisker is looked at. Wear that all tips share, and gains that were set on this
    very land, leave no mark here: `calibrate` hides a wrong height and bent whiskers of a recording in volts.

    Args:
        scan: raw or calibrated.
    """
    columns = np.flatnonzero(np.asarray(scan.kind) == 0)
    if all(s.plan.pushed for s in scan.sweeps):
        return ()
    scan = of_kind(scan)
    felt = measures.felt_shares(scan)
    level = measures.levels(felt)
    touching = np.isfinite(level)
    if not touching.any():
        return ()
    dead = touching & (np.abs(level) < DEAD_LEVEL)
    if dead.sum() > 0.5 * touching.sum():
        share = 100.0 * float(np.median(level[touching]))
        return (_bench(FaultKind.HEIGHT, f"the whiskers hardly touch, {share:.0f} % of the moment of land"),)
    noisy = _noisy(felt, dead)
    good = touching & ~dead
    good[list(noisy)] = False
    found: list[tuple[FaultKind, dict[int, float], str]] = [
        (FaultKind.DEAD, _values(level, dead), "gives {:.0f} % of the moment of land"),
        (FaultKind.NOISY, noisy, "its noise is {:.1f} % of the moment of land"),
    ]
    bench: list[Fault] = []
    if good.any():
        sound = _of_whiskers(felt, good)
        n_spikes = spikes_on_land(sound)
        if n_spikes >= FEW_SPIKES:
            sound = [
                replace(f, share=np.where(measures.spikes(f, least=SPIKE), np.nan, f.share)) for f in sound
            ]
        loose = _above_others(measures.wander(sound), LOOSE_STEP)
        firm = good.copy()
        firm[list(loose)] = False
        gain = measures.gains(_of_whiskers(sound, firm))
        gain /= np.nanmedian(gain) if np.isfinite(gain).any() else 1.0
        bent = _values(gain, np.abs(gain - 1.0) > BENT_GAIN)
        firm[list(bent)] = False
        blunt = _blunt(measures.edges_kept(_of_whiskers(sound, firm), line_pitch_mm=scan.line_pitch_mm))
        found += [
            (FaultKind.LOOSE, loose, "its level on land jumps by {:.1f} % from pass to pass"),
            (FaultKind.BENT, bent, "gives {:.0f} % of what the others give where they meet"),
            (FaultKind.WORN, blunt, "marks are {:.0f} % as deep and sharp as under the others"),
        ]
        bench = _of_the_bench(scan, sound, level[good])
        if n_spikes >= FEW_SPIKES:
            what = f"{n_spikes} single samples stand out where nothing is to be felt"
            bench.append(_bench(FaultKind.SPIKES, what))
    return (
        *(
            Fault(
                kind,
                _words(f"whisker {columns[w]}, {kind.value}", words.format(100.0 * value), kind),
                int(columns[w]),
            )
            for kind, values, words in found
            for w, value in values.items()
        ),
        *bench,
    )


def _words(name: str, what: str, kind: FaultKind) -> str:
    return f"{name}: {what} ({kind.hint})"


def _bench(kind: FaultKind, what: str) -> Fault:
    return Fault(kind, _words(kind.value, what, kind))


def _values(values: Floats, chosen: Mask) -> dict[int, float]:
    return {int(w): float(values[w]) for w in np.flatnonzero(chosen)}


def _of_whiskers(felt: list[Felt], good: Mask) -> list[Felt]:
    """What these whiskers felt, the others unknown."""
    keep = good[:, None]
    return [Felt(f.sweep, np.where(keep, f.share, np.nan), np.where(keep, f.air, np.nan)) for f in felt]


def _noisy(felt: list[Felt], dead: Mask) -> dict[int, float]:
    """Noise of whiskers that have much more than the others, lifted or touching."""
    found: dict[int, float] = {}
    for rms, least in zip(measures.noises(felt), (NOISY_AIR, NOISY_LAND), strict=True):
        rms = np.where(dead, np.nan, rms)
        found |= {w: max(v, found.get(w, 0.0)) for w, v in _above_others(rms, least).items()}
    return found


def _blunt(kept: Floats) -> dict[int, float]:
    """Whiskers that feel less of marks than the others do, by more than the others differ."""
    found = {}
    logs = np.log(kept)
    for w in np.flatnonzero(np.isfinite(logs)):
        others = np.delete(logs, w)
        others = others[np.isfinite(others)]
        if others.size < FEWEST_OTHERS:
            continue
        middle = float(np.median(others))
        spread = measures.MAD * float(np.median(np.abs(others - middle)))
        most = ALIKE_BLUNT if spread < ALIKE else BLUNT
        if logs[w] - middle < -max(-np.log(most), BLUNT_SPREADS * spread):
            found[int(w)] = float(np.exp(logs[w] - middle))
    return found


def _above_others(values: Floats, least: float) -> dict[int, float]:
    """Whiskers above a limit and above the others."""
    found = {}
    for w in np.flatnonzero(values > least):
        others = np.delete(values, w)
        others = others[np.isfinite(others)]
        if others.size and values[w] > TIMES_OTHERS * float(np.median(others)):
            found[int(w)] = float(values[w])
    return found


def _of_the_bench(scan: Scan, felt: list[Felt], level: Floats) -> list[Fault]:
    found, preload = [], scan.touch.preload_mm
    low, high = _land_range(scan.touch)
    share = float(np.median(level))
    if not low - HEIGHT_MARGIN < share < high + HEIGHT_MARGIN:
        off, way = abs(share - 1.0) * preload, "high" if share < 1.0 else "low"
        what = f"land gives {100.0 * share:.0f} % of its moment, the stage is about {off:.2f} mm too {way}"
        found.append(_bench(FaultKind.HEIGHT, what))
    form = measures.plate_form(felt, preload)
    rises, sags = (form.rise_x_mm, form.rise_y_mm), (form.sag_x_mm, form.sag_y_mm)
    for kind, both, limit, words in (
        (FaultKind.TILTED, rises, TILTED_RISE, "it rises by"),
        (FaultKind.BOWED, sags, BOWED_SAG, "its middle stands off by"),
    ):
        axis, mm = max(zip("xy", map(abs, both), strict=True), key=lambda pair: pair[1])
        if mm > limit * preload:
            found.append(_bench(kind, f"{words} {mm:.2f} mm along {axis}, the preload is {preload:.2f} mm"))
    tone = measures.tone(felt, scan.sample_rate_hz)
    if tone.amplitude > TONE_AMPLITUDE and tone.ratio > TONE_RATIO:
        swing = f"all whiskers swing by {100.0 * tone.amplitude:.1f} % at {tone.hz:.0f} Hz"
        found.append(_bench(FaultKind.VIBRATION, swing))
    return found


def spikes_on_land(felt: list[Felt]) -> int:
    """Spikes in lead-ins and lead-outs, and in the air."""
    count = 0
    for f in felt:
        lead = f.sweep.plan.n_lead
        at = measures.spikes(f, least=SPIKE)
        count += int(at[..., :lead].sum() + at[..., at.shape[2] - lead :].sum()) if lead else 0
        count += int((np.abs(f.air) > SPIKE).sum())
    return count


def _land_range(touch: Touch) -> tuple[float, float]:
    """What friction may make of the land's moment, as a share of the nominal one."""
    nominal = float(moment_per_lift(np.arctan(touch.friction), touch.tip))
    ends = [float(moment_per_lift(np.arctan(mu), touch.tip)) / nominal for mu in FRICTIONS]
    ends = [v for v in ends if np.isfinite(v)] or [1.0]
    return min(ends), max(ends)
