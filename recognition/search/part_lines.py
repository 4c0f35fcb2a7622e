"""The lines of a part: requested formats, and lines that were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from recognition.combine.read_line import ReadLine
from recognition.language.grammar import Grammar
from recognition.views.text_line import TextLine
from recognition.views.view import View

Region = tuple[float, float, float, float]
"""Left, top, right and bottom as shares of a view."""


@dataclass(frozen=True)
class LineFormat:
    """A line that a part has besides its serial.

    Attributes:
        grammar: format of the line.
        region: region that contains its middle (default: anywhere).

    Raises:
        ValueError: an invalid region.
    """

    grammar: Grammar
    region: Region | None = None

    def __post_init__(self) -> None:
        check_region(self.region)


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
    across, down = (
        (max(left - wide, 0.0), min(right + wide, 1.0)),
        (max(top - high, 0.0), min(bottom + high, 1.0)),
    )
    if (across[1] - across[0]) * (down[1] - down[0]) > most_of_view:
        return view
    return view.cut(across, down)


@dataclass(frozen=True, eq=False)
class PartLines:
    """Lines read on a view.

    Attributes:
        main: the line of the serial; None if there is none.
        named: other requested lines that were found, by name.
        others: unassigned lines that can be read as well.
        candidates: places that look like the serial's line, the most promising first; they do not overlap.
    """

    main: ReadLine | None
    named: Mapping[str, ReadLine] = field(default_factory=lambda: MappingProxyType({}))
    others: tuple[ReadLine, ...] = ()
    candidates: tuple[TextLine, ...] = ()
