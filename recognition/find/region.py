"""Regions of a view: shares of its width and height."""

from __future__ import annotations

from recognition.see.text_line import TextLine
from recognition.see.view import View

Region = tuple[float, float, float, float]
"""Left, top, right and bottom as shares of a view."""


def check_region(region: Region | None) -> None:
    """Check a region.

    Raises:
        ValueError: it is invalid.
    """
    if region is not None:
        left, top, right, bottom = region
        if not (0.0 <= left < right <= 1.0 and 0.0 <= top < bottom <= 1.0):
            raise ValueError(f"region {region} is invalid; give left, top, right, bottom as shares, 0 to 1")


def stands_in(region: Region | None, line: TextLine, view: View) -> bool:
    """Whether the middle of a line of a view lies in a region; None is the whole view."""
    if region is None:
        return True
    x, y = (line.centre_mm.mean(axis=0) - view.origin_mm) / view.size_mm
    left, top, right, bottom = region
    return bool(left <= x <= right and top <= y <= bottom)


def about_region(
    region: Region | None,
    view: View,
    *,
    margins: tuple[float, float] = (0.5, 1.0),
    most_of_view: float = 0.6,
) -> View:
    """Part of a view with all lines whose middle is in a region; the whole view if that is most of it.

    Args:
        margins: around a region, across and down, as shares of its size, since a line may extend beyond the region
            that contains its middle.
        most_of_view: share of the view above which the whole view is returned.
    """
    if region is None:
        return view
    left, top, right, bottom = region
    wide, high = margins[0] * (right - left), margins[1] * (bottom - top)
    across = max(left - wide, 0.0), min(right + wide, 1.0)
    down = max(top - high, 0.0), min(bottom + high, 1.0)
    if (across[1] - across[0]) * (down[1] - down[0]) > most_of_view:
        return view
    return view.cut(across, down)
