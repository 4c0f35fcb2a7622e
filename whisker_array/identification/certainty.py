"""How sure the numbers of a bench are.

    C = H^-1 (sum over passes g g^T + P) H^-1,     H = J^T J + P,   g = J_pass^T r_pass,   P = diag(1 / sd^2)

is the covariance of White and Huber, passes being the clusters: what shakes the base reaches all whiskers of a pass,
and drift goes on through it, so that neither needs a model of its own. sd is what was known before. In no direction is
the scatter taken for less than that of independent samples. Source: A. C. Cameron, D. L. Miller, A practitioner's guide
to cluster-robust inference, J. Human Resources 50 (2015), with their correction n / (n - 1) for few clusters.

What the grid of the fit's strips does comes on top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.forward import Trace

COARSER = 1.5
"""A grid so much wider shows what the fit's own does."""


def scattered(
    jacobian: list[NDArray[np.float64]],
    residual: list[NDArray[np.float64]],
    traces: tuple[Trace, ...],
    data: NDArray[np.float64],
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    sigma: float,
) -> NDArray[np.float64]:
    """(n, n): the covariance of the module's docstring; of numbers that are not found it is that of before."""
    prior = np.diag(1.0 / before**2)
    bread = np.linalg.inv(data + prior)
    gradients: dict[int, NDArray[np.float64]] = {}
    for trace, j, r in zip(traces, jacobian, residual, strict=True):
        gradients[trace.cluster] = gradients.get(trace.cluster, np.zeros(before.size)) + j.T @ r / sigma**2
    n = len(gradients)
    shaken = sum((np.outer(g, g) for g in gradients.values()), np.zeros_like(prior)) * (n / (n - 1))
    meat = _at_least(shaken, data + 1e-9 * prior) + prior
    covariance = bread @ meat @ bread
    fixed = ~free
    covariance[fixed], covariance[:, fixed] = 0.0, 0.0
    covariance[fixed, fixed] = before[fixed] ** 2
    return np.asarray(0.5 * (covariance + covariance.T))


def _at_least(matrix: NDArray[np.float64], least: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix, in no direction less than the other: with few clusters some would come out far too sure."""
    root = np.linalg.cholesky(least)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ matrix @ inverse.T)
    return np.asarray(root @ (vectors * np.maximum(values, 1.0)) @ vectors.T @ root.T)


def of_grid(
    jacobian: list[NDArray[np.float64]],
    weight: list[NDArray[np.float64]],
    predicted: list[NDArray[np.float64]],
    coarser: list[NDArray[np.float64]],
    data: NDArray[np.float64],
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    sigma: float,
) -> NDArray[np.float64]:
    """(n, n): what the strips' grid does to the numbers, its error being of first order at steep edges.

    A grid `COARSER` times as wide moves the solution by (COARSER - 1) times what this grid has moved it.
    """
    pull = np.zeros(before.size)
    for j, w, fine, wide in zip(jacobian, weight, predicted, coarser, strict=True):
        pull += j.T @ (w * (fine - wide)) / sigma**2
    moved = np.linalg.solve(data + np.diag(1.0 / before**2), pull) / (COARSER - 1.0)
    moved[~free] = 0.0
    return np.outer(moved, moved)
