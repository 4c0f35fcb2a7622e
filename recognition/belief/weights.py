"""What each expert's belief is worth beside the others', by how doubtful the place is.

    power of expert e at a place = sure_e + doubt_e * d        d: mean of 1 - (share of the likeliest), over experts

Dirt that leaves one expert in doubt leaves the others in doubt, too, and not alike. The numbers stand in
`weights.fit.json`, with what they were fitted on; `python -m pipeline.benchmark.fit_beliefs` fits them.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from recognition.views.view import ViewKind

EXPERTS = ("own", "print", "templates")
"""Our own recogniser, the generic one of print, templates of fonts."""
NETWORKS = frozenset({"own", "print"})
FITTED = Path(__file__).with_name("weights.fit.json")


@dataclass(frozen=True)
class Power:
    """To which an expert's belief is taken, at a place of no doubt, and more or less of it with doubt."""

    sure: float
    doubt: float = 0.0


@dataclass(frozen=True)
class ExpertWeights:
    """What experts are worth in one kind of view.

    Attributes:
        powers: by expert.
        slip: least share of belief that all allowed characters have together, whatever the experts say.

    Raises:
        ValueError: a slip that is no share.
    """

    powers: Mapping[str, Power]
    slip: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.slip < 0.5:
            raise ValueError(f"slip is {self.slip}; it is a share below 0.5")

    def among(self, experts: Collection[str]) -> ExpertWeights:
        """The weights where only these have a say: one network without the other is taken at its word.

        Their powers were fitted for both; one alone to such a power would be less sure than it is right.
        """
        alone = NETWORKS & {*experts}
        return (
            replace(self, powers={**self.powers, **{name: Power(1.0) for name in alone}})
            if len(alone) == 1
            else self
        )


@cache
def weights_of(kind: ViewKind) -> ExpertWeights:
    """Of a kind of view, as they were fitted; heights that an instrument measured count as felt."""
    told = json.loads(FITTED.read_text(encoding="utf-8"))["weights"]
    own = told["photo" if kind is ViewKind.PHOTO else "felt"]
    return ExpertWeights({name: Power(**power) for name, power in own["powers"].items()}, own["slip"])
