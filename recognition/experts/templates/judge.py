"""The judge who knows shapes: templates predicted by the physics of touch, at places that others have found.

    line, its places, a font --> PlacedLine --every template in every cell--> correlations \
                                            \\--what dirt has left of it-----> evidence      > Lattice

Nothing is searched for: the places are known, and each character answers there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.stamping.die import Face
from glyphs.surface.maps import TraceDirection
from recognition.experts.templates.calibrate import Scored, log_beliefs, residual_of
from recognition.experts.templates.evidence import line_evidence
from recognition.experts.templates.place_evidence import PlaceEvidence
from recognition.experts.templates.placed_line import PlacedLine, TouchedPart
from recognition.experts.templates.refine import Cell, guessed_cells, refine_line
from recognition.language.lattice import Lattice
from recognition.lines.places import places_mm
from recognition.views.text_line import TextLine

MOST_SAG_HEIGHTS = 0.3
"""A line that bends more is no line to templates, which all stand upright along it."""
SAME_PLACE_HEIGHTS = 0.3
"""A correlation counts for a place if it was taken no further away."""
FEWEST_TURN = 4
"""Characters that tell how their line turns."""
STRUCK_SCORE = 0.7
"""Mean correlation of marks of a flat die below which dotted ones are tried."""
_SLIGHT = 1e-6
MOST_SETTLED = 2
"""Where no font is named, so many of the best have their places settled before one is chosen."""
OWN_SCORE = 0.75
"""Mean correlation of what was read with a font that nobody named, from which it has a say."""


@dataclass(frozen=True, eq=False)
class JudgedLine:
    """A line as a font's templates have it.

    Attributes:
        line: font, polarity, where characters stand.
        cells: one a place.
        score: mean correlation of the characters believed with their templates.
        lattice: what the templates believe; None where they have no say.
    """

    line: PlacedLine
    cells: tuple[Cell, ...]
    score: float
    lattice: Lattice | None

    @property
    def rotation_deg(self) -> float:
        """Of the line, by where its characters were found."""
        if len(self.cells) < FEWEST_TURN:
            return self.line.image.rotation_deg
        slope = np.polyfit([c.u_mm for c in self.cells], [c.v_mm for c in self.cells], 1)[0]
        return self.line.image.rotation_deg + math.degrees(math.atan(float(slope)))


def judged(
    part: TouchedPart,
    fonts: Sequence[Font],
    line: TextLine,
    lattice: Lattice,
    columns: NDArray[np.float64],
    *,
    named: bool,
    raised: bool | None = None,
    gaps: frozenset[int] = frozenset(),
    anew: bool = True,
) -> JudgedLine | None:
    """The line as the font has it that suits it best; None where it is bent, or no font has its characters.

    Args:
        part: as it was felt.
        fonts: to choose from.
        line: where the characters stand.
        lattice: what others believe of it.
        columns: of its strip, where the places stand.
        named: somebody says that it is one of these fonts.
        raised: whether the marks stand out; by the correlations where nobody knows.
        gaps: places of the format before a word gap.
        anew: what stands at the places is judged anew; the lattice is the templates' own otherwise.
    """
    if _sag(line) > MOST_SAG_HEIGHTS * line.height_mm or columns.size == 0:
        return None
    guess = _Guess(part, line, columns, [lattice.chars[k] for k in lattice.log_belief.argmax(axis=1)])
    best = max(
        (
            one
            for out in ((False, True) if raised is None else (raised,))
            if (one := guess.best(fonts, Guise(raised=out), rough=not named)) is not None
        ),
        key=_score,
        default=None,
    )
    if best is None or best[0] < STRUCK_SCORE:
        struck = [font for font in fonts if font.stroke_ratio > 0.0]
        dotted = guess.best(struck, Guise(face=Face.DOTTED, raised=bool(raised)), rough=not named)
        best = max((one for one in (best, dotted) if one is not None), key=_score, default=None)
    if best is None:
        return None
    score, placed = best
    if not named and score < OWN_SCORE:
        return JudgedLine(placed, guessed_cells(placed, part.edges.directions), score, None)
    if not named:
        placed = guess.placed(placed.font, Guise(placed.face, placed.raised)) or placed
    settled, cells = refine_line(placed, part.edges.directions)
    own = _lattice(settled, cells, part.edges.directions, lattice, gaps) if anew else lattice
    return JudgedLine(settled, cells, score, own)


@dataclass(frozen=True)
class Guise:
    """What a font may look like on a part."""

    face: Face = Face.FLAT
    raised: bool = False


@dataclass(frozen=True)
class _Guess:
    """The characters believed, where they are believed to stand."""

    part: TouchedPart
    line: TextLine
    columns: NDArray[np.float64]
    text: Sequence[str]

    def best(self, fonts: Sequence[Font], guise: Guise, *, rough: bool) -> tuple[float, PlacedLine] | None:
        """The font that suits them best, and how well: the mean of their correlations."""
        tried = []
        for font in fonts:
            placed = self.placed(font, guise, rough=rough)
            if placed is not None:
                cells = guessed_cells(placed, self.part.edges.directions)
                tried.append((_fit(cells), placed))
        if rough:  # the recogniser's places are whole steps: which font suits is seen once they are settled
            ranked = sorted(tried, key=_score, reverse=True)[:MOST_SETTLED]
            tried = [(_fit(refine_line(one, self.part.edges.directions)[1]), one) for _, one in ranked]
        return max(tried, key=_score, default=None)

    def placed(self, font: Font, guise: Guise, *, rough: bool = False) -> PlacedLine | None:
        """The characters in a font; None where it has none of them."""
        height_mm, turn = self.line.height_mm, self.line.turned_deg
        templates = self.part.templates(
            font, height_mm=height_mm, rotation_deg=turn, face=guise.face, raised=guise.raised, rough=rough
        )
        if not any(char in templates.chars for char in self.text) or not templates.patches.any():
            return None  # nothing to compare with, or a touch that would feel nothing of it
        image = self.part.image(turn)
        u_mm, v_mm = image.from_plate(places_mm(self.line, self.columns)).T
        template = np.array(
            [templates.chars.index(c) if c in templates.chars else 0 for c in self.text], dtype=np.int64
        )
        return PlacedLine(font, guise.face, guise.raised, height_mm, image, templates, template, u_mm, v_mm)


def _fit(cells: Sequence[Cell]) -> float:
    """Mean over cells of the best correlation."""
    return float(np.mean([cell.scores.max() for cell in cells]))


def _score(one: tuple[float, PlacedLine]) -> float:
    return one[0]


def _sag(line: TextLine) -> float:
    a, b = line.centre_mm[0], line.centre_mm[-1]
    along = (b - a) / np.linalg.norm(b - a)
    return float(np.abs((line.centre_mm - a) @ np.array([-along[1], along[0]])).max())


def _lattice(
    line: PlacedLine,
    cells: Sequence[Cell],
    directions: tuple[TraceDirection, ...],
    lattice: Lattice,
    gaps: frozenset[int],
) -> Lattice | None:
    """What correlations and, where it counts as many places, evidence make of the places believed."""
    allowed = np.isfinite(lattice.log_belief)
    places = ["".join(c for c, may in zip(lattice.chars, row, strict=True) if may) for row in allowed]
    evidence = line_evidence(line, cells, directions, places=places, gaps=gaps)
    scored = [_scored(cell, _near(evidence, cell, line.height_mm)) for cell in cells]
    own = np.stack([log_beliefs(each) for each in scored])
    log = np.full(lattice.log_belief.shape, -np.inf)
    for k, char in enumerate(line.templates.chars):
        if char in lattice.chars:
            log[:, lattice.chars.index(char)] = own[:, k]
    # of what the font has not got it says nothing: as likely as its least likely one
    lacking = ~np.isfinite(log) & allowed
    least = np.where(np.isfinite(log), log, np.inf).min(axis=1, keepdims=True)
    log = np.where(lacking, least, np.where(allowed, log, -np.inf))
    total = np.logaddexp.reduce(log, axis=1)
    if not np.isfinite(total).all():
        return None
    return replace(lattice, log_belief=np.minimum(log - np.maximum(total, 0.0)[:, None], 0.0))


def _near(places: Sequence[PlaceEvidence], cell: Cell, height_mm: float) -> PlaceEvidence | None:
    close = [p for p in places if abs(p.u_mm - cell.u_mm) < SAME_PLACE_HEIGHTS * height_mm]
    return min(close, key=lambda p: abs(p.u_mm - cell.u_mm), default=None)


def _scored(cell: Cell, place: PlaceEvidence | None) -> Scored:
    residual = residual_of(cell.scores)
    if place is None:
        share = np.clip(cell.scores, 0.0, 1.0)  # as good as evidence of its share, and no more
        return Scored(evidence=share * _SLIGHT, residual=residual, ideal=np.full(residual.size, _SLIGHT))
    return Scored(evidence=place.evidence, residual=residual, ideal=place.ideal)
