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

STROKE_SHARE = 0.3
"""Share of the strongest predicted edge that counts as a stroke's edge."""
CONTRAST_PERCENTILE = 75.0
"""Quantile of the edge response along the strokes: a half-filled mark is judged by its rest."""
FELT_SHARE, LEAST_FELT = 0.4, 0.1
"""Share of the contrast, and of the predicted edge, from which an edge counts as felt."""
FOREIGN_SHARE = 0.5
"""Share of the strongest predicted edge times the contrast that is foreign where nothing is predicted."""
LEAST_CONTRAST = 0.3
"""Contrast that contamination is measured against at least: noise about a faint mark is not dirt."""
TOLERANCE_PIXELS = 1
"""Greatest distance of an edge from where it is predicted."""
LEAST_VALID = 0.5
"""Share of the predicted edges that must have been felt over for a grade."""
PASSING = 2
"""Least grade that asks for nothing: C, as is usual."""

LIMITS: dict[str, tuple[float, float, float, float]] = {
    "contrast": (0.7, 0.55, 0.4, 0.25),
    "completeness": (0.92, 0.84, 0.75, 0.6),
    "contamination": (0.02, 0.05, 0.08, 0.15),
}
"""Least values (of contamination the most) for the grades 4, 3, 2 and 1."""
LETTERS = "FDCBA"


class GradeError(ValueError):
    """Arrays that do not go together: the message says which."""


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
    tolerance_px: int = TOLERANCE_PIXELS,
) -> MarkGrade:
    """Grade one character.

    Args:
        felt: (channels, rows, cols) edge map of its cell, in the template's units: 1 times the template where
            the mark is as it should be.
        predicted: the same, of the template in its place.
        valid: (rows, cols) weight of each pixel, 0 where nothing was measured (default: all 1).
        tolerance_px: how far an edge may lie from where it is predicted.

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
    stroke = size >= STROKE_SHARE * peak
    length = size * stroke * weight
    if length.sum() < LEAST_VALID * float((size * stroke).sum()):
        return MarkGrade((), Action.SCAN_AGAIN)
    rising, falling = reaching(seen, tolerance_px), reaching(-seen, tolerance_px)
    answer = np.clip(np.where(predicted > 0.0, rising, falling)[stroke] / size[stroke], 0.0, None)
    along = length[stroke]
    contrast = min(1.0, _percentile(answer, along, CONTRAST_PERCENTILE))
    share_felt = answer >= max(FELT_SHARE * contrast, LEAST_FELT)
    completeness = float(along[share_felt].sum() / along.sum())
    beside = ~_spread((size >= 0.1 * peak).any(axis=0), tolerance_px) & known
    foreign = np.abs(seen).max(axis=0) >= FOREIGN_SHARE * peak * max(contrast, LEAST_CONTRAST)
    area = float(weight[known].sum())
    contamination = float(weight[beside & foreign].sum()) / area
    values = {"contrast": contrast, "completeness": completeness, "contamination": contamination}
    parameters = tuple(Parameter(name, value, grade_value(name, value)) for name, value in values.items())
    return MarkGrade(parameters, _action({p.name: p.grade for p in parameters}))


def grade_value(name: str, value: float) -> int:
    """The grade, 4 to 0, of a parameter's value."""
    limits = LIMITS[name]
    if name == "contamination":
        return sum(value <= limit for limit in limits)
    return sum(value >= limit for limit in limits)


def _action(grades: dict[str, int]) -> Action:
    shallow = grades["contrast"] < PASSING
    if grades["contamination"] < PASSING:
        return Action.CLEAN
    if grades["completeness"] < PASSING:
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
