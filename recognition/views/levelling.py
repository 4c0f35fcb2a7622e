"""Level a height map, as mounting on a stage would."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap, MapError

Floats: TypeAlias = NDArray[np.float64]
# fewer heights show no character; share of known samples from which they cannot lie on one line
_LEAST_HEIGHTS, _SURFACE_SHARE = 16, 0.1
# samples, standard deviation of places across a line: two whole rows have half a sample
_LEAST_SPREAD = 0.49


def level(height_map: HeightMap, *, degree: int = 2, rounds: int = 12) -> HeightMap:
    """Remove tilt and slight dome: a robust polynomial through the land; dropouts stay NaN.

    Iteratively reweighted least squares with Tukey's biweight at three robust standard deviations, on a thinned
    grid. Only the mounting is imitated; edges are not filtered.

    Args:
        height_map: surface of the part.
        degree: degree of the polynomial.
        rounds: most rounds of the fit.

    Raises:
        MapError: the heights are few, or lie on one line.
    """
    z = height_map.z_mm
    _check_spread(np.isfinite(z))
    rows, cols = z.shape
    step = max(1, int(np.sqrt(z.size / 40_000)))
    if not np.isfinite(z[::step, ::step]).any():  # such as each second row
        step = 1
    thin = np.ascontiguousarray(z[::step, ::step], dtype=np.float64)
    row_terms, col_terms = np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, cols)
    terms = _Terms(col_terms[::step], row_terms[::step], degree)
    known = np.isfinite(thin)
    weight = known.astype(np.float64)
    weighted = np.where(known, thin, 0.0)
    for _ in range(rounds):
        normal = terms.normal(weight)
        normal[np.diag_indices_from(normal)] += 1e-10 * np.count_nonzero(known)
        coefficients = np.asarray(np.linalg.solve(normal, terms.right(weighted)))
        over = thin - terms.surface(coefficients)
        middle = float(np.median(over[known]))
        spread = 1.4826 * float(np.median(np.abs(over[known] - middle)))
        if spread <= 0.0:
            break
        weight, weighted = _tukey(thin, over, middle, 3.0 * spread)
    out = z.copy()
    out -= terms.form(coefficients, col_terms, row_terms)
    out.flags.writeable = False  # so that it is not copied
    return HeightMap(out, height_map.pitch_mm)


def _check_spread(known: NDArray[np.bool_]) -> None:
    count = int(np.count_nonzero(known))
    if count < _LEAST_HEIGHTS:
        raise MapError(f"only {count} heights are known", hint="measure the surface again")
    if count < _SURFACE_SHARE * known.size:
        spread = np.linalg.eigvalsh(np.cov(np.nonzero(known)))
        if spread[0] < _LEAST_SPREAD**2:
            raise MapError("all known heights lie on one line, as a profile", hint="measure a surface")


class _Terms:
    """Products u^i v^j with i + j up to a degree on a grid, and the sums over the grid that a fit needs.

    Attributes:
        power_u, power_v: (terms,) i and j.
    """

    def __init__(self, u: NDArray[np.float64], v: NDArray[np.float64], degree: int) -> None:
        """Prepare the sums for coordinates u (cols,) and v (rows,)."""
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
        """(terms,) sums of `weighted` (rows, cols) times each term."""
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


def _tukey(z: Floats, over: Floats, middle: float, cut: float) -> tuple[Floats, Floats]:
    """Tukey's biweights of heights `over` a fit, 0 beyond `cut`, and the weighted heights."""
    off = (over - middle) / cut
    weight = np.fmax(1.0 - off * off, 0.0) ** 2  # 0 for NaN, too
    return weight, np.where(weight > 0.0, weight * z, 0.0)
