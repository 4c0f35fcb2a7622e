"""Several templates may be of one character, as raised and sunk or one-storeyed and two-storeyed; the best counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


class TemplateVariants:
    """Which templates are of which character.

    Attributes:
        chars: (C,) characters in order, each once.
    """

    def __init__(self, chars: Sequence[str]) -> None:
        """Take the characters of the templates, (T,)."""
        of = np.array(chars)
        self._order = np.argsort(of, kind="stable")
        self.chars, self._starts = np.unique(of[self._order], return_index=True)

    def best(self, scores: NDArray[np.float64]) -> NDArray[np.float64]:
        """(C,) best of (T,) scores, by character."""
        return np.asarray(np.maximum.reduceat(scores[self._order], self._starts))
