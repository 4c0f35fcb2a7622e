"""The loops of `mounting`, compiled: the robust polynomial through the land, and medians of much that hardly moves."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_ANY_ORDER = {"reassoc", "contract", "arcp", "nsz"}
BRACKET = 0.05
"""To either side of the last median, in spreads, that the next one is first looked for in."""


class Terms:
    """Products u^i v^j with i + j up to a degree on a grid, and the sums over the grid that a fit needs.

    Attributes:
        power_u, power_v: (terms,) i and j.
    """

    def __init__(self, u: NDArray[np.float64], v: NDArray[np.float64], degree: int) -> None:
        """Of coordinates (cols,) and (rows,)."""
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


@njit(cache=True, error_model="numpy", fastmath=_ANY_ORDER)  # type: ignore[untyped-decorator,unused-ignore]
def tukey(z, over, middle, inv_cut, weight, weighted):  # type: ignore[no-untyped-def]
    """Biweights of heights that lie `over` a fit, which vanish 1 / inv_cut from the middle, and the heights by them."""
    for j in range(z.size):
        off = (over[j] - middle) * inv_cut
        w = 1.0 - off * off
        known = w > 0.0  # not for NaN either
        weight[j] = w * w if known else 0.0
        weighted[j] = w * w * z[j] if known else 0.0


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _between(values, middle, low, high, out):  # type: ignore[no-untyped-def]
    """Distances from `middle` (values as they are if it is NaN) from low to high, and how many are below."""
    below = within = 0
    plain = np.isnan(middle)
    for value in values:
        x = value if plain else abs(value - middle)
        below += 1 if x < low else 0
        out[within] = x
        within += 1 if (x >= low) & (x <= high) else 0
    return below, within


def median_near(values: NDArray[np.float64], guess: float, reach: float, *, about: float = np.nan) -> float:
    """The median of values, or of their distances from `about`: exact, and quick when it is within reach of a guess."""
    n = values.size
    near = np.empty(n + 1)
    below, within = _between(values, about, guess - reach, guess + reach, near)
    if not below <= (n - 1) // 2 <= n // 2 < below + within:
        below, within = _between(values, about, -np.inf, np.inf, near)
    upper = n // 2 - below
    parted = np.partition(near[:within], upper)
    return float(parted[upper] if n % 2 else 0.5 * (parted[upper] + parted[:upper].max()))


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def without_form(z, terms_v, terms_u, coefficients, out):  # type: ignore[no-untyped-def]
    """Heights less the polynomial, in float32 term by term; terms_v (terms, rows), terms_u (terms, cols)."""
    form = np.empty(z.shape[1], dtype=np.float32)
    for i in range(z.shape[0]):
        form[:] = np.float32(0.0)
        for k in range(coefficients.size):
            scale, across = coefficients[k], terms_v[k, i]
            for j in range(form.size):
                form[j] += scale * np.float32(across * terms_u[k, j])
        for j in range(form.size):
            out[i, j] = z[i, j] - form[j]


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def steepness_squared(z, pitch, out):  # type: ignore[no-untyped-def]
    """Square of the gradient of (rows, cols) float32: central differences, one-sided at the rim, into float64."""
    rows, cols = z.shape
    one, two = np.float32(pitch), np.float32(2.0 * pitch)
    for i in range(rows):
        up, down = z[max(i - 1, 0)], z[min(i + 1, rows - 1)]
        span, line = two if 0 < i < rows - 1 else one, z[i]
        for j in range(1, cols - 1):
            a, b = np.float64((line[j + 1] - line[j - 1]) / two), np.float64((down[j] - up[j]) / span)
            out[i, j] = a * a + b * b
        for j, left, right in ((0, 0, 1), (cols - 1, cols - 2, cols - 1)):
            a, b = np.float64((line[right] - line[left]) / one), np.float64((down[j] - up[j]) / span)
            out[i, j] = a * a + b * b


def median_and_quantile(values: NDArray[np.float64], share: float) -> tuple[float, float]:
    """The median of values, and the quantile at a share of 0.5 or more, interpolated between neighbours."""
    n = values.size
    half, place = n // 2, share * (n - 1)
    low = int(place)
    parted = np.partition(values, half, axis=None)
    median = parted[half] if n % 2 else 0.5 * (parted[half] + parted[:half].max())
    if low < half:
        before, after = parted[:half].max(), parted[half]
    else:
        upper = np.partition(parted[half:], low - half)
        before = upper[low - half]
        after = upper[low - half + 1 :].min(initial=np.inf if low + 1 < n else before)
    return float(median), float(before + (place - low) * (after - before))
