"""Template sets last used, within a limit of memory."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from glyphs.fonts.glyph import Font
from recognition.glyph_match.predicted import TemplateKey, TemplateSet, predict_templates

MOST_BYTES, SET_BYTES = 400_000_000, 15_000_000
"""Most memory of all templates and what matching derives from them (a reader stays below 1 GB), and of one set."""


class TemplateCache:
    """Template sets last used; a reader owns one.

    Args:
        keep: most sets: 64 fonts at the heights of a batch. To predict a set takes 0.2 s, to look it up nothing.
        most_bytes: most memory of all templates and what matching derives from them.
    """

    def __init__(self, *, keep: int = 1024, most_bytes: int = MOST_BYTES) -> None:
        self._keep, self._most_bytes = keep, most_bytes
        self._sets: OrderedDict[object, TemplateSet] = OrderedDict()

    def get(self, font: Font, chars: str, key: TemplateKey) -> TemplateSet:
        """The set for a key, predicted on first use."""
        full = (font.name, font.source, chars, key)
        found = self._sets.get(full)
        if found is None:
            self._make_room()
            found = predict_templates(font, chars, key)
            self._sets[full] = found
        self._sets.move_to_end(full)
        return found

    def _make_room(self) -> None:
        """Forget the sets longest unused, until one more is within the limits."""
        sizes = [_n_bytes(kept) for kept in self._sets.values()]
        total = sum(sizes)
        for size in sizes:
            if len(self._sets) < self._keep and total <= self._most_bytes:
                break
            self._sets.popitem(last=False)
            total -= size


def _n_bytes(value: object) -> int:
    """Bytes of the arrays that a set, or anything derived from it, holds."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, dict):
        return sum(_n_bytes(v) for v in value.values())
    if isinstance(value, str):
        return 0
    if isinstance(value, tuple | list):
        return sum(_n_bytes(v) for v in value if not isinstance(v, str))
    return sum(_n_bytes(v) for v in vars(value).values()) if hasattr(value, "__dict__") else 0
