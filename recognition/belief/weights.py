"""Weights of the templates' belief beside the recogniser's, by how doubtful a place is.

    power of an expert at a place = sure + doubt * d        d: mean of 1 - (share of the likeliest), over experts

The recogniser is taken at its word. Templates know the shapes of a font and nothing of dirt: where the recogniser is
sure they hardly count, where it is not they help.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from recognition.views.view import ViewKind

EXPERTS = ("network", "templates")
"""The recogniser, and templates of fonts."""


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


def weights_of(
    kind: ViewKind,
    *,
    felt: Power = Power(0.3, 0.4),
    photo: Power = Power(0.6, 0.2),
    slip: float = 1e-4,
) -> ExpertWeights:
    """Of a kind of view; heights that an instrument measured count as felt.

    Args:
        kind: of the view.
        felt: power of templates of what was felt; fitted on 127 lines of held-out fonts, rounded (2026-11-22).
        photo: of templates of a photograph; on misread parts of marks-exam-1-48.
        slip: as the class has it.
    """
    return ExpertWeights(
        {"network": Power(1.0), "templates": photo if kind is ViewKind.PHOTO else felt}, slip
    )
