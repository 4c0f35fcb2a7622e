"""Robust polynomial through the land, and medians of large arrays."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

BRACKET = 0.05
"""Range to either side of the last median, in spreads, in which the next one is searched first."""


class Terms:
    """Products u^i v^j with i + j up to a degree on a grid, and the sums over the grid that a fit needs.

    Attributes:
        power_u, power_v: (terms,) i and j.
    """

    def __init__(self, u: NDArray[np.float64], v: NDArray[np.float64], degree: int) -> None:
        """Return the polynomial's terms at coordinates (cols,) and (rows,)."""
        pairs = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        self.power_u, self.power_v = np.array(pairs).T
        self._u, self._v = (np.vander(a, 2 * degree + 1, increasing=True) for a in (u, v))
        self._n = degree + 1

    def normal(self, weight: NDArray[np.float64]) -> NDArray[np.float64]:
        """(terms, terms) sums of weight times product of two terms; weight (rows, cols)."""
        sums = self._v.T @ (weight @ self._u)
        i, j = self.power_u, self.power_v
        return np.asarray(sums[j[:, None] + j, i[:, None] + i])

    def right(self, weighted: NDArray[np.float64]) -> NDArray[np.float64]:
        """(terms,) sums of (rows, cols) times a term."""
        sums = self._v[:, : self._n].T @ (weighted @ self._u[:, : self._n])
        return np.asarray(sums[self.power_v, self.power_u])

    def surface(self, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        """The polynomial, (rows, cols)."""
        table = np.zeros((self._n, self._n))
        table[self.power_v, self.power_u] = coefficients
        return np.asarray(self._v[:, : self._n] @ (table @ self._u[:, : self._n].T))

    def form(self, coefficients: Floats, u: Floats, v: Floats) -> NDArray[np.float32]:
        """The polynomial at other coordinates, summed term by term in single precision."""
        out = np.zeros((v.size, u.size), dtype=np.float32)
        for c, i, j in zip(coefficients.astype(np.float32), self.power_u, self.power_v, strict=True):
            out += c * np.outer(v**j, u**i).astype(np.float32)
        return out


def tukey(z: Floats, over: Floats, middle: float, cut: float) -> tuple[Floats, Floats]:
    """Tukey's biweights of heights `over` a fit, 0 beyond `cut`, and the weighted heights."""
    off = (over - middle) / cut
    weight = np.fmax(1.0 - off * off, 0.0) ** 2  # nought for NaN, too
    return weight, np.where(weight > 0.0, weight * z, 0.0)


def median_near(values: NDArray[np.float64], guess: float, reach: float, *, about: float = np.nan) -> float:
    """The median of values, or of their distances from `about`: exact, and quick if the guess is near."""
    n = values.size
    if not np.isnan(about):
        values = np.abs(values - about)
    near, below = values[np.abs(values - guess) <= reach], int(np.count_nonzero(values < guess - reach))
    if not below <= (n - 1) // 2 <= n // 2 < below + near.size:
        near, below = values, 0
    upper = n // 2 - below
    parted = np.partition(near, upper)
    return float(parted[upper] if n % 2 else 0.5 * (parted[upper] + parted[:upper].max()))
