"""Precision of a run before it starts: widths of intervals, and the parts that a width needs."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence

from pipeline.benchmark.exam.specimens import Item

Z_95 = 1.959963984540054
"""97.5 % quantile of the normal distribution."""
WORST_SHARE, GOOD_SHARE = 0.5, 0.98
WANTED = 0.02
MOST_PARTS = 10**9
"""More than any interval takes that can be asked for, ±0.002 % and wider."""


def half_width(parts: int, share: float) -> float:
    """Half the width of Wilson's 95 % interval of a share that so many parts show.

    Raises:
        ValueError: no part, or no share.
    """
    if parts < 1 or not 0.0 <= share <= 1.0:
        raise ValueError(f"{share} of {parts} parts is not a share")
    z2 = Z_95**2
    return Z_95 / (1.0 + z2 / parts) * math.sqrt(share * (1.0 - share) / parts + z2 / (4.0 * parts**2))


def parts_needed(wanted: float, share: float) -> int:
    """The fewest parts whose Wilson interval is no wider than +- wanted.

    Raises:
        ValueError: wanted is not between 0 and 1, or no share.
    """
    if not 0.0 < wanted < 1.0:
        raise ValueError(f"an interval of +-{wanted} is not between 0 and 1")
    widths = range(1, MOST_PARTS)
    return 1 + bisect_left(widths, x=True, key=lambda parts: half_width(parts, share) <= wanted)


def foresight(items: Sequence[Item], crossed: Sequence[str]) -> str:
    """One line on how sure the cells of a design will be: those of the crossed factors."""
    cells = Counter(tuple(item.condition.get(name) for name in crossed) for item in items)
    if not cells:
        return "no parts"
    fewest = min(cells.values())
    of = f"{len(cells)} cells of {fewest}" if len(cells) > 1 else f"{fewest}"
    parts = "part" if fewest == 1 else "parts"
    return (
        f"{of} {parts}: serials ±{half_width(fewest, WORST_SHARE):.0%} at worst, "
        f"±{half_width(fewest, GOOD_SHARE):.0%} near {GOOD_SHARE:.0%}; "
        f"±{WANTED:.0%} takes {parts_needed(WANTED, WORST_SHARE):,} or {parts_needed(WANTED, GOOD_SHARE):,}"
    )
