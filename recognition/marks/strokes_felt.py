"""Which strokes of a character were felt: of the one that was read, and of its rivals.

    R read, P its rival                             felt    missing
      .--.       P       .--.     R has, P has not     \\     against P, for P
      |__|               |__|     P has, R has not     -     nothing
      |  \\              |

Both are laid over the surface where each lies deepest, in a font that nobody need have named: which strokes tell two
characters apart hardly depends on the font. A piece of a stroke that was felt speaks for who has it. One that was not
felt speaks against it, but never fully: it may be filled, the likelier the more is missing of the line's other
strokes. Where the surface stands above the land, or was not scanned, nothing could be felt, and nothing is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.language.confusions import SWAP_SETS
from recognition.language.lattice import Lattice
from recognition.lines.places import boxes_of, places_mm
from recognition.marks.depth_sampling import DepthField
from recognition.marks.laid_strokes import STEP_HEIGHTS, LaidCharacter, PlacesFelt
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from whisker_array.estimation.relief import Relief

LIVE = 0.004
"""Belief in a rival from which strokes must speak against it."""
_LEAST = 1e-12
FITS, LEAST_FIT, GAIN = 0.6, 0.45, 0.08
"""Mean score of the places from which a line's height is taken as found, that another height must reach, and by how
much it must be better. Of the exam's lines, made half too high, 0.61 at most is left."""
SIZES = (0.66, 0.57, 0.76, 0.87)
"""Heights tried in place of the one found; the first tells whether it is worth while."""
PIECE_HEIGHTS = 0.25
"""Length of a piece of a stroke that is felt or filled as one."""
MISLED = 0.05
"""Chance that a piece seems felt where none is: a scratch, or strokes that run otherwise in the part's font."""
FILLED, FILLED_OF_MISSING = 0.03, 0.8
"""Chance that a piece is filled where nothing of the line is missing, and what the line's missing share adds."""
MOST_FILLED = 0.7
MOST_ABSENT = 6.0
"""Nats that all missing pieces of a character together may say against it: absence never speaks fully."""
EDGE_HEIGHTS = 0.15
"""Of a place's box on each side, which may be land: boxes at a line's ends are 0.84 of a height wide, characters 0.5 to
0.7."""
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RivalStrokes:
    """Evidence of strokes against a rival at a place.

    Attributes:
        char: the rival.
        belief: in it without its strokes.
        margin: nats by which strokes speak for the character that was read; negative for the rival.
        apart_heights: length of the strokes that only one of them has.
        more_heights: of these, what only the rival has.
        hidden: share of the latter where nothing could be felt.
    """

    char: str
    belief: float
    margin: float
    apart_heights: float
    more_heights: float
    hidden: float

    @property
    def excluded_nats(self) -> float:
        """Evidence of posterior and strokes together for the character that was read, nats."""
        return self.margin - math.log(max(self.belief, _LEAST))


@dataclass(frozen=True)
class PlaceStrokes:
    """Strokes felt of the character read at a place.

    Attributes:
        felt: share of its strokes that was felt, in the font that suits it best; None where no font has it.
        score: how well its strokes lie in what is deepest there, at most 1.
        font: that one's name.
        rivals: that the format allows and that are live, or declared to be taken for it.
        whole: whether the surface was felt from edge to edge of the character.
        untold: why the lines felt do not tell the character from its rivals; empty where they do.
    """

    felt: float | None
    score: float = 0.0
    font: str = ""
    rivals: tuple[RivalStrokes, ...] = ()
    whole: bool = True
    untold: str = ""


