"""What every template would earn at every place of the search, in single precision throughout.

A character earns its width times (score^2 - floor^2), shallow ones less, less what a character costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel
from recognition.localise import percentile
from recognition.match import DenseScores


def depth_share(dense: DenseScores) -> NDArray[np.float32]:
    """(windows, rows, cols) amplitude in a window against what is usual for the line, at most 1.

    Shallow characters count less than deep ones, but by their amplitude, not their energy.
    """
    typical = percentile(dense.window_energy.max(axis=(0, 1)), 80.0)
    return np.asarray(np.sqrt(np.clip(dense.window_energy / max(typical, 1e-30), 0.0, 1.0)))


@kernel()
def _promises(score, window, share, width, sign, floor, cost, best, out):  # type: ignore[no-untyped-def]
    """(rows,) sum over columns of the most that any template earns there, if it earns at all; `best` is room."""
    count, rows, cols = score.shape
    for r in range(rows):
        for c in range(cols):
            best[c] = np.float32(0.0)
        for t in range(count):
            line, shares = score[t, r], share[window[t], r]
            for c in range(cols):
                s = sign * line[c]
                square = s * s if s > np.float32(0.0) else -s * s
                best[c] = max(best[c], width[t] * shares[c] * (square - floor) - cost)
        total = np.float32(0.0)
        for c in range(cols):
            total += best[c]
        out[r] = total


class TemplateScores:
    """Rewards of one search, of sunk or of raised marks."""

    def __init__(
        self,
        dense: DenseScores,
        share: NDArray[np.float32],
        width: NDArray[np.float64],
        *,
        negative: bool,
        score_floor: float,
        cost: float,
    ) -> None:
        """Prepare.

        Args:
            dense: scores.
            share: see `depth_share`.
            width: (T,) what each template explains, character heights.
            negative: raised marks looked for with sunk templates: they answer with the opposite sign.
            score_floor: correlation that earns nothing.
            cost: of a character.
        """
        self._of = (
            dense.score,
            dense.window,
            share,
            width.astype(np.float32),
            np.float32(-1.0 if negative else 1.0),
            np.float32(score_floor**2),
            np.float32(cost),
        )

    def promises(self) -> NDArray[np.float64]:
        """(rows,) sum over columns of the most that any template earns there, if it earns at all."""
        _, rows, cols = self._of[0].shape
        found = np.empty(rows)
        _promises(*self._of, np.empty(cols, dtype=np.float32), found)
        return found

    def near(self, first: int, last: int) -> NDArray[np.float32]:
        """(T, last - first, cols) what each template earns in those rows."""
        score, window, share, width, sign, floor, cost = self._of
        s = sign * score[:, first:last]
        return np.asarray(width[:, None, None] * share[window, first:last] * (s * np.abs(s) - floor) - cost)
