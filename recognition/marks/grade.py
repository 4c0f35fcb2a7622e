"""Grade of a character's mark, and the action that it calls for, in the spirit of ISO/IEC 29158.

That standard (direct part marking, from the AIM DPM guideline) grades each parameter of a mark from 4 to 0 and lets
the worst one count; so here, but what is graded is what a whisker feels:

    template predicts   ..../^\\____/^\\....     contrast       how strong its edges, where they are felt
    felt                ..../^\\____.........     completeness   how much of its strokes is felt at all
                          felt   filled  swarf    contamination  how much else is felt in its cell

A shallow mark has low contrast everywhere, a filled one has none in places. The
limits are ours, chosen for touch; they are not those of the standard, which grades two-dimensional codes by sight.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass as checked
from scipy import ndimage

from glyphs.surface.display import WordedEnum
from recognition.ranges import GradeValue, Percent, Share

FourShares: TypeAlias = tuple[Share, Share, Share, Share]
"""Limits of the grades 4, 3, 2 and 1."""


@checked(frozen=True)
class GradeRules:
    """Measures of a mark and the limits of its grades.

    Attributes:
        stroke_share: share of the strongest predicted edge that counts as a stroke's edge.
        contrast_percentile: quantile of the edge response along the strokes: a half-filled mark is judged by its rest.
        felt_share: share of the contrast from which an edge counts as felt.
        least_felt: share of the predicted edge that it must reach as well.
        foreign_share: share of the strongest predicted edge times the contrast that is foreign where nothing is
            predicted.
        least_contrast: contrast that contamination is measured against at least: noise about a faint mark is not dirt.
        passing: least grade that asks for nothing: C, as is usual.
        contrast: least values for the grades 4, 3, 2 and 1.
        completeness: least values for the same grades.
        contamination: greatest values for the same grades.

    Raises:
        ValueError: limits that are not four in order, or a number out of range.
    """

    stroke_share: Share = 0.3
    contrast_percentile: Percent = 75.0
    felt_share: Share = 0.4
    least_felt: Share = 0.1
    foreign_share: Share = 0.5
    least_contrast: Share = 0.3
    passing: GradeValue = 2
    contrast: FourShares = (0.7, 0.55, 0.4, 0.25)
    completeness: FourShares = (0.92, 0.84, 0.75, 0.6)
    contamination: FourShares = (0.02, 0.05, 0.08, 0.15)

    def __post_init__(self) -> None:
        for limits in (self.contrast, self.completeness, self.contamination[::-1]):
            if list(limits) != sorted(limits, reverse=True):
                raise ValueError(
                    "limits of contrast and completeness fall, those of contamination rise from grade 4 to 1"
                )


GRADE_RULES = GradeRules()
LETTERS = "FDCBA"


class Action(WordedEnum):
    """Action for a mark."""

    NONE = "none", "nothing to do"
    CLEAN = "clean", "clean it: there is dirt or damage in its place"
    CLEAN_FIRST = (
        "clean first",
        "strokes are missing: clean it and scan it again; if they are still missing, strike it again and check the die",
    )
    RE_STRIKE = "re-strike", "strike it again: it is too shallow"


@dataclass(frozen=True)
class Parameter:
    """One measure of a mark: its value, 0 to 1, and its grade, 4 to 0."""

    name: str
    value: float
    grade: int

    @property
    def letter(self) -> str:
        """A for 4 to F for 0."""
        return LETTERS[self.grade]


@dataclass(frozen=True)
class MarkGrade:
    """The grade of one character.

    Attributes:
        parameters: contrast, completeness and contamination.
        action: what to do.
    """

    parameters: tuple[Parameter, ...]
    action: Action

    def __repr__(self) -> str:
        values = ", ".join(f"{p.name} {p.grade}" for p in self.parameters)
        return f"MarkGrade({self.letter}: {values}; {self.action.value})"

    @property
    def worst(self) -> Parameter:
        """The parameter that decides the grade; of equal ones the first."""
        return min(self.parameters, key=lambda p: p.grade)

    @property
    def grade(self) -> int:
        """4 to 0, the worst of the parameters."""
        return self.worst.grade

    @property
    def letter(self) -> str:
        """A to F."""
        return self.worst.letter

    @property
    def limiting(self) -> str:
        """The parameter that decides the grade; empty at grade 4."""
        return self.worst.name if self.grade < 4 else ""

    def value(self, name: str) -> float | None:
        """The value of a parameter; None where it was not measured."""
        return next((p.value for p in self.parameters if p.name == name), None)


def grade_character(
    felt: NDArray[np.floating],
    predicted: NDArray[np.floating],
    *,
    tolerance_px: int = 1,
    rules: GradeRules = GRADE_RULES,
) -> MarkGrade | None:
    """Grade one character; None where the template predicts no edge.

    Args:
        felt: (channels, rows, cols) edge map of its cell, in the template's units: 1 times the template where
            the mark is as it should be.
        predicted: the same, of the template in its place.
        tolerance_px: how far an edge may lie from where it is predicted.
        rules: measures, and limits of their grades.
    """
    felt, size = felt.astype(np.float64), np.abs(predicted).astype(np.float64)
    peak = float(size.max(initial=0.0))
    if peak == 0.0:
        return None
    stroke = size >= rules.stroke_share * peak
    near = partial(ndimage.maximum_filter, size=(1, *(2 * tolerance_px + 1,) * 2), mode="nearest")
    along = size[stroke]
    answer = np.clip(np.where(predicted > 0.0, near(felt), near(-felt))[stroke] / along, 0.0, None)
    contrast = min(1.0, _percentile(answer, along, rules.contrast_percentile))
    share_felt = answer >= max(rules.felt_share * contrast, rules.least_felt)
    completeness = float(along[share_felt].sum() / along.sum())
    beside = ~near(size >= 0.1 * peak).any(axis=0)
    foreign = np.abs(felt).max(axis=0) >= rules.foreign_share * peak * max(contrast, rules.least_contrast)
    contamination = float((beside & foreign).sum() / beside.size)
    values = {"contrast": contrast, "completeness": completeness, "contamination": contamination}
    parameters = tuple(
        Parameter(name, value, grade_value(name, value, rules=rules)) for name, value in values.items()
    )
    return MarkGrade(parameters, _action({p.name: p.grade for p in parameters}, rules.passing))


def grade_value(name: str, value: float, *, rules: GradeRules = GRADE_RULES) -> int:
    """The grade, 4 to 0, of a parameter's value."""
    if name == "contamination":
        return sum(value <= limit for limit in rules.contamination)
    limits = {"contrast": rules.contrast, "completeness": rules.completeness}[name]
    return sum(value >= limit for limit in limits)


def _action(grades: dict[str, int], passing: int) -> Action:
    shallow = grades["contrast"] < passing
    if grades["contamination"] < passing:
        return Action.CLEAN
    if grades["completeness"] < passing:
        # dirt beside the strokes, or strokes as deep as they should be where they are felt: likely filled
        return Action.RE_STRIKE if shallow and grades["contamination"] == 4 else Action.CLEAN_FIRST
    return Action.RE_STRIKE if shallow else Action.NONE


def _percentile(values: NDArray[np.float64], weights: NDArray[np.float64], percent: float) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    k = int(np.searchsorted(below, percent / 100.0 * below[-1]))
    return float(values[order][min(k, values.size - 1)])
