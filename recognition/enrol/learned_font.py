"""Learn a font by touch: reliefs of its felt characters, and guesses for the others.

    exemplars of K --laid over each other, odd ones set aside, median--> relief of K --contour--> outline of K
    no exemplar of Q --the known font that comes nearest, widened, emboldened, struck as deep, softened--> a guess at Q

Templates are predicted from the relief, by the same physics as for any other font; the outline serves drawing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.fonts.glyph import RELIEF_PIXELS, Font, Glyph, signed_distance
from glyphs.stamping.die import die_glyph
from glyphs.stamping.faces import default_die, relief_mm
from recognition.enrol.exemplars import ExemplarError
from recognition.glyph_match.predicted import CANONICAL_HEIGHT_MM

FEWEST_SIBLINGS = 3
"""Least number of agreeing exemplars that need no comparison with a known font."""
TRUSTED_LIKENESS = 0.94
"""Least likeness of the nearest font to be the die's own: worn gothic reaches 0.97, another maker's letters 0.9."""
OUTLINE_SHARE = 0.3
"""Share of the depth at which the outline is drawn."""
RIM_HEIGHTS = 0.1
"""Land about the ink that is kept, with any burr, before the relief fades; beyond it lies the plate."""
SPECK_HEIGHTS = 0.05
"""Side of a patch too small to be ink."""
AGREEMENT, FALL = 0.75, 0.08
"""Least correlation of a relief with its siblings, and greatest shortfall from their usual one: blows of one die reach
0.93 to 0.99, worn or soiled ones less, look-alikes (O and 0) 0.9 at most."""
SHIFT_PIXELS, TURNS_DEG = 3, (-3.0, -1.5, 0.0, 1.5, 3.0)
WIDTHS = (0.8, 0.9, 1.0, 1.1, 1.2, 1.3)
GROWTHS, SOFTNESSES = (-0.03, -0.015, 0.0, 0.015, 0.03, 0.045, 0.06), (0.0, 0.015, 0.03, 0.05, 0.08)
FIRST_GROWTHS, FIRST_SOFTNESSES = (-0.015, 0.03), (0.02, 0.07)
"""Changes of a known font that are tried, character heights except the widths; few of them find font and width."""
LEAST_DEPTH_HEIGHTS = 0.002

Patch = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Hand:
    """A known font with changes that a die may have."""

    font: Font
    width: float
    grow: float
    soften: float  # standard deviation of the Gaussian that rounds it, character heights
    depth: float
    # median correlation with the characters that were felt: some of them are broken or badly struck; one that
    # the font lacks counts as 0
    likeness: float
    gain: float = 1.0  # factor of its relief, so that softening does not make it shallower than the felt one

    @property
    def is_own(self) -> bool:
        """Whether the known font is the die's own, worn or not; then its other characters are no guesses."""
        return self.likeness >= TRUSTED_LIKENESS

    def relief(self, char: str, size: tuple[int, ...]) -> Patch | None:
        """Relief of a character, in character heights; None if the font lacks it or it has no ink."""
        glyph = self.font.glyphs.get(char)
        if glyph is None or not glyph.inked:
            return None
        distance = _distance(self.font, char, size, width=self.width, depth=self.depth)
        relief = _struck(distance, depth=self.depth, grow=self.grow, soften=self.soften)
        return np.asarray(relief * np.float32(self.gain), dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Learned:
    """A font made of exemplars: those used for each character, and those set aside as they disagree."""

    font: Font
    used: Mapping[str, tuple[int, ...]]
    set_aside: tuple[int, ...]
    hand: Hand

    @property
    def never_felt(self) -> str:
        return "".join(sorted(c for c, g in self.font.glyphs.items() if g.inked and not self.used.get(c)))


def learn_font(
    name: str,
    chars: Sequence[str],
    reliefs: Sequence[NDArray[np.float32]],
    *,
    known: Sequence[Font],
    vouching: bool = True,
) -> Learned:
    """Learn a font from (n,) reliefs, heights over the land in character heights, of one size, NaN where not known
    (`recognition.enrol.exemplars.Cut.relief`). Raises ExemplarError: no known font, exemplars of different sizes or
    without a mark; without vouching, no character with enough exemplars that agree."""
    if not known:
        raise ExemplarError("no known font is given", hint="name one for the characters never felt")
    if len({np.shape(r) for r in reliefs}) > 1:
        raise ExemplarError("the exemplars differ in size", hint="enrol them again")
    patches = [_trim(np.nan_to_num(np.asarray(r, dtype=np.float32))) for r in reliefs]
    groups = {c: [k for k, other in enumerate(chars) if other == c] for c in sorted(set(chars))}
    shapes: dict[str, Patch] = {}
    used: dict[str, tuple[int, ...]] = {}
    for char, siblings in groups.items():
        shapes[char], used[char] = common_relief(patches, siblings)
    few = [char for char in groups if len(used[char]) < FEWEST_SIBLINGS]
    if not vouching:
        for char in few:
            del shapes[char], used[char]
        if not shapes:
            raise ExemplarError(
                f"no character has {FEWEST_SIBLINGS} exemplars that agree", hint="enrol more parts"
            )
    hand = nearest_hand(shapes, known)
    for char in few if vouching else ():
        siblings = groups[char]
        vouched = [k for k in siblings if _is_credible(char, patches[k], hand, shapes)]
        if not vouched:
            del shapes[char], used[char]
        elif len(vouched) < len(siblings) or len(used[char]) < len(siblings):
            guess = hand.relief(char, patches[0].shape)
            if guess is not None:
                # the one most like the nearest font's character leads
                vouched.sort(key=lambda k: -align_relief(patches[k], guess)[0])
            shapes[char], used[char] = common_relief(patches, vouched)
    if not shapes:
        raise ExemplarError("no exemplar has a mark on it", hint="enrol other parts")
    glyphs = dict(_glyphs(shapes, hand, patches[0].shape))
    used_exemplars = {k for siblings in used.values() for k in siblings}
    count, others = len(used_exemplars), hand.font.name
    source = f"learned from {count} exemplars of {''.join(sorted(shapes))}; other characters after {others}"
    aside = tuple(k for k in range(len(chars)) if k not in used_exemplars)
    return Learned(Font(name, glyphs, 0.0, source), used, aside, hand)


def agreement(chars: Sequence[str], used: Mapping[str, Sequence[int]]) -> float:
    """Share of the exemplars that agree with their siblings; 1 if none has enough of them."""
    many = {char: n for char, n in Counter(chars).items() if n >= FEWEST_SIBLINGS}
    if not many:
        return 1.0
    return sum(len(used.get(char, ())) for char in many) / sum(many.values())


def _glyphs(shapes: Mapping[str, Patch], hand: Hand, size: tuple[int, ...]) -> Iterator[tuple[str, Glyph]]:
    for char in dict.fromkeys([*hand.font.glyphs, *shapes]):
        base, patch = hand.font.glyphs.get(char), shapes.get(char)
        guess = patch is None and not hand.is_own
        if patch is None:
            patch = hand.relief(char, size)
        glyph = None if patch is None else _glyph(char, patch, base, guessed=guess)
        if glyph is not None:
            yield char, glyph
        elif base is not None and not base.inked:
            yield char, base


def _is_credible(
    char: str,
    patch: Patch,
    hand: Hand,
    shapes: Mapping[str, Patch],
    *,
    # margin by which it may be more like another character of the nearest font than like its own
    other_character: float = 0.1,
    # greatest shortfall of its likeness to the nearest font's from the usual one: where that is the die's own font,
    # a single faint blow teaches nothing, and a broken corner is believed of three
    worn_fall: float = 0.05,
    foreign_fall: float = 0.3,
) -> bool:
    guess = hand.relief(char, patch.shape)
    if guess is None:
        return True
    own_likeness = align_relief(guess, patch)[0]
    if own_likeness < hand.likeness - (worn_fall if hand.is_own else foreign_fall):
        return False
    rivals = (hand.relief(c, patch.shape) for c in shapes if c != char)
    return (
        own_likeness
        > max((align_relief(g, patch)[0] for g in rivals if g is not None), default=-1.0) - other_character
    )


def _trim(patch: Patch, *, floor_share: float = 0.6) -> Patch:
    ink = patch < -OUTLINE_SHARE * depth_of(patch)
    labels, _ = ndimage.label(ink)
    sizes = np.bincount(labels.ravel())
    deepest = ndimage.maximum(-patch, labels, np.arange(sizes.size))
    # shallow hollows beside the character are the plate's
    ink &= (sizes >= (SPECK_HEIGHTS * RELIEF_PIXELS) ** 2)[labels] & (
        deepest >= floor_share * depth_of(patch)
    )[labels]
    if not ink.any():
        return patch
    far = ndimage.distance_transform_edt(~ink) / RELIEF_PIXELS
    return np.asarray(patch * np.clip(2.0 - far / RIM_HEIGHTS, 0.0, 1.0), dtype=np.float32)


def _glyph(char: str, patch: Patch, base: Glyph | None, *, guessed: bool) -> Glyph | None:
    from skimage.measure import find_contours

    from glyphs.opencv import cv2

    closed = np.pad(-patch[1:-1, 1:-1], 1)
    middle_row, middle_col = patch.shape[0] // 2, patch.shape[1] // 2
    lines = find_contours(closed, OUTLINE_SHARE * depth_of(patch))  # type: ignore[no-untyped-call,unused-ignore]
    outlines = [
        np.column_stack([line[:-1, 1] - middle_col, middle_row - line[:-1, 0]]) / RELIEF_PIXELS + (0.0, 0.5)
        for line in lines
    ]
    outlines = [
        outline for outline in outlines if cv2.contourArea(outline.astype(np.float32)) > SPECK_HEIGHTS**2
    ]
    if not outlines:
        return None
    across = np.concatenate(outlines)[:, 0]
    middle, half = 0.5 * float(across.max() + across.min()), 0.5 * float(across.max() - across.min())
    centred = ndimage.shift(patch, (0.0, -middle * RELIEF_PIXELS), order=1, mode="constant")
    # side bearings are the known font's
    box = base.ink_box if base is not None and base.inked else (0.05, 0.0, 0.05, 1.0)
    before = max(0.0, box[0])
    after = max(0.0, base.advance - box[2]) if base is not None else before
    return Glyph(
        char,
        contours=tuple(line + np.array([before + half - middle, 0.0]) for line in outlines),
        advance=before + 2.0 * half + after,
        relief=centred,
        guessed=guessed,
    )


def depth_of(patch: Patch) -> float:
    """Depth of a mark's floor, character heights: from the deepest twentieth, which is less than the strokes' area."""
    return max(-float(np.percentile(patch, 5.0)), LEAST_DEPTH_HEIGHTS)


def nearest_hand(shapes: Mapping[str, Patch], fonts: Sequence[Font], *, compared: int = 10) -> Hand:
    """Find the font, with its changes, that is nearest to the felt characters."""
    depth = float(np.median([depth_of(p) for p in shapes.values()]))
    few = {c: shapes[c] for c in sorted(shapes)[:: -(-len(shapes) // compared)]}
    hands = [
        _best_stroke(font, width, few, depth, FIRST_GROWTHS, FIRST_SOFTNESSES)
        for font, width in product(fonts, WIDTHS)
    ]
    _, first = max(hands, key=lambda pair: pair[0])
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
    distances = {
        c: _distance(font, c, patch.shape, width=width, depth=depth)
        for c, patch in shapes.items()
        if c in font.glyphs and font.glyphs[c].inked
    }
    tried = []
    for grow, soften in product(growths, softnesses):
        scores = [
            likeness(_struck(distances[c], depth=depth, grow=grow, soften=soften), patch)
            if c in distances
            else 0.0
            for c, patch in shapes.items()
        ]
        hand = Hand(font, width, grow, soften, depth, float(np.median(scores)))
        tried.append((float(np.mean(scores)), hand))
    return max(tried, key=lambda candidate: candidate[0])


def _distance(font: Font, char: str, size: tuple[int, ...], *, width: float, depth: float) -> Patch:
    height = CANONICAL_HEIGHT_MM
    die = default_die(height, font=font, depth_mm=depth * height)
    shape = die_glyph(font.glyph(char), die, height_mm=height)
    box = shape.ink_box
    x = (np.arange(size[1]) - size[1] // 2) / RELIEF_PIXELS / width + 0.5 * (box[0] + box[2])
    y = 0.5 - (np.arange(size[0]) - size[0] // 2) / RELIEF_PIXELS
    return signed_distance(shape, x[None, :], y[:, None], stroke=shape.stroke)


def _struck(distance: Patch, *, depth: float, grow: float, soften: float) -> Patch:
    relief = relief_mm(distance - np.float32(grow), default_die(1.0, depth_mm=depth))
    return ndimage.gaussian_filter(relief, soften * RELIEF_PIXELS) if soften else relief


def likeness(patch: Patch, other: Patch) -> float:
    """Correlation of two reliefs without alignment."""
    a, b = patch - patch.mean(), other - other.mean()
    return float((a * b).sum() / max(float(np.sqrt((a * a).sum() * (b * b).sum())), 1e-12))


def align_relief(patch: Patch, reference: Patch) -> tuple[float, Patch]:
    """Best correlation of a relief with another over small shifts and rotations, and the moved relief."""
    from glyphs.opencv import cv2

    n = SHIFT_PIXELS
    inner = np.ascontiguousarray(reference[n:-n, n:-n], dtype=np.float32)
    best = (-2.0, 0, 0)
    moved = patch
    for turn in TURNS_DEG:
        turned = ndimage.rotate(patch, turn, reshape=False, order=1, mode="constant") if turn else patch
        score = cv2.matchTemplate(np.asarray(turned, dtype=np.float32), inner, cv2.TM_CCOEFF_NORMED)
        down, right = divmod(int(np.argmax(score)), 2 * n + 1)
        if score[down, right] > best[0]:
            best, moved = (float(score[down, right]), down, right), turned
    score_, down, right = best
    moved = ndimage.shift(moved, (n - down, n - right), order=0, mode="constant")
    return score_, np.asarray(moved, dtype=np.float32)


def common_relief(
    patches: Sequence[Patch], which: Sequence[int], *, rounds: int = 2, most_leaders: int = 7
) -> tuple[Patch, tuple[int, ...]]:
    """Median of the reliefs that agree, and their indices; if two disagree, only the first."""
    first = (patches[which[0]], (which[0],))
    if len(which) == 1:
        return first
    leaders = [patches[k] for k in which[:most_leaders]]
    table = [[align_relief(q, p)[0] if p is not q else np.nan for q in leaders] for p in leaders]
    reference = leaders[int(np.argmax(np.nanmedian(table, axis=1)))]
    agree: list[int] = []
    for _ in range(rounds):
        laid = {k: align_relief(patches[k], reference) for k in which}
        usual = float(np.median([score for score, _ in laid.values()]))
        agree = [k for k, (score, _) in laid.items() if score >= max(AGREEMENT, usual - FALL)]
        if len(agree) < 2:
            return first
        # of two the median is the mean
        reference = np.asarray(np.median([laid[k][1] for k in agree], axis=0), dtype=np.float32)
    return reference, tuple(sorted(agree))
