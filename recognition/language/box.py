"""Boxes on the plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Box:
    """A rectangle of the plate frame, mm."""

    x0_mm: float
    y0_mm: float
    x1_mm: float
    y1_mm: float

    def __post_init__(self) -> None:
        if self.x1_mm < self.x0_mm or self.y1_mm < self.y0_mm:
            raise ValueError(f"{self} ends before it begins; x0 <= x1 and y0 <= y1 are needed")

    def __repr__(self) -> str:
        return f"Box({self.x0_mm:.6g}, {self.y0_mm:.6g}, {self.x1_mm:.6g}, {self.y1_mm:.6g})"


def hull(boxes: Sequence[Box]) -> Box | None:
    """Return the common hull of boxes; None if there are none."""
    if not boxes:
        return None
    return Box(
        min(box.x0_mm for box in boxes),
        min(box.y0_mm for box in boxes),
        max(box.x1_mm for box in boxes),
        max(box.y1_mm for box in boxes),
    )
