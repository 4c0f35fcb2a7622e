"""What every template would earn at every place of the search, in single precision throughout.

A character earns its width times (score^2 - floor^2), shallow ones less, less what a character costs.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recognition.localise import percentile
from recognition.match import DenseScores


def depth_share(dense: DenseScores) -> NDArray[np.float32]:
    """(windows, rows, cols) amplitude in a window against what is usual for the line, at most 1.

    Shallow characters count less than deep ones, but by their amplitude, not their energy.
    """
    typical = percentile(dense.window_energy.max(axis=(0, 1)), 80.0)
    return np.asarray(np.sqrt(np.clip(dense.window_energy / max(typical, 1e-30), 0.0, 1.0)))


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _reward(score, share, width, sign, floor, cost, out):  # type: ignore[no-untyped-def]
    for c in range(score.size):
        s = sign * score[c]
        square = s * s if s > np.float32(0.0) else -s * s
        out[c] = width * share[c] * (square - floor) - cost


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _promises(score, window, share, width, sign, floor, cost):  # type: ignore[no-untyped-def]
    """(rows,) sum over columns of the most that any template earns there, if it earns at all."""
    count, rows, cols = score.shape
    out = np.zeros(rows)
    reward, best = np.empty(cols, dtype=np.float32), np.empty(cols, dtype=np.float32)
    for r in range(rows):
        best[:] = np.float32(0.0)
        for t in range(count):
            _reward(score[t, r], share[window[t], r], width[t], sign, floor, cost, reward)
            for c in range(cols):
                best[c] = max(best[c], reward[c])
        out[r] = best.sum()
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _rewards(score, window, share, width, sign, floor, cost, first, last):  # type: ignore[no-untyped-def]
    """(T, rows, cols) rewards of the rows from first to last."""
    count, _, cols = score.shape
    out = np.empty((count, last - first, cols), dtype=np.float32)
    for t in range(count):
        for r in range(first, last):
            _reward(score[t, r], share[window[t], r], width[t], sign, floor, cost, out[t, r - first])
    return out


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
        found: NDArray[np.float64] = _promises(*self._of)
        return found

    def near(self, first: int, last: int) -> NDArray[np.float32]:
        """(T, last - first, cols) what each template earns in those rows."""
        found: NDArray[np.float32] = _rewards(*self._of, first, last)
        return found
