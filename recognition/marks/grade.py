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
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class GradeError(ValueError):
    """Arrays that do not go together, or rules that cannot be: the message says which."""


@dataclass(frozen=True)
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
        least_valid: share of the predicted edges that must have been felt over for a grade.
        passing: least grade that asks for nothing: C, as is usual.
        contrast: least values for the grades 4, 3, 2 and 1.
        completeness: least values for the same grades.
        contamination: greatest values for the same grades.

    Raises:
        GradeError: limits that are not four in order, a share beyond 0 to 1, a quantile beyond 0 to 100, or a grade
            beyond 0 to 4.
    """

    stroke_share: float = 0.3
    contrast_percentile: float = 75.0
    felt_share: float = 0.4
    least_felt: float = 0.1
    foreign_share: float = 0.5
    least_contrast: float = 0.3
    least_valid: float = 0.5
    passing: int = 2
    contrast: tuple[float, float, float, float] = (0.7, 0.55, 0.4, 0.25)
    completeness: tuple[float, float, float, float] = (0.92, 0.84, 0.75, 0.6)
    contamination: tuple[float, float, float, float] = (0.02, 0.05, 0.08, 0.15)

    def __post_init__(self) -> None:
        falling = (self.contrast, self.completeness, self.contamination[::-1])
        if any(len(limits) != 4 or list(limits) != sorted(limits, reverse=True) for limits in falling):
            raise GradeError(
                "limits are four: of contrast and completeness from the greatest to the least, of contamination the "
                "other way round"
            )
        shares = (self.stroke_share, self.felt_share, self.least_felt, self.foreign_share)
        if not all(0.0 <= share <= 1.0 for share in (*shares, self.least_contrast, self.least_valid)):
            raise GradeError(f"{self} has a share beyond 0 to 1")
        if not 0.0 <= self.contrast_percentile <= 100.0:
            raise GradeError(f"contrast_percentile is {self.contrast_percentile}; give 0 to 100")
        if self.passing not in range(5):
            raise GradeError(f"passing is {self.passing}; give a grade from 0 to 4")


GRADE_RULES = GradeRules()
LETTERS = "FDCBA"


class Action(StrEnum):
    """Action for a mark."""

    NONE = "none"
    CLEAN = "clean"
    CLEAN_FIRST = "clean first"
    RE_STRIKE = "re-strike"
    SCAN_AGAIN = "scan again"

    @property
    def message(self) -> str:
        """The action in words."""
        return _MESSAGES[self]


_MESSAGES = {
    Action.NONE: "nothing to do",
    Action.CLEAN: "clean it: there is dirt or damage in its place",
    Action.CLEAN_FIRST: (
        "strokes are missing: clean it and scan it again; if they are still missing, strike it again and check the die"
    ),
    Action.RE_STRIKE: "strike it again: it is too shallow",
    Action.SCAN_AGAIN: "too little of it was scanned for a grade: scan it again",
}


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
        parameters: contrast, completeness and contamination; empty when too little was felt.
        action: what to do.
    """

    parameters: tuple[Parameter, ...]
    action: Action

    def __repr__(self) -> str:
        values = ", ".join(f"{p.name} {p.grade}" for p in self.parameters)
        return f"MarkGrade({self.letter}: {values or 'not graded'}; {self.action.value})"

    @property
    def grade(self) -> int | None:
        """4 to 0, the worst of the parameters; None when too little was felt."""
        return min((p.grade for p in self.parameters), default=None)

    @property
    def letter(self) -> str:
        """A to F; "?" when too little was felt."""
        return "?" if self.grade is None else LETTERS[self.grade]

    @property
    def limiting(self) -> str:
        """The parameter that decides the grade; empty at grade 4 or without one."""
        if self.grade is None or self.grade == 4:
            return ""
        return min(self.parameters, key=lambda p: p.grade).name

    def value(self, name: str) -> float | None:
        """The value of a parameter; None where it is not known."""
        return next((p.value for p in self.parameters if p.name == name), None)


