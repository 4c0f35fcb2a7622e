"""Learn a lot's die from its own parts: parts read with certainty give the shapes for reading the others again.

    first readings --teachers--> parts to enrol --learn_font--> a font --second readings--> better, or as they were

Readings are chosen by what they say, never by when they came: the order of the parts makes no difference.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable

from pipeline.common.reading_records import ReadingRecord

FEWEST_PARTS = 12
"""Least size of a lot to learn from: in a smaller one hardly a character occurs on three parts read with certainty."""
MOST_TEACHERS, EXEMPLARS_EACH = 40, 6
"""Most enrolled parts, and number of exemplars of a character after which no part is enrolled for it."""
LEAST_AGREEMENT = 0.7
"""Least share of exemplars that agree with their siblings, for parts of one die: blows of one die
agree in nine of ten and more, of two dies each set aside the other's."""
_MOST_LOOKED_AT = 2000


def teachers(readings: Iterable[ReadingRecord]) -> dict[str, str]:
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


def needs_another(reading: ReadingRecord) -> bool:
    """Whether a part must be read again: accepted and unreadable parts are not."""
    return reading.decision != "accept" and not reading.error


def is_better(second: ReadingRecord, first: ReadingRecord) -> bool:
    """Whether a part's second reading replaces its first.

    It does where it is accepted, or surer of the same text; never where the first was accepted.
    """
    if not needs_another(first) or second.error:
        return False
    return second.decision == "accept" or (second.text == first.text and second.confidence > first.confidence)
