"""Depths along the strokes of a font that is not known to be the part's.

A stroke that the part's font lacks lies on the land, and would be told as a shallow one. So a character counts as
measured only along strokes that follow its grooves (`strokes_fit`), in the font that fits it best.

Of 204 characters in 17 fonts, 0.16 mm deep, 152 are measured on clean parts, 72 at dirt 0.3 and 23 at 0.6. No mean is
off by more than 0.02 mm, and two least depths are, by 0.021 and 0.023 (`python tests/benchmarks/depth_unnamed.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recognition.marks.depth import MarkDepth, mark_depths
from recognition.marks.laid_text import LEAST_FIT_OF_BETTER_HALF, LaidText
from recognition.marks.no_depth import NoDepth
from whisker_array.estimation.relief import Relief

LEAST_STROKE_FIT = 0.8
"""Least correlation of the depths about a place with the character's, from which its strokes may be the mark's.

The right font reaches 0.87 on clean parts, the nearest stand-in for another one 0.4 to 0.96.
"""


@dataclass(frozen=True)
class LineDepths:
    """Depths of a line's characters.

    Attributes:
        depths: depth of each character, or why it was not measured.
        same_strokes: whether each character has the strokes of the line's font, so that it can be graded.
        font_fits: whether the line's font is that of the part.
    """

    depths: tuple[MarkDepth | NoDepth, ...]
    same_strokes: tuple[bool, ...]
    font_fits: bool


def line_depths(
    relief: Relief,
    laid: LaidText,
    others: Sequence[LaidText],
    *,
    named: bool,
    clear_gain: float = 0.05,
    least_fit: float = 0.7,
) -> LineDepths:
    """Measure the characters of a line along the strokes of a named font, or of the font that fits each of them.

    Args:
        relief: the surface as felt.
        laid: the line's text, laid in the font that fits it best, of the named ones if any is named.
        others: the text laid in other fonts.
        named: whether a font is named. It is wrong if another one fits better by `clear_gain`, and well: dots, sharp
            grooves and dirt give the right font 0.2 to 0.85, and others then fit no better, or badly as well.
        clear_gain: gain of the mean correlation by which another font must fit better.
        least_fit: least mean correlation of that other font.
    """
    along = mark_depths(relief, laid)
    foreign = foreign_places(relief, laid, along, others) if named else set[int]()
    few = len(foreign) < max(2, len(along) // 4)
    wrong = any(other.fit >= max(laid.fit + clear_gain, least_fit) for other in others)
    if named and few and not wrong:
        foreign |= {k for k, mark in enumerate(laid.laid) if mark is None}
        depths = (NoDepth.FONT if k in foreign else d or NoDepth.NOT_FELT for k, d in enumerate(along))
        return LineDepths(tuple(depths), tuple(k not in foreign for k in range(len(along))), font_fits=True)
    return LineDepths(
        fitting_depths(relief, [laid, *others]),
        tuple(fit >= LEAST_STROKE_FIT for fit in laid.fits),
        font_fits=not named and laid.fit_of_better_half >= LEAST_FIT_OF_BETTER_HALF,
    )


def strokes_fit(
    depth: MarkDepth,
    fit: float,
    *,
    least_fit: float = LEAST_STROKE_FIT,
    shallower: float = 0.12,
    deeper: float = 0.15,
    most_sd_mm: float = 0.06,
) -> bool:
    """Whether a character's depth can be trusted although its font is not known: the strokes laid on it are its own.

    A stroke beside a groove, and one that is filled, makes the depth uneven. So does a blow that leans: it is left
    out as well.

    Args:
        depth: depth along the strokes.
        fit: correlation of the depths about the place with the character's.
        least_fit: least such correlation.
        shallower, deeper: greatest difference of the least and the greatest depth from the mean, as a share of it.
        most_sd_mm: greatest `MarkDepth.sd_mm`: dirt on the land hides its level.
    """
    low, high = (1.0 - shallower) * depth.mean_mm, (1.0 + deeper) * depth.mean_mm
    even = low <= depth.min_mm and depth.max_mm <= high
    return fit >= least_fit and even and depth.sd_mm is not None and depth.sd_mm <= most_sd_mm


def fitting_depths(relief: Relief, texts: Sequence[LaidText]) -> tuple[MarkDepth | NoDepth, ...]:
    """Depth of each character of a line of unknown font, along the strokes of the font that fits it best.

    Args:
        relief: the surface as felt.
        texts: the line's text, laid in each font that may be the part's.
    """
    fits = np.array([laid.fits for laid in texts])
    depths: list[MarkDepth | NoDepth] = []
    for place, choices in enumerate(zip(*(mark_depths(relief, laid) for laid in texts), strict=True)):
        best = int(fits[:, place].argmax())
        depth = choices[best] or NoDepth.NOT_FELT
        fitting = isinstance(depth, NoDepth) or strokes_fit(depth, fits[best, place])
        depths.append(depth if fitting else NoDepth.FONT)
    return tuple(depths)


def foreign_places(
    relief: Relief,
    laid: LaidText,
    depths: Sequence[MarkDepth | None],
    others: Sequence[LaidText],
    *,
    least_gain: float = 0.05,
) -> set[int]:
    """Places, from 0, where the strokes of a named font do not fit and those of another one do.

    Args:
        relief: the surface as felt.
        laid: the line's text, laid in the named font.
        depths: depths along its strokes.
        others: the text laid in other fonts.
        least_gain: least gain of correlation in another font.
    """
    fits, foreign = laid.fits, set[int]()
    doubtful = {k for k, d in enumerate(depths) if d is not None and not strokes_fit(d, fits[k])}
    for other in others if doubtful else ():
        better = {k for k in doubtful - foreign if other.fits[k] >= fits[k] + least_gain}
        along = mark_depths(relief, other) if better else ()
        foreign |= {k for k in better if (d := along[k]) is not None and strokes_fit(d, other.fits[k])}
    return foreign
