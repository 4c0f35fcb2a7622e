"""Numbers that a recording does not determine, or not apart from others, and what would determine them.

In units of what was known before, the covariance has large eigenvalues along what the recording does not tell; where
several numbers share such a direction, only their combination is known.
"""

from __future__ import annotations

import numpy as np

from whisker_array.identification.bench import BENCH_GAIN, OF_GAUGE, Unknown, of_whisker
from whisker_array.identification.fit import Identified

GAINS = "gains"


def undetermined(found: Identified, *, untold: float = 0.7) -> tuple[Unknown, ...]:
    """Numbers whose standard deviation stays above `untold` of what it was before."""
    names = [name for k, name in enumerate(Unknown) if found.sd[k] > untold * found.before[k]]
    return tuple(names)


def confounded(
    found: Identified, *, open_share: float = 0.25, least_part: float = 0.3
) -> tuple[tuple[str, ...], ...]:
    """Numbers of which only a combination is known; the gains as one.

    Args:
        found: what was identified.
        open_share: of the standard deviation before, above which a combination counts as open.
        least_part: of a unit direction, from which a number counts as one of those that share it.
    """
    scaled = found.covariance / np.outer(found.before, found.before)
    own = [of_whisker(w, n_whiskers=found.bench.gain.size) for w in found.whiskers]
    felt = [*range(len(Unknown)), *(i for one in own for i in one)]
    values, vectors = np.linalg.eigh(scaled[np.ix_(felt, felt)])
    names = [*(name.value for name in Unknown), *(name for _ in own for name in (GAINS, *OF_GAUGE[1:]))]
    groups: list[tuple[str, ...]] = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < open_share**2:
            break
        weight: dict[str, float] = {}
        for name, part in zip(names, vector, strict=True):
            weight[name] = weight.get(name, 0.0) + float(part**2)
        group = tuple(name for name, share in weight.items() if share > least_part**2)
        if len(group) > 1 and not any(set(group) <= set(other) for other in groups):
            groups.append(group)
    return tuple(groups)


def remedies(found: Identified) -> dict[str, dict[Unknown, float]]:
    """What would determine the open numbers, the best first, and the standard deviations that they would then have.

    Steps that would hardly help are left out.
    """
    open_ = undetermined(found)
    weights = np.zeros_like(found.covariance)
    for whisker in found.whiskers:
        weights[len(Unknown) + whisker, len(Unknown) + whisker] = 1.0 / BENCH_GAIN**2
    ways = [
        ("hang a known weight on each tip, which tells the gains to 0.5 %", weights),
        ("record the piece once more", _information(found)),
    ]
    made: dict[str, dict[Unknown, float]] = {}
    for what, more in ways:
        after = np.sqrt(np.diag(np.linalg.inv(np.linalg.inv(found.covariance) + more)))
        sd = {name: float(after[k]) for k, name in enumerate(Unknown) if name in open_}
        if any(value < 0.8 * found.of(name)[1] for name, value in sd.items()):
            made[what] = sd
    return dict(sorted(made.items(), key=lambda one: sum(sd / found.of(n)[1] for n, sd in one[1].items())))


def _information(found: Identified) -> np.ndarray:
    """(n, n) what the recording has added to what was known before: so much another one like it would add again."""
    scaled = found.covariance / np.outer(found.before, found.before)
    values, vectors = np.linalg.eigh(np.linalg.inv(scaled) - np.eye(found.before.size))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T / np.outer(found.before, found.before))
