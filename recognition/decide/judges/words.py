"""Places of a text in words."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby


def places_text(text: Sequence[str], places: Sequence[int], *, most_named: int = 3) -> str:
    """Characters and their places: "I at place 1, 7 at place 4"; if there are many, only places."""
    if len(places) > most_named:
        return ranges_text(places)
    return ", ".join(f"{text[k - 1]} at place {k}" for k in places)


def ranges_text(places: Sequence[int]) -> str:
    """Ascending places in words: "place 3", "places 1, 2 and 4 to 8"."""
    # within a run, a place minus its index is constant
    groups = groupby(enumerate(places), key=lambda item: item[1] - item[0])
    runs = [[k for _, k in group] for _, group in groups]
    words = [
        word
        for run in runs
        for word in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(k) for k in run])
    ]
    if len(places) == 1:
        return f"place {words[0]}"
    return "places " + (f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0])
