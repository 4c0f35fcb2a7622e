"""Learn a lot's die from its own parts: parts read with certainty give the shapes for reading the others again.

    first readings --teachers--> parts to enrol --learn_font--> a font --second readings--> better, or as they were

Readings are chosen by what they say, never by when they came: the order of the parts makes no difference.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

FEWEST_PARTS = 12
"""Least size of a lot to learn from: in a smaller one hardly a character occurs on three parts read with certainty."""
MOST_TEACHERS, EXEMPLARS_EACH = 40, 6
"""Most enrolled parts, and number of exemplars of a character after which no part is enrolled for it."""
LEAST_AGREEMENT = 0.7
"""Least share of exemplars that agree with their siblings, for parts of one die: blows of one die
agree in nine of ten and more, of two dies each set aside the other's."""
_MOST_LOOKED_AT = 2000


class ReadText(Protocol):
    """A part that was read: its record or row."""

    @property
    def part(self) -> str:
        """Name of the part."""

    @property
    def text(self) -> str:
        """The serial that was read."""

    @property
    def decision(self) -> str:
        """Accept, review or reject; empty with an error."""

    @property
    def confidence(self) -> float:
        """Probability that the text is right, 0 to 1."""

    @property
    def error(self) -> str:
        """Reason why there is no reading; otherwise empty."""


def teachers(readings: Iterable[ReadText]) -> dict[str, str]:
    """Parts whose characters the lot learns from, and their texts, by name.

    Those that were accepted, surest first, as long as each adds a character that is still rare.

    Args:
        readings: readings of the lot, in any order.
    """
    sure = (one for one in readings if one.decision == "accept" and not one.error)
    chosen: dict[str, str] = {}
    found: Counter[str] = Counter()
    for one in heapq.nsmallest(_MOST_LOOKED_AT, sure, key=lambda one: (-one.confidence, one.part)):
        if len(chosen) == MOST_TEACHERS:
            break
        text = "".join(one.text.split())
        if any(found[char] < EXEMPLARS_EACH for char in text):
            chosen[one.part] = text
            found.update(text)
    return dict(sorted(chosen.items()))


def needs_another(reading: ReadText) -> bool:
    """Whether a part must be read again: accepted and unreadable parts are not."""
    return reading.decision != "accept" and not reading.error


def is_better(second: ReadText, first: ReadText) -> bool:
    """Whether a part's second reading replaces its first.

    It does where it is accepted, or surer of the same text; never where the first was accepted.
    """
    if not needs_another(first) or second.error:
        return False
    return second.decision == "accept" or (second.text == first.text and second.confidence > first.confidence)


def agreement(chars: Sequence[str], used: Mapping[str, Sequence[int]]) -> float:
    """Share of the exemplars that agree with their siblings; 1 if none has enough of them.

    Args:
        chars: character of each exemplar.
        used: for each character the indices of those that agree (`recognition.learning.learned_font.Learned.used`).
    """
    from recognition.learning.learned_font import FEWEST_SIBLINGS  # slow to import

    many = {char: n for char, n in Counter(chars).items() if n >= FEWEST_SIBLINGS}
    if not many:
        return 1.0
    return sum(len(used.get(char, ())) for char in many) / sum(many.values())
