"""Regions of a view: shares of its width and height."""

from __future__ import annotations

from collections.abc import Iterable

from recognition.see.text_line import TextLine
from recognition.see.view import View

Region = tuple[float, float, float, float]
"""Left, top, right and bottom as shares of a view."""


def check_region(region: Region | None) -> None:
    """Check a region. Raises ValueError."""
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


def area_of(
    regions: Iterable[Region | None],
    *,
    # around a region, across and down, as shares of its size, since a line may extend beyond the region that
    # contains its middle
    margins: tuple[float, float] = (0.5, 1.0),
    most_of_view: float = 0.6,
) -> Region | None:
    """Area with all lines whose middle is in one of these regions; None if it is most of the view."""
    serial, *others = regions
    if serial is None:
        return None
    edges = []
    for left, top, right, bottom in (serial, *(region for region in others if region is not None)):
        wide, high = margins[0] * (right - left), margins[1] * (bottom - top)
        edges.append((left - wide, top - high, right + wide, bottom + high))
    lefts, tops, rights, bottoms = zip(*edges, strict=True)
    area = max(min(lefts), 0.0), max(min(tops), 0.0), min(max(rights), 1.0), min(max(bottoms), 1.0)
    return None if (area[2] - area[0]) * (area[3] - area[1]) > most_of_view else area


def within(region: Region | None, area: Region) -> Region | None:
    """A region of the whole as shares of an area that holds it."""
    if region is None:
        return None
    left, top, right, bottom = area
    wide, high = right - left, bottom - top
    shares = (
        (region[0] - left) / wide,
        (region[1] - top) / high,
        (region[2] - left) / wide,
        (region[3] - top) / high,
    )
    return (max(shares[0], 0.0), max(shares[1], 0.0), min(shares[2], 1.0), min(shares[3], 1.0))
