"""Depths along the best-fitting font's strokes if the part's is unknown, where they follow the grooves (`strokes_fit`).

Of 36 characters in 6 fonts, 0.16 mm deep, 29 are measured on clean parts, 19 at dirt 0.3 and none at 0.6. No mean and
no least depth of these is off by more than 0.02 mm (`python tests/benchmarks/depth_unnamed.py --parts 1 --every 3`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.marks.depth import MarkDepth, mark_depths
from recognition.marks.laid_text import LEAST_FIT_OF_BETTER_HALF, LaidText
from recognition.marks.no_depth import NoDepth
from whisker_array.estimation.relief import Relief

LEAST_STROKE_FIT = 0.8
"""Least correlation of the depths about a place with the character's, from which its strokes may be the mark's: the
right font reaches 0.87 on clean parts, the nearest stand-in for another one 0.4 to 0.96."""


@dataclass(frozen=True, eq=False)
class LineDepths:
    """Depths of a line's characters along the strokes of a named font, or of the font that fits each of them."""

    relief: Relief
    laid: LaidText
    others: Sequence[LaidText]
    # whether a font is named. It is wrong if another one fits better by `clear_gain`, and well: dots, sharp
    # grooves and dirt give the right font 0.2 to 0.85, and others then fit no better, or badly as well.
    named: bool
    clear_gain: float = 0.05
    least_fit: float = 0.7

    @cached_property
    def font_fits(self) -> bool:
        if not self.named:
            return self.laid.fit_of_better_half >= LEAST_FIT_OF_BETTER_HALF
        least = max(self.laid.fit + self.clear_gain, self.least_fit)
        few = len(self._foreign) < max(2, len(self._along) // 4)
        return few and not any(other.fit >= least for other in self.others)

    @cached_property
    def same_strokes(self) -> tuple[bool, ...]:
        """Whether each character has the strokes of the line's font, so that it can be graded."""
        if self._named_fits:
            return tuple(k not in self._lacking for k in range(len(self.laid.text)))
        return tuple(fit >= LEAST_STROKE_FIT for fit in self.laid.fits)

    @cached_property
    def depths(self) -> tuple[MarkDepth | NoDepth, ...]:
        if not self._named_fits:
            return self._fitting_depths()
        lacking = self._lacking
        return tuple(
            NoDepth.FONT if k in lacking else depth or NoDepth.NOT_FELT for k, depth in enumerate(self._along)
        )

    @property
    def _named_fits(self) -> bool:
        return self.named and self.font_fits

    @cached_property
    def _along(self) -> tuple[MarkDepth | None, ...]:
        return mark_depths(self.relief, self.laid)

    @property
    def _lacking(self) -> set[int]:
        return self._foreign | {k for k, mark in enumerate(self.laid.laid) if mark is None}

    @cached_property
    def _foreign(self) -> set[int]:
        """Places, from 0, where the strokes of a named font do not fit and those of another one do."""
        fits, foreign = self.laid.fits, set[int]()
        doubtful = {k for k, d in enumerate(self._along) if d is not None and not strokes_fit(d, fits[k])}
        for other in self.others if doubtful else ():
            better = {k for k in doubtful - foreign if other.fits[k] >= fits[k] + self.clear_gain}
            along = mark_depths(self.relief, other) if better else ()
            foreign |= {k for k in better if (d := along[k]) is not None and strokes_fit(d, other.fits[k])}
        return foreign

    def _fitting_depths(self) -> tuple[MarkDepth | NoDepth, ...]:
        texts = [self.laid, *self.others]
        fits = np.array([laid.fits for laid in texts])
        best = fits.argmax(axis=0)
        measured = [
            mark_depths(self.relief, laid, places=set(np.flatnonzero(best == number).tolist()))
            if number in best
            else ()
            for number, laid in enumerate(texts)
        ]
        depths: list[MarkDepth | NoDepth] = []
        for place, number in enumerate(best):
            depth = measured[number][place] or NoDepth.NOT_FELT
            fitting = isinstance(depth, NoDepth) or strokes_fit(depth, fits[number, place])
            depths.append(depth if fitting else NoDepth.FONT)
        return tuple(depths)


def strokes_fit(
    depth: MarkDepth,
    fit: float,
    *,
    least_fit: float = LEAST_STROKE_FIT,
    shallower: float = 0.12,
    deeper: float = 0.15,
    most_sd_mm: float = 0.06,
) -> bool:
    """Whether the strokes laid on a character are its own: then its depth is even, unless a blow leans."""
    low, high = (1.0 - shallower) * depth.mean_mm, (1.0 + deeper) * depth.mean_mm
    even = low <= depth.min_mm and depth.max_mm <= high
    return fit >= least_fit and even and depth.sd_mm is not None and depth.sd_mm <= most_sd_mm