def grade_character(
    felt: NDArray[np.floating],
    predicted: NDArray[np.floating],
    valid: NDArray[np.floating] | NDArray[np.bool_] | None = None,
    *,
    tolerance_px: int = 1,
    rules: GradeRules = GRADE_RULES,
) -> MarkGrade:
    """Grade one character.

    Args:
        felt: (channels, rows, cols) edge map of its cell, in the template's units: 1 times the template where
            the mark is as it should be.
        predicted: the same, of the template in its place.
        valid: (rows, cols) weight of each pixel, 0 where nothing was measured (default: all 1).
        tolerance_px: how far an edge may lie from where it is predicted.
        rules: measures, and limits of their grades.

    Raises:
        GradeError: shapes that do not agree, values that are not numbers where weights are not 0, a template
            without edges.
    """
    weight = np.ones(felt.shape[1:]) if valid is None else np.asarray(valid, dtype=np.float64)
    _check(felt, predicted, weight, tolerance_px)
    known = weight > 0.0
    seen = np.where(known, felt, 0.0).astype(np.float64)
    size = np.abs(predicted).astype(np.float64)
    peak = float(size.max())
    stroke = size >= rules.stroke_share * peak
    length = size * stroke * weight
    if length.sum() < rules.least_valid * float((size * stroke).sum()):
        return MarkGrade((), Action.SCAN_AGAIN)
    rising, falling = reaching(seen, tolerance_px), reaching(-seen, tolerance_px)
    answer = np.clip(np.where(predicted > 0.0, rising, falling)[stroke] / size[stroke], 0.0, None)
    along = length[stroke]
    contrast = min(1.0, _percentile(answer, along, rules.contrast_percentile))
    share_felt = answer >= max(rules.felt_share * contrast, rules.least_felt)
    completeness = float(along[share_felt].sum() / along.sum())
    beside = ~_spread((size >= 0.1 * peak).any(axis=0), tolerance_px) & known
    foreign = np.abs(seen).max(axis=0) >= rules.foreign_share * peak * max(contrast, rules.least_contrast)
    area = float(weight[known].sum())
    contamination = float(weight[beside & foreign].sum()) / area
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


def reaching(values: NDArray[np.float64], pixels: int) -> NDArray[np.float64]:
    """The largest value within so many pixels, channel by channel."""
    down = values.copy()
    for move in range(1, pixels + 1):
        np.maximum(down[:, move:], values[:, :-move], out=down[:, move:])
        np.maximum(down[:, :-move], values[:, move:], out=down[:, :-move])
    out = down.copy()
    for move in range(1, pixels + 1):
        np.maximum(out[:, :, move:], down[:, :, :-move], out=out[:, :, move:])
        np.maximum(out[:, :, :-move], down[:, :, move:], out=out[:, :, :-move])
    return out


def _spread(mask: NDArray[np.bool_], pixels: int) -> NDArray[np.bool_]:
    return np.asarray(reaching(mask[None].astype(np.float64), pixels)[0] > 0.5)


def _percentile(values: NDArray[np.float64], weights: NDArray[np.float64], percent: float) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    k = int(np.searchsorted(below, percent / 100.0 * below[-1]))
    return float(values[order][min(k, values.size - 1)])


def _check(
    felt: NDArray[np.floating],
    predicted: NDArray[np.floating],
    weight: NDArray[np.float64],
    tolerance_px: int,
) -> None:
    if felt.ndim != 3 or felt.shape != predicted.shape or weight.shape != felt.shape[1:]:
        raise GradeError(
            f"felt {felt.shape}, predicted {predicted.shape} and valid {weight.shape} must be "
            "(channels, rows, cols), the same, and (rows, cols)"
        )
    if not (np.isfinite(weight).all() and (weight >= 0.0).all()):
        raise GradeError("weights must be finite and not negative; give 0 where nothing was measured")
    if not np.isfinite(predicted).all() or not np.isfinite(felt[:, weight > 0.0]).all():
        raise GradeError("felt and predicted must be numbers wherever the weight is not 0")
    if not np.abs(predicted).max(initial=0.0) > 0.0:
        raise GradeError("the template has no edges; give that of a character")
    if tolerance_px < 0:
        raise GradeError(f"tolerance_px is {tolerance_px}; it is not negative")
