"""Rules that a mark's depth and size must meet, and what a reading is told by them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from glyphs.errors import MarksError
from recognition.decision.reading import CharacterReading, Reading, ReadingFlag

INCH_MM = 25.4
WALL_BEVEL_DEG = 45.0
"""Slope of a stamp's walls: a mark is smaller at its bottom than at the surface by one wall at either end."""


class DepthRuleError(MarksError, ValueError):
    """A rule that is not known, or that cannot be one."""


@dataclass(frozen=True)
class DepthRule:
    """What a mark must measure at least.

    Attributes:
        name: as it is asked for and told.
        least_depth_mm: everywhere along every character, below the flat surface.
        least_height_mm: print size, of the characters' bottoms; 0 where the rule knows none.
        source: where the rule stands.

    Raises:
        DepthRuleError: measures that are not positive numbers (zero is no print size).
    """

    name: str
    least_depth_mm: float
    least_height_mm: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.least_depth_mm) and self.least_depth_mm > 0.0):
            raise DepthRuleError(
                f"least_depth_mm of {self.name} is {self.least_depth_mm}", hint="it must be positive"
            )
        if not (math.isfinite(self.least_height_mm) and self.least_height_mm >= 0.0):
            raise DepthRuleError(
                f"least_height_mm of {self.name} is {self.least_height_mm}",
                hint="it must be zero or positive",
            )


DEPTH_RULES: tuple[DepthRule, ...] = (
    DepthRule(
        "27CFR478.92",
        least_depth_mm=0.003 * INCH_MM,
        least_height_mm=INCH_MM / 16.0,
        source="27 CFR 478.92(a)(1): serial numbers of firearms, depth .003 inch, print size 1/16 inch",
    ),
)
"""The rules known by name. Vehicle identification numbers have a least depth by no rule listed here: the United
States' 49 CFR 565 asks for a height of 4 mm and no depth; give other rules' depth as a number."""


def depth_rule(name: str) -> DepthRule:
    """The rule of a name; blanks and case do not matter.

    Raises:
        DepthRuleError: none is called so.
    """
    wanted = "".join(name.split()).upper()
    for rule in DEPTH_RULES:
        if rule.name.upper() == wanted:
            return rule
    known = ", ".join(rule.name for rule in DEPTH_RULES)
    raise DepthRuleError(
        f"unknown depth rule {name!r}", hint=f"known are {known}; or give a depth, min_depth_mm"
    )


def least_depth(min_depth_mm: float) -> DepthRule:
    """A rule of one's own that knows a depth only.

    Raises:
        DepthRuleError: not a positive number.
    """
    return DepthRule("min_depth_mm", min_depth_mm)


def judged_by(reading: Reading, rules: Sequence[DepthRule]) -> Reading:
    """The reading with flags and notes for every rule that its mark does not meet; the decision stays."""
    if not reading.characters:
        return reading
    flags, notes = reading.flags, list(reading.notes)
    for rule in rules:
        unknown = [c.char for c in reading.characters if c.depth is None]
        shallow = [c for c in reading.characters if c.depth and c.depth.min_mm < rule.least_depth_mm]
        if shallow:
            flags |= ReadingFlag.TOO_SHALLOW
            measured = ", ".join(_measured(c) for c in shallow)
            notes.append(f"too shallow for {rule.name}: {measured} (at least {rule.least_depth_mm:g})")
        if unknown:
            flags |= ReadingFlag.DEPTH_UNKNOWN
            notes.append(f"depth not measured for {rule.name}: {' '.join(unknown)}")
        size = print_size_mm(reading)
        if size < rule.least_height_mm:
            flags |= ReadingFlag.TOO_SMALL
            notes.append(
                f"too small for {rule.name}: about {size:.2f} mm high at the bottoms "
                f"(at least {rule.least_height_mm:g})"
            )
    return replace(reading, flags=flags, notes=tuple(notes))


def print_size_mm(reading: Reading) -> float:
    """Height of the characters between the ends of their bottoms, as 27 CFR 478.92 measures it.

    The height read is that at the surface, where walls of 45 degrees stand a depth further out at either end.
    """
    wall = (reading.depth_mean_mm or 0.0) / math.tan(math.radians(WALL_BEVEL_DEG))
    return reading.height_mm - 2.0 * max(wall, 0.0)


def _measured(character: CharacterReading) -> str:
    depth = character.depth
    return character.char if depth is None else f"{character.char} {depth.min_mm:.3f} mm"
