"""Precision of a run before it starts: widths of intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pipeline.benchmark.exam.specimens import Item
from pipeline.common.shares import share

WORST_SHARE, GOOD_SHARE = 0.5, 0.98


def foresight(items: Sequence[Item], crossed: Sequence[str]) -> str:
    """One line on how sure the cells of a design will be: those of the crossed factors."""
    cells = Counter(tuple(item.condition.get(name) for name in crossed) for item in items)
    fewest = min(cells.values())
    worst, good = (share(round(fewest * value), fewest) for value in (WORST_SHARE, GOOD_SHARE))
    return (
        f"{len(cells)} {'cells' if len(cells) > 1 else 'cell'}, the smallest of {fewest} "
        f"{'parts' if fewest > 1 else 'part'}; its serials right to ±{(worst.high - worst.low) / 2:.0%} at worst, "
        f"±{(good.high - good.low) / 2:.0%} near {GOOD_SHARE:.0%}"
    )
