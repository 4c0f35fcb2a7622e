r"""Linearise the prediction of a recording over the benches that may have made it.

Contact is rough: where a tip slips or catches, a small change of a number makes a sample jump, and a derivative there
is meaningless. So moments are predicted for a cloud of benches, a few times as wide as the present uncertainty, and a
plane is fitted to them::

    moment(p) = b + J (p - centre) + roughness,     var of a sample = sigma^2 + var(roughness)

Samples that jump within the cloud therefore have little weight, and no result is more certain than the roughness
allows. The effect of roughness alone on the slopes along a direction is known; in the last rounds the slopes are
reduced by it (`cautious`). Least squares on the plane gives the next centre, and its covariance the next cloud: the
iterated posterior linearization filter of A. F. Garcia-Fernandez, L. Svensson, M. R. Morelande and S. Sarkka, IEEE
Trans. Signal Process. 63 (2015) 5561. The cloud is a randomly rotated cubature (I. Arasaratnam and S. Haykin, IEEE
Trans. Autom. Control 54 (2009) 1254), which is exact for a linear prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from whisker_array.identification.bench import (
    DRAWN,
    Bench,
    Unknown,
    screw_basis,
    screw_slice,
)
from whisker_array.identification.forward import Forward
from whisker_array.identification.residuals import sample_sigma_n_mm
from whisker_array.identification.tip_numbers import SHAPE, tip_derivatives, tip_of_numbers
from whisker_array.whisker.shapes import LShaped, TipModel
from whisker_array.whisker.touch import Touch

_NONE = 1e-9
"""Least width, or relative variance, of a direction that is varied; smaller ones are fixed or depend on others."""


@dataclass(frozen=True, eq=False, repr=False)
class Plane(OneLine):
    """A linear fit to the moments of a cloud of benches.

    Attributes:
        moment: for each trace (samples,), moment in the middle of the cloud, N mm.
        jacobian: for each trace (samples, n), derivative of the moment by each parameter.
        sigma: for each trace (samples,), uncertainty including that of roughness, N mm; inf where the sample is not
            used.
    """

    moment: tuple[NDArray[np.float64], ...]
    jacobian: tuple[NDArray[np.float64], ...]
    sigma: tuple[NDArray[np.float64], ...]


def plane_through(
    forward: Forward,
    at: Bench,
    covariance: NDArray[np.float64],
    *,
    free: NDArray[np.bool_],
    scatter_n_mm: float,
    turns: int,
    cautious: bool,
    seed: tuple[int, int],
) -> Plane:
    """Fit the plane to a cloud.

    Args:
        forward: model that predicts the moments.
        at: the bench in the middle.
        covariance: (n, n) covariance of the cloud.
        free: (n,) whether a number is fitted.
        scatter_n_mm: scatter of a sample.
        turns: number of cubatures, each randomly rotated.
        cautious: whether to reduce slopes by the share that roughness explains; far from the solution nothing would
            be left of them.
        seed: seed of the random rotations.
    """
    ways = _Ways.of(at, np.sqrt(np.diag(covariance)), free, forward.nominal)
    root, inverse = _roots(ways.by @ covariance @ ways.by.T)
    n_ways, rng = root.shape[1], np.random.default_rng(seed)
    turned = [_random_axes(n_ways, rng) for _ in range(turns)]
    points = np.sqrt(n_ways) * np.concatenate([sign * axes for axes in turned for sign in (1.0, -1.0)])
    n = len(points)
    cloud = [ways.moved(root @ point) for point in points]

    moments = [np.empty((n, trace.measured_n_mm.size)) for trace in forward.traces]
    # in order of the radius, because a map serves tips of about one radius
    for i in sorted(range(n), key=lambda i: cloud[i][0][Unknown.RADIUS]):
        bench, tip = cloud[i]
        for k, moment in enumerate(forward.moments(bench, tip=tip)):
            moments[k][i] = moment

    middle = [of_trace.mean(axis=0) for of_trace in moments]
    off = [of_trace - mean for of_trace, mean in zip(moments, middle, strict=True)]
    # for the points of a cubature the sum of z z^T is n times the identity
    slopes = [points.T @ o / n for o in off]
    sigma, signal_power, noise = [], np.zeros(n_ways), 0.0
    for trace, o, slope in zip(forward.traces, off, slopes, strict=True):
        rough = np.sqrt(((o - points @ slope) ** 2).sum(axis=0) / (n - 1 - n_ways))
        sigma.append(np.hypot(sample_sigma_n_mm(trace, scatter_n_mm), rough))
        signal_power += ((slope / sigma[-1]) ** 2).sum(axis=1)
        noise += float(((rough / sigma[-1]) ** 2).sum()) / n
    sure = np.maximum(0.0, 1.0 - noise / np.maximum(signal_power, noise)) if cautious else np.ones(n_ways)

    names, jacobian = list(Unknown), []
    for k, (trace, slope) in enumerate(zip(forward.traces, slopes, strict=True)):
        j = (sure[:, None] * slope).T @ inverse @ ways.by + np.outer(middle[k], ways.by_factor)
        j[:, len(names) + trace.whisker] = middle[k] / at.gain[trace.whisker]
        # a screw that is ahead has the effect of a piece that is shifted back
        along_x = trace.plan.direction.along_x
        shift = j[:, names.index(Unknown.SHIFT_X if along_x else Unknown.SHIFT_Y)]
        j[:, screw_slice(free.size, along_x=along_x)] = -shift[:, None] * screw_basis(
            trace.plan.position_mm()
        )
        j[np.isnan(trace.measured_n_mm)] = 0.0
        j[:, ~free] = 0.0
        jacobian.append(j)
    return Plane(tuple(middle), tuple(jacobian), tuple(sigma))


@dataclass(frozen=True, eq=False)
class _Ways:
    """Directions in which a cloud spreads: free numbers, with the tip's shape in place of the drawn numbers.

    Attributes:
        at: the bench in the middle.
        own: indices of the numbers that are directions themselves.
        by: (ways, n) derivative of the directions by each number.
        by_factor: (n,) relative change of all moments by each number.
        tip: (5,) numbers of the tip in the middle; None without a drawing.
    """

    at: Bench
    own: NDArray[np.intp]
    by: NDArray[np.float64]
    by_factor: NDArray[np.float64]
    tip: NDArray[np.float64] | None

    @classmethod
    def of(
        cls, at: Bench, sd: NDArray[np.float64], free: NDArray[np.bool_], nominal: LShaped | Touch
    ) -> _Ways:
        names = list(Unknown)
        own = np.array([i for i, name in enumerate(names) if free[i] and name not in DRAWN], dtype=np.intp)
        drawn = np.array([i for i, name in enumerate(names) if free[i] and name in DRAWN], dtype=np.intp)
        by, by_factor = np.eye(free.size)[own], np.zeros(free.size)
        if isinstance(nominal, Touch) or not drawn.size:
            return cls(at, own, by, by_factor, None)
        tip, by_drawn = tip_derivatives(at, sd, drawn, nominal)
        shape = np.zeros((SHAPE, free.size))
        shape[:, drawn], by_factor[drawn] = by_drawn[:SHAPE], by_drawn[SHAPE] / tip[SHAPE]
        return cls(at, own, np.vstack([by, shape]), by_factor, tip)

    def moved(self, off: NDArray[np.float64]) -> tuple[Bench, TipModel | None]:
        """Bench at an offset (ways,) from the middle, and the tip that replaces its own."""
        step = np.zeros(self.by_factor.size)
        step[self.own] = off[: self.own.size]
        if self.tip is None:
            return self.at.moved(step), None
        return self.at.moved(step), tip_of_numbers(self.tip + np.append(off[self.own.size :], 0.0))


def _roots(spread: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """R (ways, m) with R R^T = spread, and its left inverse (m, ways), for the m independent directions."""
    scale = np.sqrt(np.diag(spread))
    wide = scale > _NONE
    values, vectors = np.linalg.eigh(spread[np.ix_(wide, wide)] / np.outer(scale[wide], scale[wide]))
    apart = values > _NONE
    values, vectors = np.sqrt(values[apart]), vectors[:, apart]
    root, inverse = np.zeros((scale.size, values.size)), np.zeros((values.size, scale.size))
    root[wide], inverse[:, wide] = scale[wide, None] * vectors * values, (vectors / values).T / scale[wide]
    return root, inverse


def _random_axes(n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, n) randomly rotated axes."""
    q, r = np.linalg.qr(rng.standard_normal((n, n)))
    return np.asarray(q * np.sign(np.diag(r)))
