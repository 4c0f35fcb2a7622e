"""Promise of a line: its evidence against a guess, by which lines are ranked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from recognition.recogniser.read_line import ReadLine


def is_convincing(lines: Sequence[ReadLine], share: float) -> bool:
    """Whether the first line's promise exceeds `share` of its maximum."""
    return (
        bool(lines) and lines[0].lattice.n_places > 1 and lines[0].promise > share * lines[0].lattice.n_places
    )


def rank(lines: Iterable[ReadLine]) -> list[ReadLine]:
    """Sort lines, most promising first."""
    return sorted(lines, key=promise_of, reverse=True)


def promise_of(read: ReadLine, *, turned_cost: float = 1.5, bent_cost: float = 0.05) -> float:
    """Line score minus penalties, nats, for rotation and for an arc."""
    turned, bent = abs(read.line.turned_deg) > 45.0, len(read.line.centre_mm) > 2
    return read.promise - turned_cost * turned - bent_cost * bent


def share_of(read: ReadLine) -> float:
    """Promise of a line as a share of its maximum."""
    return promise_of(read) / max(read.lattice.n_places, 1)