@dataclass(frozen=True, eq=False)
class FeltLine:
    """A line as it was felt: what is asked for the strokes of characters.

    Attributes:
        relief: the surface.
        line: where the text lies.
        columns: of its strip, where the places stand.
        raised: whether its marks stand out.
        fonts: whose strokes may be looked for.
    """

    relief: Relief
    line: TextLine
    columns: Floats
    raised: bool
    fonts: tuple[Font, ...]

    def strokes(
        self, text: Sequence[str], lattice: Lattice, *, slope: float = 1.0
    ) -> tuple[PlaceStrokes, ...]:
        """Strokes felt of the characters read, and of their rivals.

        Args:
            text: a character a place.
            lattice: beliefs in all that may stand there.
            slope: of what beliefs are worth, in log odds (`recognition.decision.score`).
        """
        if len(text) != self.columns.size or lattice.n_places != len(text):
            return ()
        places = self.places
        best = [places.best_font(k, char, self.fonts) for k, char in enumerate(text)]
        missing = [1.0 - one[1].share_felt() for one in best if one is not None]
        filled = min(FILLED + FILLED_OF_MISSING * float(np.mean(missing or [0.0])), MOST_FILLED)
        made = []
        for k, (char, one) in enumerate(zip(text, best, strict=True)):
            if one is None:
                made.append(PlaceStrokes(None, whole=self.whole[k]))
                continue
            font, laid = one
            rivals = tuple(
                _against(places, laid, places.lay(k, rival, font), rival, filled, belief)
                for rival, belief in _rivals(char, lattice.chars, _worth(lattice.log_belief[k], slope))
                if rival in font.glyphs
            )
            made.append(PlaceStrokes(laid.share_felt(), laid.score, font.name, rivals, self.whole[k]))
        return tuple(made)

    def by_font(self, text: Sequence[str]) -> dict[str, float]:
        """Return how well a text fits the depths along the line, mean of its places, in each font that has it all."""
        return {
            font.name: float(np.mean([self.places.lay(k, char, font).score for k, char in enumerate(text)]))
            for font in self.fonts
            if len(text) == self.columns.size and all(c in font.glyphs for c in text)
        }

    def stands_out(self, text: Sequence[str]) -> bool | None:
        """Whether the strokes of its text are ridges rather than grooves; None where no font has them all.

        Strokes are laid over the relief and over its negative. Ridges must fit as well as felt strokes do: under dirt a
        text that is not read well fits neither, and dies strike grooves.
        """
        ridges, grooves = (replace(self, raised=raised)._fits(text) for raised in (True, False))
        return ridges > max(grooves, LEAST_FIT) if math.isfinite(ridges + grooves) else None

    def fit_size(self, text: Sequence[str]) -> FeltLine:
        """The line at the height at which the strokes of its text lie best, its places where they are.

        A recogniser reads a line that was found half too high as well as another; depth is not felt along it.
        """
        best, most = self, self._fits(text)
        if most >= FITS:
            return self
        least = most + GAIN
        for factor in SIZES:
            tried = self._at_height(factor * self.line.height_mm)
            score = tried._fits(text)
            if score > max(most, least):
                best, most = tried, score
            elif best is self:
                break
        return best if most >= LEAST_FIT else self

    def _fits(self, text: Sequence[str]) -> float:
        """Mean score of a text in the first font that has it all, which is enough to tell heights apart."""
        font = next((one for one in self.fonts if all(c in one.glyphs for c in text)), None)
        if font is None or len(text) != self.columns.size:
            return math.inf
        return float(np.mean([self.places.lay(k, char, font).score for k, char in enumerate(text)]))

    def _at_height(self, height_mm: float) -> FeltLine:
        along = self.line.height_mm * ((self.columns + 0.5) / HEIGHT_ROWS - MARGIN)
        columns = (along / height_mm + MARGIN) * HEIGHT_ROWS - 0.5
        return replace(self, line=TextLine(self.line.centre_mm, height_mm), columns=columns)

    @cached_property
    def whole(self) -> tuple[bool, ...]:
        """Whether the surface is known from edge to edge of each place's character, in x and in y.

        What is covered or missing within is another question: this one is where the lines of the scan ended.
        """
        known, pitch = np.isfinite(self.relief.height_mm), self.relief.pitch_mm
        spans = [np.flatnonzero(known.any(axis=axis)) for axis in (0, 1)]
        if not spans[0].size:
            return (False,) * self.columns.size
        ends = [
            (o + pitch * s[0], o + pitch * s[-1]) for o, s in zip(self.relief.origin_mm, spans, strict=True)
        ]
        spare = EDGE_HEIGHTS * self.line.height_mm
        return tuple(
            ends[0][0] <= box.x0_mm + spare
            and box.x1_mm - spare <= ends[0][1]
            and ends[1][0] <= box.y0_mm + spare
            and box.y1_mm - spare <= ends[1][1]
            for box in boxes_of(self.line, self.columns)
        )

    @cached_property
    def places(self) -> PlacesFelt:
        """The surface about its places."""
        field = DepthField(self.relief, raised=self.raised)
        at = places_mm(self.line, self.columns)
        ahead = places_mm(self.line, self.columns + 1.0) - at
        middles = (at[:, ::-1] - np.array(field.origin_mm)[::-1]) / field.pitch_mm
        turns_deg = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
        return PlacesFelt(field, middles, turns_deg, height_mm=self.line.height_mm)


def _worth(log_belief: Floats, slope: float) -> Floats:
    """Shares of belief among the characters of a place, as a calibration's slope has them."""
    total = np.logaddexp.reduce(log_belief)
    power = slope * (log_belief - total)
    return np.asarray(np.exp(power - np.logaddexp.reduce(power) + total))


def _rivals(char: str, chars: Sequence[str], beliefs: Floats) -> list[tuple[str, float]]:
    """Live ones, and those declared that the format allows."""
    declared = {c for chars in SWAP_SETS if char in chars for c in chars}
    return [
        (c, float(b))
        for c, b in zip(chars, beliefs, strict=True)
        if c != char and (b >= LIVE or (c in declared and b > 0.0))
    ]


def _against(
    places: PlacesFelt, read: LaidCharacter, rival: LaidCharacter, char: str, filled: float, belief: float
) -> RivalStrokes:
    own, theirs = places.apart(read, rival), places.apart(rival, read)
    felt, absent = -math.log(MISLED), -math.log(filled)
    pieces = STEP_HEIGHTS / PIECE_HEIGHTS

    def many(laid: LaidCharacter, only: NDArray[np.bool_], felt: bool) -> float:
        return pieces * float((only & laid.open & (laid.felt == felt)).sum())

    margin = felt * (many(read, own, True) - many(rival, theirs, True))
    margin += min(absent * many(rival, theirs, False), MOST_ABSENT)
    margin -= min(absent * many(read, own, False), MOST_ABSENT)
    return RivalStrokes(
        char=char,
        belief=belief,
        margin=float(margin),
        apart_heights=float(own.sum() + theirs.sum()) * STEP_HEIGHTS,
        more_heights=float(theirs.sum()) * STEP_HEIGHTS,
        hidden=float((theirs & ~rival.open).sum() / max(theirs.sum(), 1)),
    )
