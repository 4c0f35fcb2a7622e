"""Boxes on the plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np


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
    corners = np.array([astuple(box) for box in boxes])
    return Box(*corners[:, :2].min(axis=0).tolist(), *corners[:, 2:].max(axis=0).tolist())
