"""Unknowns of a whisker and its bench: names, units, nominal values and prior standard deviations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from glyphs.ranges import freeze_arrays
from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch


class Unknown(StrEnum):
    """A number to identify, except gains; `sd` is its prior, relative for radius and preload."""

    sd: float

    def __new__(cls, name: str, sd: float = 0.0) -> Unknown:
        member = str.__new__(cls, name)
        member._value_, member.sd = name, sd
        return member

    L1 = "l1_mm", 0.1
    L2 = "l2_mm", 0.1
    L3 = "l3_mm", 0.1
    BETA = "beta_deg", 1.5
    STIFFNESS = "stiffness", 0.05
    RADIUS = "tip_radius_mm", 0.2
    PRELOAD = "preload_mm", 0.05
    FRICTION = "friction", 0.1
    PLAY = "play_mm", 0.03
    SHIFT_X = "shift_x_mm", 0.2
    SHIFT_Y = "shift_y_mm", 0.2
    YAW = "yaw_deg", 0.2
    TILT_X = "tilt_x_mrad", 2.0
    TILT_Y = "tilt_y_mrad", 2.0


DRAWN = (Unknown.L1, Unknown.L2, Unknown.L3, Unknown.BETA, Unknown.STIFFNESS)
"""Unknowns of the whisker itself, fixed by its manufacture."""
LOOSE_GAIN, BENCH_GAIN = 0.03, 0.005
"""Standard deviation of an uncalibrated gain, and of one calibrated by a weight on the tip."""
GROUND_TIP, WORN_TIP = Unknown.RADIUS.sd, 0.6
"""Relative standard deviation of a tip's radius, freshly ground and after long use."""


@dataclass(frozen=True, eq=False, repr=False)
class Bench(OneLine):
    """A whisker and its bench: the value of every `Unknown`, and the gain, raw signal per moment, of each whisker."""

    values: Mapping[Unknown, float]
    gain: Floats

    def __post_init__(self) -> None:
        missing = [name for name in Unknown if name not in self.values]
        if missing or not all(math.isfinite(value) for value in self.values.values()):
            raise WhiskerError(f"a bench needs a finite number for each of {', '.join(Unknown)}")
        object.__setattr__(self, "values", {name: float(self.values[name]) for name in Unknown})
        freeze_arrays(WhiskerError, self, {"gain": ("whiskers",)})

    def __getitem__(self, name: Unknown) -> float:
        return self.values[name]

    def with_values(self, **changed: float) -> Bench:
        return replace(self, values={**self.values, **{Unknown(name): v for name, v in changed.items()}})

    def vector(self) -> Floats:
        """All numbers in the order of `Unknown`, then the gains."""
        return np.array([*self.values.values(), *self.gain])

    @classmethod
    def of_vector(cls, numbers: Floats) -> Bench:
        return cls(dict(zip(Unknown, map(float, numbers), strict=False)), numbers[len(Unknown) :])

    def moved(self, step: Floats) -> Bench:
        """Return the bench with a step (n,) added to its numbers, in the order of `vector`. Stiffness and gains change
        as factors; radius and friction decrease in proportion, so that they stay positive."""
        numbers, names = self.vector(), list(Unknown)
        there = numbers + step
        factor = np.zeros(step.size, dtype=np.bool_)
        factor[[names.index(Unknown.STIFFNESS), *range(len(names), len(names) + self.gain.size)]] = True
        less = [names.index(name) for name in (Unknown.RADIUS, Unknown.FRICTION)]
        factor[less] = (step[less] < 0.0) & (numbers[less] > 0.0)
        there[factor] = numbers[factor] * np.exp(step[factor] / numbers[factor])
        return Bench.of_vector(there)

    def touch(self, nominal: LShaped | Touch) -> Touch:
        """Return the touch of the whisker, or of another without a drawing, with these numbers. Raises WhiskerError."""
        use: dict[str, Any] = {
            str(name): self[name] for name in (Unknown.PRELOAD, Unknown.RADIUS, Unknown.FRICTION)
        }
        if isinstance(nominal, Touch):
            return replace(nominal, **use)
        whisker = self.whisker(nominal)
        return Touch(tip=whisker.tip_model(), whisker=whisker.describe(), **use)

    def whisker(self, nominal: LShaped) -> LShaped:
        """Return the drawn whisker with these lengths and angle. Raises WhiskerError for an impossible number."""
        material = nominal.material
        factor = self[Unknown.STIFFNESS]
        if factor != 1.0:
            material = replace(material, name=f"{material.name} as found", e_mpa=material.e_mpa * factor)
        return replace(
            nominal,
            l1_mm=self[Unknown.L1],
            l2_mm=self[Unknown.L2],
            l3_mm=self[Unknown.L3],
            beta_rad=math.radians(self[Unknown.BETA]),
            material=material,
        )


def nominal_bench(whisker: LShaped | Touch, touch: Touch, *, n_whiskers: int) -> Bench:
    """Return the nominal bench: no play, no tilt, no shift of the piece, gains of 1. Raises WhiskerError."""
    if isinstance(whisker, LShaped) and whisker.is_straight:
        raise WhiskerError(
            "only an L-shaped whisker can be identified", hint="give the drawing of an L-shaped whisker"
        )
    values = dict.fromkeys(Unknown, 0.0) | {
        Unknown.STIFFNESS: 1.0,
        Unknown.RADIUS: touch.tip_radius_mm,
        Unknown.PRELOAD: touch.preload_mm,
        Unknown.FRICTION: touch.friction,
    }
    if isinstance(whisker, LShaped):
        beta_deg = math.degrees(whisker.beta_rad)
        drawn = (whisker.l1_mm, whisker.l2_mm, whisker.lowered_mm, beta_deg)
        values |= zip(DRAWN, drawn, strict=False)
    return Bench(values, np.ones(n_whiskers))


def first_order_sd(moved: Callable[[int, float], float], steps: Floats, covariance: Floats) -> float:
    """Standard deviation sqrt(g^T C g), with central differences g; a number with a step of 0 counts as exact."""
    slope = np.array(
        [(moved(i, s) - moved(i, -s)) / (2.0 * s) if s > 0.0 else 0.0 for i, s in enumerate(steps.tolist())]
    )
    return float(np.sqrt(slope @ covariance @ slope))


def prior_sd(nominal: Bench, *, gain_sd: float = LOOSE_GAIN, tip_sd: float = GROUND_TIP) -> Floats:
    """Prior standard deviation of every number, in the order of `Bench.vector`.

    They assume lengths measured by a caliper (0.1 mm), an angle set by a jig (1.5 degrees), wire as sold (5 % of
    stiffness), a tip as ground (20 %), a preload set by a feeler gauge (5 %), friction of steel on steel (0.1), the
    play of a usual stage (0.03 mm), and a piece placed by hand.
    """
    sd = {name: name.sd for name in Unknown}
    sd[Unknown.RADIUS] = max(tip_sd * nominal[Unknown.RADIUS], 0.005)
    sd[Unknown.PRELOAD] *= nominal[Unknown.PRELOAD]
    return np.array([*(sd[name] for name in Unknown), *np.full(nominal.gain.size, gain_sd)])
