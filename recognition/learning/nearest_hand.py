"""The known font that comes nearest to a die, changed to come nearer: a guess at characters never felt.

known font --widened, emboldened, struck as deep, softened--> relief
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from glyphs.fonts.glyph import RELIEF_PIXELS, Font, signed_distance
from glyphs.stamping.die import die_glyph
from glyphs.stamping.faces import default_die, relief_mm
from recognition.glyph_match.predicted import CANONICAL_HEIGHT_MM
from recognition.learning.alignment import Patch, likeness

WIDTHS = (0.8, 0.9, 1.0, 1.1, 1.2, 1.3)
GROWTHS, SOFTNESSES = (-0.03, -0.015, 0.0, 0.015, 0.03, 0.045, 0.06), (0.0, 0.015, 0.03, 0.05, 0.08)
FIRST_GROWTHS, FIRST_SOFTNESSES = (-0.015, 0.03), (0.02, 0.07)
"""Changes of a known font that are tried, character heights except the widths; few of them find font and width."""
LEAST_DEPTH_HEIGHTS = 0.002


@dataclass(frozen=True, eq=False)
class Hand:
    """A known font as a die might cut it.

    Attributes:
        font: the known font.
        width: its characters are widened by this.
        grow: its outlines are moved outwards by this, character heights.
        soften: standard deviation of the Gaussian that rounds it, character heights.
        depth: of its marks, character heights.
        likeness: median correlation with the characters that were felt: some of them are broken or badly struck;
            one that the font lacks counts as 0.
        gain: what its relief is multiplied by, so that softening does not make it shallower than what was felt.
    """

    font: Font
    width: float
    grow: float
    soften: float
    depth: float
    likeness: float
    gain: float = 1.0

    def relief(self, char: str, size: tuple[int, ...]) -> Patch | None:
        """Relief of a character, in character heights; None if the font lacks it or it has no ink."""
        glyph = self.font.glyphs.get(char)
        if glyph is None or not glyph.inked:
            return None
        distance = _distance(self.font, char, size, width=self.width, depth=self.depth)
        relief = _struck(distance, depth=self.depth, grow=self.grow, soften=self.soften)
        return np.asarray(relief * np.float32(self.gain), dtype=np.float32)


def depth_of(patch: Patch) -> float:
    """Depth of a mark's floor, character heights: of the deepest twentieth, less than the strokes of a character."""
    return max(-float(np.percentile(patch, 5.0)), LEAST_DEPTH_HEIGHTS)


def nearest_hand(shapes: Mapping[str, Patch], fonts: Sequence[Font], *, compared: int = 10) -> Hand:
    """The font and its changes that come nearest to what was felt.

    Args:
        shapes: reliefs by character, all of one size.
        fonts: known ones, at least one.
        compared: characters, at most, by which font and width are found.
    """
    depth = float(np.median([depth_of(p) for p in shapes.values()]))
    few = {c: shapes[c] for c in sorted(shapes)[:: -(-len(shapes) // compared)]}
    found = [
        _best_stroke(font, width, few, depth, FIRST_GROWTHS, FIRST_SOFTNESSES)
        for font, width in product(fonts, WIDTHS)
    ]
    _, first = max(found, key=lambda pair: pair[0])
    _, hand = _best_stroke(first.font, first.width, shapes, depth, GROWTHS, SOFTNESSES)
    pairs = [(patch, hand.relief(c, patch.shape)) for c, patch in shapes.items()]
    gains = [depth_of(felt) / depth_of(drawn) for felt, drawn in pairs if drawn is not None]
    return replace(hand, gain=float(np.median(gains)) if gains else 1.0)


def _best_stroke(
    font: Font,
    width: float,
    shapes: Mapping[str, Patch],
    depth: float,
    growths: Sequence[float],
    softnesses: Sequence[float],
) -> tuple[float, Hand]:
    """The boldness and softness with which a font of that width comes nearest, and how near on the mean."""
    distances = {
        c: _distance(font, c, patch.shape, width=width, depth=depth)
        for c, patch in shapes.items()
        if c in font.glyphs and font.glyphs[c].inked
    }
    best: tuple[float, Hand] = (-2.0, Hand(font, width, 0.0, 0.0, depth, 0.0))
    for grow, soften in product(growths, softnesses):
        scores = [
            likeness(_struck(distance, depth=depth, grow=grow, soften=soften), shapes[c])
            for c, distance in distances.items()
        ]
        scores += [0.0] * (len(shapes) - len(scores))
        if float(np.mean(scores)) > best[0]:
            hand = Hand(font, width, grow, soften, depth, float(np.median(scores)))
            best = (float(np.mean(scores)), hand)
    return best


def _distance(font: Font, char: str, size: tuple[int, ...], *, width: float, depth: float) -> Patch:
    """Distance from the ink of a known character, widened, on the grid of a cut; character heights."""
    height = CANONICAL_HEIGHT_MM
    die = default_die(height, font=font, depth_mm=depth * height)
    shape = die_glyph(font.glyph(char), die, height_mm=height)
    box = shape.ink_box
    x = (np.arange(size[1]) - size[1] // 2) / RELIEF_PIXELS / width + 0.5 * (box[0] + box[2])
    y = 0.5 - (np.arange(size[0]) - size[0] // 2) / RELIEF_PIXELS
    return signed_distance(shape, x[None, :], y[:, None], stroke=shape.stroke)


def _struck(distance: Patch, *, depth: float, grow: float, soften: float) -> Patch:
    """Relief of that ink, its outline moved outwards, its edges softened; character heights."""
    from scipy import ndimage

    relief = relief_mm(distance - np.float32(grow), default_die(1.0, depth_mm=depth))
    return ndimage.gaussian_filter(relief, soften * RELIEF_PIXELS) if soften else relief
