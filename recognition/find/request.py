"""What to look for on a part: characters, formats and regions of its lines, and the limits of the search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from glyphs.fonts.glyph import Font
from glyphs.fonts.serials import SIGNS
from recognition.find.deadline import Deadline
from recognition.find.region import Region, area_of, check_region, within
from recognition.find.template_fonts import TemplateFonts
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation


@dataclass(frozen=True)
class LineFormat:
    """A line that a part has besides its serial. Raises ValueError for an invalid region."""

    grammar: Grammar
    region: Region | None = None

    def __post_init__(self) -> None:
        check_region(self.region)


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """Limits of a search: its looks, its price, and the promise at which it stops."""

    most_lines: int = 6
    plain: float = 0.9  # share of the greatest promise from which a line is without doubt
    # share of the greatest promise from which a line is convincing, and no other light is looked at
    sure: float = 0.7
    # share of the greatest promise above which a line is not searched for any further
    settled: float = 0.9975
    # least promise that a line must gain by being read at another width, nats: of two readings the wrong one
    # is often a little more promising by chance
    chance_gain: float = 1.0
    # ratio of the usual and the fitting width of a strip from which a doubtful line is read at both
    rewidened: float = 1.5
    # share of the greatest promise below which a line of a photograph is not read at another width: of 572 lines of 280
    # dirty photographs one became more promising than half of the greatest promise by it
    hopeless: float = -1.0
    # advance below which a line probably crosses its characters; the narrowest of 494 faces has 0.38
    narrowest: float = 0.32
    most_looks: int | None = 24
    again_looks: int = 16  # looks of a search about a known line, in another picture of the same photograph
    spared_looks: int = 8
    layout_looks: int = 10
    # price of processor time: expected gain of a try, right characters for each ms, below which it is left
    # out
    least_gain_per_ms: float = 0.002


@dataclass(frozen=True)
class LineRequest:
    """Lines that are looked for, and what is known of the part; `templates` read in place of the networks."""

    grammar: Grammar | None
    chars: str
    height_mm: float | None = None
    region: Region | None = None
    orientation: Orientation = Orientation.ANY
    rows_known: bool = True
    lines: Mapping[str, LineFormat] = field(default_factory=dict)
    limits: SearchLimits = SearchLimits()
    templates: TemplateFonts | None = None
    deadline: Deadline = field(default_factory=Deadline)

    @property
    def rare(self) -> str:
        """Signs that are rare on parts; none if there is a format."""
        return SIGNS if self.grammar is None else ""

    @property
    def area(self) -> Region | None:
        """Area of the view that is searched, with a margin around all regions; None for the whole view."""
        return area_of((self.region, *(line.region for line in self.lines.values())))

    def inside(self, area: Region) -> LineRequest:
        """The request for a picture that shows only this area."""
        lines = {name: replace(line, region=within(line.region, area)) for name, line in self.lines.items()}
        return replace(self, region=within(self.region, area), lines=lines)

    def chars_of(self, font: Font) -> str:
        """Characters to search for that a font has."""
        return "".join(c for c in self.chars if c in font.glyphs)
