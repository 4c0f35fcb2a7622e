"""Rules that a mark's depth, burr and size must meet. A reading whose mark breaks one goes to review.

A rule has a built-in name, or is written out with its depth windows and other limits::

    press-7=0.05:0.15@0.8:2 0.15:0.3@2.5:4 burr=0.05 height=1.6
    name    least:most depth@heights, mm   most burr least print size

`0.2:` has no greatest depth, `:0.3` no least one; a window without heights is for all. Depths and heights are
measured by touch (`recognition.marks.depth`), within a few hundredths of a millimetre and five per cent.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from glyphs.errors import MarksError
from glyphs.surface.display import OneLine

INCH_MM = 25.4


class DepthRuleError(MarksError, ValueError):
    """An unknown or invalid rule."""


@dataclass(frozen=True)
class DepthWindow:
    """Allowed depths below the flat surface, everywhere along every character, of characters of some height."""

    least_mm: float
    most_mm: float = math.inf
    heights_mm: tuple[float, float] = (0.0, math.inf)

    def __post_init__(self) -> None:
        unlimited = self.least_mm == 0.0 and math.isinf(self.most_mm)
        if unlimited or not 0.0 <= self.least_mm < self.most_mm:
            raise DepthRuleError(
                f"a depth window reaches from {self.least_mm} to {self.most_mm} mm",
                hint="give a least or a greatest depth; the least is not negative, and below the greatest",
            )
        low, high = self.heights_mm
        if not 0.0 <= low < high:
            raise DepthRuleError(
                f"a depth window is for heights from {low} to {high} mm",
                hint="the least height is not negative, and below the greatest",
            )

    def is_for(self, height_mm: float, *, tolerance: float = 0.05) -> bool:
        low, high = self.heights_mm
        return low * (1.0 - tolerance) <= height_mm <= high * (1.0 + tolerance)


@dataclass(frozen=True, repr=False)
class DepthRule(OneLine):
    """Limits of depth, burr and size (at the bottom of the marks) that a mark must keep. Raises DepthRuleError."""

    name: str
    windows: tuple[DepthWindow, ...] = ()
    least_height_mm: float = 0.0
    most_burr_mm: float = math.inf
    source: str = ""

    def __post_init__(self) -> None:
        if not (0.0 <= self.least_height_mm < math.inf and self.most_burr_mm > 0.0):
            raise DepthRuleError(
                f"the rule {self.name} asks for {self.least_height_mm} mm of height, {self.most_burr_mm} of burr",
                hint="give positive numbers",
            )
        if not (self.windows or self.least_height_mm or math.isfinite(self.most_burr_mm)):
            raise DepthRuleError(f"the rule {self.name} limits nothing", hint="give a depth: 0.1:0.25")

    def window(self, height_mm: float) -> DepthWindow | None:
        """The depth window for a character height; None if the rule has none."""
        return next((window for window in self.windows if window.is_for(height_mm)), None)


DEPTH_RULES: tuple[DepthRule, ...] = (
    DepthRule(
        "27CFR478.92",
        (DepthWindow(0.003 * INCH_MM),),
        least_height_mm=INCH_MM / 16.0,
        source="27 CFR 478.92(a)(1): serial numbers of firearms, depth .003 inch, print size 1/16 inch",
    ),
    DepthRule(
        "CONTRAN24/98",
        (DepthWindow(0.2),),
        source="CONTRAN, Resolucao 24/98: vehicle identification numbers on the chassis, depth at least 0.2 mm",
    ),
    DepthRule(
        "MIL-STD-792",
        (DepthWindow(0.10, 0.25),),
        source="MIL-STD-792: identification marking of components, depth 0.10 to 0.25 mm",
    ),
    DepthRule(
        "70-16-05",
        (DepthWindow(0.05, 0.15, (0.8, 2.0)), DepthWindow(0.15, 0.30, (2.5, 4.0))),
        source="standard practice 70-16-05 of engine makers: characters 0.8 to 2.0 mm high 0.05 to 0.15 mm deep, "
        "2.5 to 4.0 mm high 0.15 to 0.30 mm deep",
    ),
)
"""The built-in rules, summarised: before you rely on one, check the original, in the edition that binds you. 49 CFR 565
of the United States requires a height of vehicle identification numbers, but no depth."""

_MM = r"(\d+\.?\d*|\.\d+)"
_WORD = re.compile(rf"(burr|height)={_MM}|{_MM}?:{_MM}?(?:@{_MM}?:{_MM}?)?")
_HOW = "write it as press-7=0.05:0.15@0.8:2 burr=0.05 height=1.6, in mm"


def depth_rule(text: str) -> DepthRule:
    """Rule by name, or from text; blanks and case of a name are ignored. Raises DepthRuleError."""
    wanted = "".join(text.split()).upper()
    for rule in DEPTH_RULES:
        if rule.name.upper() == wanted:
            return rule
    if ":" in text or "=" in text:
        return _parse_rule(text)
    known = ", ".join(rule.name for rule in DEPTH_RULES)
    raise DepthRuleError(f"unknown depth rule {text!r}", hint=f"known are {known}; or {_HOW}")


def _parse_rule(text: str) -> DepthRule:
    named = re.fullmatch(r"\s*(?!burr=|height=)([^=\s]+)=(.*)", text)
    name, written = named.groups() if named else ("own rule", text)
    windows, limits = [], {"burr": math.inf, "height": 0.0}
    for word in written.split():
        match = _WORD.fullmatch(word)
        if match is None:
            raise DepthRuleError(f"{word!r} is not a limit of the depth rule {text!r}", hint=_HOW)
        limit, mm, *window = match.groups()
        if limit:
            limits[limit] = float(mm)
            continue
        least, low = (float(number or 0.0) for number in window[::2])
        most, high = (float(number or math.inf) for number in window[1::2])
        windows.append(DepthWindow(least, most, (low, high)))
    return DepthRule(name, tuple(windows), least_height_mm=limits["height"], most_burr_mm=limits["burr"])


def least_depth(min_depth_mm: float) -> DepthRule:
    """Rule with only a least depth. Raises DepthRuleError unless it is positive."""
    return DepthRule("min_depth_mm", (DepthWindow(min_depth_mm),))
