"""A font learned by touch: the relief of its characters as they were felt, and a guess at those that were not.

    exemplars of K --laid over each other, odd ones set aside, median--> relief of K --contour--> outline of K
    no exemplar of Q --the known font that comes nearest, changed to come nearer--> a guess at Q

The relief is what templates are predicted from, by the same physics as for any other font: other whiskers, turned
lines and raised marks follow by themselves. The outline serves whatever draws the font.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import RELIEF_PIXELS, Font, Glyph
from recognition.learning.alignment import Patch, align_relief, common_relief
from recognition.learning.exemplars import ExemplarError
from recognition.learning.nearest_hand import Hand, depth_of, nearest_hand

FEWEST_SIBLINGS = 3
"""Exemplars that agree, from which on they need no known font to vouch for them."""
TRUSTED_LIKENESS = 0.94
"""From this likeness on the nearest font is the die's own, worn or not, and characters never felt are no guesses:
gothic worn to a third of its depth reaches 0.97, another maker's letters 0.9."""
OUTLINE_SHARE = 0.3
"""Share of the depth at which the outline is drawn."""
RIM_HEIGHTS = 0.1
"""Land about the ink that is kept, burr and all, before the relief fades; what lies further off is the plate's."""
SPECK_HEIGHTS = 0.05
"""Side of a patch too small to be ink."""


@dataclass(frozen=True, eq=False)
class Learned:
    """A font made of exemplars.

    Attributes:
        font: the learned font.
        used: by character, indices of the exemplars that its shape is made of.
        set_aside: indices of those that disagree with their siblings, or with what the character looks like.
        hand: the known font that stands for characters never felt.
    """

    font: Font
    used: Mapping[str, tuple[int, ...]]
    set_aside: tuple[int, ...]
    hand: Hand

    @property
    def never_felt(self) -> str:
        """Characters that it has from the known font alone."""
        return "".join(sorted(c for c, g in self.font.glyphs.items() if g.inked and not self.used.get(c)))

    @property
    def is_trusted(self) -> bool:
        """Whether those are the die's own as well, not guesses."""
        return self.hand.likeness >= TRUSTED_LIKENESS


def learn_font(
    name: str,
    chars: Sequence[str],
    reliefs: Sequence[NDArray[np.float32]],
    *,
    known: Sequence[Font],
    vouching: bool = True,
) -> Learned:
    """A font of these exemplars.

    Args:
        name: its name.
        chars: (n,) what each exemplar is.
        reliefs: (n,) height over the land in character heights, negative in the mark, all of one size, NaN where
            not known (`recognition.learning.exemplars.Cut.relief`).
        known: fonts of which the nearest stands for characters never felt.
        vouching: whether it may vouch for exemplars with fewer than `FEWEST_SIBLINGS` that agree; else these teach
            nothing.

    Raises:
        ExemplarError: no exemplar or no known font, exemplars of different sizes, or none with a mark on it; without
            vouching, no character with enough exemplars that agree.
    """
    if not len(chars) or len(chars) != len(reliefs):
        raise ExemplarError(
            f"{len(chars)} characters and {len(reliefs)} reliefs", hint="give one for each, at least one"
        )
    if not known:
        raise ExemplarError("no known font is given", hint="name one for the characters never felt")
    if len({np.shape(r) for r in reliefs}) > 1:
        raise ExemplarError("the exemplars differ in size", hint="enrol them again")
    patches = [_trim(np.nan_to_num(np.asarray(r, dtype=np.float32))) for r in reliefs]
    groups = {c: [k for k, other in enumerate(chars) if other == c] for c in sorted(set(chars))}
    shapes: dict[str, Patch] = {}
    used: dict[str, tuple[int, ...]] = {}
    for char, own in groups.items():
        shapes[char], agree = common_relief([patches[k] for k in own])
        used[char] = tuple(own[k] for k in agree)
    few = [char for char in groups if len(used[char]) < FEWEST_SIBLINGS]
    if not vouching:
        shapes = {char: shape for char, shape in shapes.items() if char not in few}
        used.update(dict.fromkeys(few, ()))
        few = []
        if not shapes:
            raise ExemplarError(
                f"no character has {FEWEST_SIBLINGS} exemplars that agree", hint="enrol more parts"
            )
    hand = nearest_hand(shapes, known)
    for char in few:
        own = groups[char]
        vouched = [k for k in own if _is_credible(char, patches[k], hand, shapes)]
        if not vouched:
            del shapes[char]
            used[char] = ()
        elif len(vouched) < len(own) or len(used[char]) < len(own):
            guess = hand.relief(char, patches[0].shape)
            scores = [0.0 if guess is None else align_relief(patches[k], guess)[0] for k in vouched]
            # the one most like the nearest font's character leads
            likest = [k for _, k in sorted(zip(scores, vouched, strict=True), key=lambda pair: -pair[0])]
            shapes[char], agree = common_relief([patches[k] for k in likest])
            used[char] = tuple(sorted(likest[k] for k in agree))
    return _learned_font(name, shapes, used, len(chars), hand, patches[0].shape)


