"""What experts are worth, from places whose character is known: the weights under which the truth is most believed.

Maximum likelihood of `recognition.belief.line_belief.pooled` itself; a place counts once however many experts read it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.belief.line_belief import pooled
from recognition.belief.weights import ExpertWeights, Power
from recognition.language.lattice import Lattice

FEWEST = 200
"""Places below which nothing is fitted."""
_MOST_POWER, _MOST_DOUBT = 2.0, 0.5
_SLIPS = (1e-4, 3e-4, 1e-3, 3e-3)


@dataclass(frozen=True, eq=False)
class KnownLine:
    """A line whose text is known, as every expert reads it.

    Attributes:
        text: as many characters as there are places.
        by_expert: lattices over the same characters.
        group: what it came from: lines of a group are held out together.
    """

    text: str
    by_expert: Mapping[str, Lattice]
    group: str = ""


def loss(lines: Sequence[KnownLine], weights: ExpertWeights) -> float:
    """Mean surprise at the true characters, nats a place."""
    total, count = 0.0, 0
    for line in lines:
        lattice = pooled(line.by_expert, weights)
        log = lattice.log_belief - np.logaddexp.reduce(lattice.log_belief, axis=1)[:, None]
        at = [lattice.chars.index(char) for char in line.text]
        total -= float(np.maximum(log[np.arange(len(at)), at], -20.0).sum())
        count += len(at)
    return total / max(count, 1)


def fit_weights(lines: Sequence[KnownLine]) -> ExpertWeights:
    """The weights that surprise least.

    Args:
        lines: of one kind of view; not every expert need have read every line.

    Raises:
        ValueError: too few places.
    """
    from scipy.optimize import minimize

    places = sum(len(line.text) for line in lines)
    if places < FEWEST:
        raise ValueError(f"{places} places are too few to fit weights; give {FEWEST} at least")
    names = sorted({name for line in lines for name in line.by_expert})

    def weights_at(values: NDArray[np.float64], slip: float) -> ExpertWeights:
        pairs = np.asarray(values).reshape(-1, 2)
        return ExpertWeights(
            {n: Power(float(a), float(b)) for n, (a, b) in zip(names, pairs, strict=True)}, slip
        )

    best: tuple[float, ExpertWeights] | None = None
    bounds = [(0.05, _MOST_POWER), (-_MOST_DOUBT, _MOST_DOUBT)] * len(names)
    for slip in _SLIPS:
        found = minimize(
            lambda values, s=slip: loss(lines, weights_at(values, s)), [0.6, 0.0] * len(names),
            method="L-BFGS-B", bounds=bounds, options={"maxiter": 25},
        )  # fmt: skip
        if best is None or found.fun < best[0]:
            best = (float(found.fun), weights_at(found.x, slip))
    assert best is not None
    return best[1]
