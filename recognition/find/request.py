"""What to look for on a part: characters, formats and regions of its lines, and the limits of the search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from glyphs.fonts.glyph import Font
from glyphs.fonts.serials import SIGNS
from recognition.find.region import Region, check_region
from recognition.find.template_fonts import TemplateFonts
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation


@dataclass(frozen=True)
class LineFormat:
    """A line that a part has besides its serial.

    Attributes:
        grammar: format of the line.
        region: region that contains its middle (default: anywhere).

    Raises:
        ValueError: an invalid region.
    """

    grammar: Grammar
    region: Region | None = None

    def __post_init__(self) -> None:
        check_region(self.region)


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """Limits of a search: number of lines, and the promise at which it stops.

    Attributes:
        most_lines: lines that are read, most promising first.
        most_turned: lines that are also read upside down, or running down or up.
        most_refined: lines that are refined if they are not convincing.
        plain: share of the greatest promise from which the whole view and upside-down lines are not searched.
        sure: share of the greatest promise from which a line is convincing, and fainter lines are not searched.
        some: share of the greatest promise from which rotated and small lines are not searched.
        settled: share of the greatest promise above which a line is not refitted to its ink.
        hopeless: promise per place below which a line is not refined. Of 90 photographs of the calibration design 39
            searches ended below it; refining gave one of these a text, which was wrong.
        clear_heights: finder's score from which a line is not clutter, and much smaller ones are not searched. On 24
            cluttered frames the clutter reached 1.1.
        most_refits: most refits of a line to its ink.
        chance_gain: least promise that a line must gain by being bent or read at another width, nats: of two readings
            the wrong one is often a little more promising by chance.
        rewidened: ratio of the usual and the fitting width of a strip from which a doubtful line is read at both.
        narrowest: advance below which a line probably crosses its characters; the narrowest of 494 faces has 0.38.
        most_looks: most runs of the recogniser for a part (default: no limit).
        limit_s: seconds after which no line is read any more (default: no limit).
    """

    most_lines: int = 6
    most_turned: int = 3
    most_refined: int = 2
    plain: float = 0.9
    sure: float = 0.7
    some: float = 0.4
    settled: float = 0.9975
    hopeless: float = -1.0
    clear_heights: float = 1.2
    most_refits: int = 3
    chance_gain: float = 1.0
    rewidened: float = 1.3
    narrowest: float = 0.32
    most_looks: int | None = None
    limit_s: float | None = None


@dataclass(frozen=True)
class LineRequest:
    """Lines that are looked for, and what is known of the part.

    Attributes:
        grammar: format of the serial's line.
        chars: characters to search for.
        height_mm: height of the characters, if known.
        region: region that holds the middle of the serial's line (default: the whole view).
        orientation: possible orientations of the parts.
        rows_known: whether the order of a map's rows is known; of a photograph it is.
        lines: other lines of the part, by name.
        limits: limits of the search.
        templates: fonts whose templates find and read lines, in place of the networks.
    """

    grammar: Grammar | None
    chars: str
    height_mm: float | None = None
    region: Region | None = None
    orientation: Orientation = Orientation.ANY
    rows_known: bool = True
    lines: Mapping[str, LineFormat] = field(default_factory=dict)
    limits: SearchLimits = SearchLimits()
    templates: TemplateFonts | None = None

    @property
    def rare(self) -> str:
        """Signs that are rare on parts; none if there is a format."""
        return SIGNS if self.grammar is None else ""

    def chars_of(self, font: Font) -> str:
        """Characters to search for that a font has."""
        return "".join(c for c in self.chars if c in font.glyphs)