def _is_credible(
    char: str,
    patch: Patch,
    hand: Hand,
    shapes: Mapping[str, Patch],
    *,
    other_character: float = 0.1,
    worn_fall: float = 0.05,
    foreign_fall: float = 0.3,
) -> bool:
    """Whether an exemplar without siblings is to be believed.

    It must be about as like the nearest font's character as others are, and not more like another one.

    Args:
        other_character: by how much an exemplar without siblings may be more like another character of the nearest
            font than like its own.
        worn_fall, foreign_fall: by how much its likeness to the nearest font's may fall short of the usual: where
            that is the die's own font, a single faint blow teaches nothing, and a broken corner is believed of three.
    """
    guess = hand.relief(char, patch.shape)
    if guess is None:
        return True
    own = align_relief(guess, patch)[0]
    if own < hand.likeness - (worn_fall if hand.likeness >= TRUSTED_LIKENESS else foreign_fall):
        return False
    rivals = (hand.relief(c, patch.shape) for c in shapes if c != char)
    return (
        own
        > max((align_relief(g, patch)[0] for g in rivals if g is not None), default=-1.0) - other_character
    )


def _learned_font(
    name: str,
    shapes: Mapping[str, Patch],
    used: Mapping[str, tuple[int, ...]],
    count: int,
    hand: Hand,
    size: tuple[int, ...],
) -> Learned:
    glyphs: dict[str, Glyph] = {}
    for char in dict.fromkeys([*hand.font.glyphs, *shapes]):
        base = hand.font.glyphs.get(char)
        patch = shapes.get(char)
        guess = patch is None and hand.likeness < TRUSTED_LIKENESS
        if patch is None:
            patch = hand.relief(char, size)
        made = None if patch is None else _glyph(char, patch, base, guessed=guess)
        if made is not None:
            glyphs[char] = made
        elif base is not None and not base.inked:
            glyphs[char] = base
    if not shapes:
        raise ExemplarError("no exemplar has a mark on it", hint="enrol other parts")
    kept = {k for own in used.values() for k in own}
    felt = "".join(c for c in sorted(shapes))
    source = f"learned from {len(kept)} exemplars of {felt}; other characters after {hand.font.name}"
    return Learned(
        Font(name, glyphs, 0.0, source), dict(used), tuple(k for k in range(count) if k not in kept), hand
    )


def _trim(patch: Patch, *, floor_share: float = 0.6) -> Patch:
    """The relief of a character alone: what lies far from its ink is land.

    Args:
        floor_share: share of the depth that a stroke reaches somewhere.
    """
    from scipy import ndimage

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
    """The character of a relief, with its outline; None where nothing is sunk."""
    from scipy import ndimage
    from skimage.measure import find_contours

    closed = np.pad(-patch[1:-1, 1:-1], 1)
    middle_row, middle_col = patch.shape[0] // 2, patch.shape[1] // 2
    lines = find_contours(closed, OUTLINE_SHARE * depth_of(patch))  # type: ignore[no-untyped-call,unused-ignore]
    outlines = [
        np.column_stack([line[:-1, 1] - middle_col, middle_row - line[:-1, 0]]) / RELIEF_PIXELS + (0.0, 0.5)
        for line in lines
    ]
    outlines = [line for line in outlines if len(line) > 2 and abs(_area(line)) > SPECK_HEIGHTS**2]
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


def _area(line: NDArray[np.float64]) -> float:
    """Signed area of a closed polygon (shoelace)."""
    x, y = line.T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
