"""Judges of the mark: depth, burr and size under the rules that the user has set."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.depth_rules import DepthRule
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.reading import CharacterReading, mean_depth_mm
from recognition.marks.no_depth import NoDepth


def depth_rules(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report every depth rule that the felt mark breaks."""
    if choice.characters and choice.sense is evidence.touch:
        for rule in settings.depth_rules:
            yield from violations(rule, choice.characters, choice.height_mm)


def violations(
    rule: DepthRule, characters: Sequence[CharacterReading], height_mm: float
) -> Iterator[Finding]:
    """Return the limits that a mark breaks; a limit that could not be measured counts as broken."""
    window = rule.window(height_mm)
    if window is None and rule.windows:
        known = ", ".join(f"{w.heights_mm[0]:g} to {w.heights_mm[1]:g}" for w in rule.windows)
        yield Finding(
            ReadingFlag.NO_DEPTH_RULE,
            f"{rule.name} has no depth for characters {height_mm:.2f} mm high (only for {known} mm)",
        )
    least, most = (0.0, math.inf) if window is None else (window.least_mm, window.most_mm)
    rim = rule.most_burr_mm
    felt = {k: c.depth for k, c in enumerate(characters, start=1) if c.depth is not None}
    burrs = {k: depth.burr_mm for k, depth in felt.items() if depth.burr_mm is not None}

    # depths are compared without their known error. The message gives their standard deviation, which moves no limit:
    # it is wide even on a clean plate, and a guard band of one deviation refuses good marks.
    def words(k: int, mm: float) -> str:
        sd_mm = felt[k].sd_mm
        return f" {mm:.3f} mm" if sd_mm is None else f" {mm:.3f} +- {sd_mm:.3f} mm"

    shallow = {k: words(k, mm) for k, d in felt.items() if (mm := d.min_mm - d.bias_mm) < least}
    deep = {k: words(k, mm) for k, d in felt.items() if (mm := d.max_mm - d.bias_mm) > most}
    high = {k: f" {mm:.3f} mm" for k, mm in burrs.items() if mm > rim}
    lacking: dict[str, dict[int, str]] = {}
    unsized = rule.least_height_mm > 0.0 and not felt
    for k, c in enumerate(characters, start=1):
        without = c.depth is None and (window is not None or unsized)
        if without or (math.isfinite(rim) and k not in burrs):
            lacking.setdefault((c.no_depth or NoDepth.NOT_FELT).message, {})[k] = ""
    for flag, what, places, hint in (
        (ReadingFlag.TOO_SHALLOW, "too shallow", shallow, f"at least {least:g}"),
        (ReadingFlag.TOO_DEEP, "too deep", deep, f"at most {most:g}"),
        (ReadingFlag.BURR_TOO_HIGH, "burr too high", high, f"at most {rim:g}"),
        *(
            (ReadingFlag.DEPTH_UNKNOWN, "depth not measured", places, todo)
            for todo, places in lacking.items()
        ),
    ):
        if places:
            where = [f"{characters[k - 1].char} at place {k}{mm}" for k, mm in places.items()]
            yield Finding(flag, f"{what} for {rule.name}: {', '.join(where)} ({hint})", tuple(places))
    size = print_size_mm(characters, height_mm)
    if size < rule.least_height_mm:
        yield Finding(
            ReadingFlag.TOO_SMALL,
            f"too small for {rule.name}: about {size:.2f} mm high at the bottoms (at least {rule.least_height_mm:g})",
        )


def print_size_mm(
    characters: Sequence[CharacterReading], height_mm: float, *, wall_bevel_deg: float = 45.0
) -> float:
    """Height of the characters between the ends of their bottoms, as 27 CFR 478.92 measures it."""
    # the height that was read is at the surface, where walls of 45 degrees add one depth at either end
    wall = (mean_depth_mm(characters) or 0.0) / math.tan(math.radians(wall_bevel_deg))
    return height_mm - 2.0 * wall
