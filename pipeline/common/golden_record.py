"""Measures of the whiskers on a golden part, and their changes since the whiskers were new."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum


class GoldenMeasure(StrEnum):
    """A measured quantity, with its unit."""

    GAIN = "gain"
    ZERO = "zero_lands"
    RADIUS = "tip_radius_mm"
    FRICTION = "friction"
    PRELOAD = "preload_mm"


@dataclass(frozen=True)
class Measured:
    """A number and its standard deviation."""

    value: float
    sd: float


@dataclass(frozen=True)
class GoldenRecord:
    """One scan of the golden part; later ones are compared with the `reference`.

    Among the measures, the gain is the mean over the whiskers, the zero that of the whisker with the largest mean
    signal in air, relative to the land's moment.
    """

    at: datetime
    line: str
    reference: bool
    measures: Mapping[GoldenMeasure, Measured]


@dataclass(frozen=True)
class _Limit:
    by: float
    relative: bool
    what: str
    todo: str


_LIMITS = {
    GoldenMeasure.GAIN: _Limit(
        0.05, True, "the signal is {now:.2f} times what it should be, {then:.2f} before",
        "look for a loose clamp or a bent whisker, then calibrate",
    ),
    GoldenMeasure.ZERO: _Limit(
        0.05, False, "the zero has moved by {off:.1%} of the land's moment",
        "let the amplifier warm up, then calibrate",
    ),
    GoldenMeasure.RADIUS: _Limit(
        0.5, True, "the tips are worn: radius {now:.3f} mm, {then:.3f} before", "change the whiskers",
    ),
    GoldenMeasure.FRICTION: _Limit(
        0.1, False, "friction is {now:.2f}, {then:.2f} before", "clean the golden part and the tips",
    ),
    GoldenMeasure.PRELOAD: _Limit(
        0.1, True, "the tips run {now:.2f} mm below the land, {then:.2f} before", "set the stage's height",
    ),
}  # fmt: skip
SIGMAS = 2.0  # standard deviations by which a change must exceed its limit; a smaller excess may be chance


def wear_messages(now: GoldenRecord, reference: GoldenRecord) -> tuple[str, ...]:
    """Changes beyond their limits, each with a remedy; empty if there are none."""
    faults = []
    for name, limit in _LIMITS.items():
        if name not in now.measures or name not in reference.measures:
            continue
        here, then = now.measures[name], reference.measures[name]
        off, sd = here.value - then.value, (here.sd**2 + then.sd**2) ** 0.5
        if abs(off) > limit.by * (abs(then.value) if limit.relative else 1.0) + SIGMAS * sd:
            faults.append(f"{limit.what.format(now=here.value, then=then.value, off=abs(off))}; {limit.todo}")
    return tuple(faults)
