"""Lay a text on its line in the best-fitting font and die face, to measure its marks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face
from recognition.glyph_match.felt_line import FeltLine, LaidCharacter
from recognition.glyph_match.pose import TALL, Floats, points_at
from recognition.see.text_line import TextLine

STRUCK_FIT = 0.7
"""Mean correlation with a flat or sharp die below which a dotted one is tried as well."""

LEAST_FIT_OF_BETTER_HALF = 0.88
"""Least `fit_of_better_half` of the part's font. Of 65 lines in 5 fonts, the right one has at least 0.92 on clean parts
and 0.88 at dirt 0.3; at 0.6 half of the lines have less."""


@dataclass(frozen=True, eq=False)
class LaidText:
    """A text laid on its line with the templates of a font."""

    felt: FeltLine
    text: tuple[str, ...]
    font: Font
    face: Face = Face.FLAT

    @cached_property
    def laid(self) -> tuple[LaidCharacter | None, ...]:
        return tuple(
            self.felt.lay(k, char, self.font, self.face) if char in self.font.glyphs else None
            for k, char in enumerate(self.text)
        )

    @cached_property
    def fits(self) -> tuple[float, ...]:
        """Correlation of each character; 0 for one that the font lacks."""
        return tuple(0.0 if mark is None else mark.fit for mark in self.laid)

    @property
    def fit(self) -> float:
        return sum(self.fits) / len(self.text)

    @property
    def fit_of_better_half(self) -> float:
        """Mean correlation of the better half of the characters: dirt spoils a few, a wrong font most of them."""
        return float(np.mean(sorted(self.fits, reverse=True)[: (len(self.text) + 1) // 2]))

    def in_font(self, font: Font) -> LaidText:
        return replace(self, font=font, face=self.face if font.stroke_ratio > 0.0 else Face.FLAT)

    @cached_property
    def height_mm(self) -> float:
        tall = [character.pose[TALL] for character in self.laid if character is not None]
        return self.felt.line.height_mm * float(np.exp(np.median(tall)))

    @property
    def rotation_deg(self) -> float:
        middles = [
            self.points_mm(k, np.zeros((1, 2)))[0]
            for k, character in enumerate(self.laid)
            if character is not None
        ]
        if len(middles) < 2:
            return self.felt.line.turned_deg
        return TextLine(np.array(middles), self.felt.line.height_mm).turned_deg

    def points_mm(self, place: int, points: Floats) -> Floats:
        """(n, 2) x, y of points of the character at a place, from its reference point, character heights."""
        character = self.laid[place]
        assert character is not None
        return self.felt.places_mm(place, points_at(character.pose, points))


def can_be_laid(felt: FeltLine, text: Sequence[str], fonts: Iterable[Font]) -> bool:
    """Whether any font has any of the characters, and the line as many places."""
    return len(text) == felt.columns.size and any(set(text) & set(font.glyphs) for font in fonts)


def laid_text(
    felt: FeltLine,
    text: Sequence[str],
    fonts: Iterable[Font],
    *,
    stand_ins: Iterable[Font] = (),
    # mean correlation by which these must fit better. Of 24 lines of the exam whose true font was named, 19 fit it
    # best, 3 fit another one better by less than this, and 2 by 0.08.
    clearly: float = 0.06,
) -> LaidText | None:
    """Lay a text in the best-fitting font and die face; None unless it can be (`can_be_laid`)."""
    if len(text) != felt.columns.size:
        return None
    least = dict.fromkeys(fonts, 0.0) | dict.fromkeys(stand_ins, clearly)

    def fits(*faces: Face) -> list[tuple[float, LaidText]]:
        return [
            (felt.mean_correlation(text, font, face) - less, LaidText(felt, tuple(text), font, face))
            for font, less in least.items()
            for face in faces
            # strokes of an outline font have their own width: only a flat die is tried
            if set(text) & set(font.glyphs) and (face is Face.FLAT or font.stroke_ratio > 0.0)
        ]

    fits_by_face = fits(Face.FLAT, Face.SHARP)
    suit, laid = max(fits_by_face, key=lambda pair: pair[0], default=(0.0, None))
    if laid is None or suit < STRUCK_FIT or laid.face is Face.SHARP:
        _, laid = max([*fits_by_face, *fits(Face.DOTTED)], key=lambda pair: pair[0], default=(0.0, None))
    return laid
