"""Settings of a reader, and the characters that they allow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypedDict

import numpy as np

from glyphs.fonts.glyph import Font, FontError
from glyphs.fonts.outlines import load_font
from glyphs.fonts.serials import SIGNS, FormatError
from glyphs.surface.display import OneLine
from recognition.decide.decision import CertifiedAcceptance
from recognition.decide.depth_rules import DepthRule
from recognition.decide.risk import least_score, require_kept, risk_of
from recognition.decide.risk_text import check_risk
from recognition.find.region import Region, check_region
from recognition.find.request import LineFormat, LineRequest
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.steps import EXPERTS
from recognition.see.virtual_array import USUAL_ARRAY, VirtualArray

STAND_INS = ("gothic", "futuram", "timesr")
"""Built-in fonts that stand in for an unnamed one: depths are measured along their strokes."""


class ReaderOptions(TypedDict, total=False):
    """The fields of `ReaderSettings`, as keywords of a reader."""

    fonts: Sequence[str | Font]
    format: str | Grammar | None
    height_mm: float | None
    array: VirtualArray
    accept_risk: float | None
    depth_rules: tuple[DepthRule, ...]
    experts: tuple[str, ...]
    region: Region | None
    lines: Mapping[str, str | LineFormat]
    certified: CertifiedAcceptance | None
    orientation: Orientation
    limit_s: float | None


@dataclass(frozen=True, repr=False)
class ReaderSettings(OneLine):
    """Settings of a reader. Raises FormatError, MarksError or ValueError.

    Attributes:
        fonts: the part's fonts, names of built-in ones or paths of TTF/OTF files, if known.
        format: the serial's, as for the command (AA999999, re:, sets:, vin, check:), or a grammar; None if unknown.
        accept_risk: greatest share of wrong readings among those accepted (default: 1 in 1,000; a sense that was not
            shown to keep it accepts at the least risk that it keeps).
        region: area with the middle of the serial's line, in shares of the photograph or scan (default: anywhere).
        orientation: possible orientations of a part; with `ANY`, a serial that also reads upside down goes to review.
        limit_s: seconds after which a sense stops its search (default: no limit); a search cut short accepts no text.
    """

    fonts: Sequence[str | Font] = ()
    format: str | Grammar | None = None
    height_mm: float | None = None
    array: VirtualArray = USUAL_ARRAY
    accept_risk: float | None = None
    depth_rules: tuple[DepthRule, ...] = ()
    experts: tuple[str, ...] = ()
    region: Region | None = None
    lines: Mapping[str, str | LineFormat] | tuple[tuple[str, str | LineFormat], ...] = ()
    certified: CertifiedAcceptance | None = None
    orientation: Orientation = Orientation.ANY
    limit_s: float | None = None

    def __post_init__(self) -> None:
        fonts = (self.fonts,) if isinstance(self.fonts, str) else tuple(self.fonts)
        object.__setattr__(self, "fonts", fonts)
        if self.height_mm is not None and not (np.isfinite(self.height_mm) and self.height_mm > 0.0):
            raise ValueError(f"height_mm is {self.height_mm}; a character height is a positive number of mm")
        if self.limit_s is not None and not self.limit_s > 0.0:
            raise ValueError(f"limit_s is {self.limit_s}; a time limit is a positive number of seconds")
        if self.accept_risk is not None:
            require_kept(check_risk(self.accept_risk))
        check_region(self.region)
        object.__setattr__(self, "orientation", Orientation(self.orientation))
        # a tuple of pairs, so that settings can be dictionary keys
        object.__setattr__(self, "lines", tuple(dict(self.lines).items()))
        experts = (self.experts,) if isinstance(self.experts, str) else tuple(self.experts)
        object.__setattr__(self, "experts", experts or EXPERTS)
        unknown = sorted({*experts} - {*EXPERTS})
        if unknown:
            raise ValueError(f"there is no expert {', '.join(unknown)}; there are {', '.join(EXPERTS)}")
        _ = self.grammar, self.line_formats

    @property
    def faces_judge(self) -> bool:
        return set(self.experts) == set(EXPERTS)

    def risk_of(self, source: str) -> float:
        return risk_of(source, self.accept_risk)

    def least_score(self, source: str) -> float:
        return least_score(source, self.risk_of(source))

    @cached_property
    def line_formats(self) -> Mapping[str, LineFormat]:
        return {
            name: LineFormat(Grammar.parse(line)) if isinstance(line, str) else line
            for name, line in dict(self.lines).items()
        }

    @cached_property
    def grammar(self) -> Grammar | None:
        if not isinstance(self.format, str):
            return self.format
        if not self.format.strip():
            raise FormatError(
                f"the format {self.format!r} is blank",
                hint="write one character for each position: A, 9, * or the character itself",
            )
        return Grammar.parse(self.format)


class Repertoire:
    """The fonts of a reader, and its search for lines."""

    def __init__(self, settings: ReaderSettings) -> None:
        named = settings.fonts or STAND_INS
        self.fonts = tuple(font if isinstance(font, Font) else load_font(font) for font in named)
        known = {font.name for font in self.fonts}
        self.stand_ins = tuple(font for font in map(load_font, STAND_INS) if font.name not in known)
        self.named = self.fonts if settings.fonts else ()
        self._settings = settings
        places = None if settings.grammar is None else settings.grammar.fixed_places
        for font in self.named:
            lacks = next((chars for chars in places or () if not set(chars) & set(font.glyphs)), "")
            if lacks:
                format = settings.format if isinstance(settings.format, str) else str(settings.grammar)
                raise FontError(f"font {font.name!r} has no {lacks!r}, which the format {format!r} needs")

    @cached_property
    def request(self) -> LineRequest:
        settings = self._settings
        others = {char for line in settings.line_formats.values() for char in line.grammar.characters}
        # characters that the format forbids are searched for as well, so that one on the part is noticed
        allowed = SIGNS if settings.grammar is None else settings.grammar.characters
        return LineRequest(
            settings.grammar,
            "".join(sorted({*ALPHANUMERIC, *others, *allowed})),
            height_mm=settings.height_mm,
            region=settings.region,
            orientation=settings.orientation,
            lines=settings.line_formats,
        )
