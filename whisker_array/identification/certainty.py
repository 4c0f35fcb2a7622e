"""Covariance of the identified parameters of a bench.

    C = (G - 1) / G sum over passes d d^T + H^-1 P H^-1
    d = (H - J_pass^T J_pass)^-1 g,     H = J^T J + P,   g = J_pass^T r_pass,   P = diag(1 / sd^2)

is the cluster jackknife: d is how far the fit moves if one of its G passes is left out (CV3 in J. G. MacKinnon, M. O.
Nielsen, M. D. Webb, Cluster-robust inference, J. Econometrics 232 (2023)). It does not understate the error when there
are few passes. All whiskers share the vibration and the drift of a pass, so neither needs a separate model. sd is the
prior standard deviation. In every direction the scatter is at least that of independent samples.

Two terms are added: the error of the grid of the fit's maps, and errors that the model leaves out (`LEFT_OUT`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from whisker_array.identification.bench import Bench, Unknown
from whisker_array.identification.traces import Trace

LEFT_OUT = {Unknown.SHIFT_X: 6e-4, Unknown.SHIFT_Y: 6e-4, Unknown.PRELOAD: 1.5e-4}
"""Errors that all passes share, so that they do not show as scatter, mm.
Measured with `tests.benchmarks.identify_benches` on seeds below 50; other seeds must test them."""
COARSE_FACTOR = 2.0
"""Factor of the coarser grid from which the error of the fit's own grid is found."""


@dataclass(frozen=True, eq=False, repr=False)
class Fitted(OneLine):
    """One iteration of a fit; each sample is scaled by its sigma.

    Attributes:
        traces: the fitted traces.
        jacobian: for each trace (samples, n), derivative of the prediction by each parameter.
        left: for each trace (samples,), residual: measured minus predicted.
        weight: for each trace (samples,), weight of the robust loss.
        before: (n,) prior standard deviations of the parameters.
        free: (n,) whether a parameter is fitted.
    """

    traces: tuple[Trace, ...]
    jacobian: tuple[NDArray[np.float64], ...]
    left: tuple[NDArray[np.float64], ...]
    weight: tuple[NDArray[np.float64], ...]
    before: NDArray[np.float64]
    free: NDArray[np.bool_]

    @property
    def data(self) -> NDArray[np.float64]:
        """(n, n) J^T J: the information of the samples without the prior."""
        return np.asarray(
            sum(j.T @ (w[:, None] * j) for j, w in zip(self.jacobian, self.weight, strict=True))
        )

    @property
    def _prior(self) -> NDArray[np.float64]:
        return np.diag(1.0 / self.before**2)

    @property
    def rms_left(self) -> float:
        """Weighted rms of the residuals."""
        squares, weights = (
            sum(float(part.sum()) for part in parts)
            for parts in ((w * r**2 for w, r in zip(self.weight, self.left, strict=True)), self.weight)
        )
        return float(np.sqrt(squares / weights))

    def scatter_covariance(self) -> NDArray[np.float64]:
        """(n, n) covariance C of the module's docstring; a parameter that is not fitted keeps its prior variance."""
        whole = self.data + self._prior
        of_pass: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
        for trace, j, w, r in zip(self.traces, self.jacobian, self.weight, self.left, strict=True):
            g, h = of_pass.get(trace.cluster, (np.zeros(self.before.size), np.zeros_like(whole)))
            of_pass[trace.cluster] = g + j.T @ (w * r), h + j.T @ (w[:, None] * j)
        n = len(of_pass)
        without = [np.linalg.solve(whole - h, g) for g, h in of_pass.values()]
        jackknife = sum((np.outer(d, d) for d in without), np.zeros_like(whole)) * ((n - 1) / n)
        bread = np.linalg.inv(whole)
        least = bread @ (self.data + 1e-3 * self._prior) @ bread
        covariance = _at_least(jackknife, least) + bread @ self._prior @ bread
        fixed = ~self.free
        covariance[fixed], covariance[:, fixed] = 0.0, 0.0
        covariance[fixed, fixed] = self.before[fixed] ** 2
        return np.asarray(0.5 * (covariance + covariance.T))

    def grid_covariance(self, by_grid: tuple[NDArray[np.float64], ...]) -> NDArray[np.float64]:
        """(n, n) covariance from the grid of the maps, whose error is of first order at steep edges.

        A grid `COARSE_FACTOR` times as wide moves the solution by (COARSE_FACTOR - 1) times the error of this grid.

        Args:
            by_grid: for each trace (samples,), the prediction minus that on the coarser grid.
        """
        moved = self.step(by_grid, np.zeros(self.before.size)) / (COARSE_FACTOR - 1.0)
        return np.outer(moved, moved)

    def step(self, missed: tuple[NDArray[np.float64], ...], away: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) least-squares step of the parameters.

        Args:
            missed: for each trace (samples,), measured minus predicted.
            away: (n,) present parameters minus their prior means.
        """
        pull = sum(j.T @ (w * m) for j, w, m in zip(self.jacobian, self.weight, missed, strict=True))
        return np.where(self.free, np.linalg.solve(self.data + self._prior, pull - self._prior @ away), 0.0)


def left_out_covariance(nominal: Bench) -> NDArray[np.float64]:
    """(n, n) covariance of the errors in `LEFT_OUT`, in the order of `Bench.vector`."""
    sd = np.zeros_like(nominal.vector())
    for name, off in LEFT_OUT.items():
        sd[list(Unknown).index(name)] = off
    return np.diag(sd**2)


def _at_least(matrix: NDArray[np.float64], least: NDArray[np.float64]) -> NDArray[np.float64]:
    """Raise a covariance to at least `least` in every direction: few clusters would understate some variances."""
    root = np.linalg.cholesky(least)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ matrix @ inverse.T)
    return np.asarray(root @ (vectors * np.maximum(values, 1.0)) @ vectors.T @ root.T)
