"""Rules for the readings of a lot, whose parts are read in any order, and some of them twice. Parts read with
certainty, chosen by their content, give the shapes for reading the others again."""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.serial_rules import Objection, SerialAlarm, with_objection
from pipeline.common.texts import first_of, without_blanks

FEWEST_PARTS = 12
"""Least size of a lot to learn from: in a smaller one hardly a character occurs on three parts read with certainty."""
MOST_TEACHERS = 40  # enrolled parts
EXEMPLARS_EACH = 6  # of a character, after which no further part is enrolled for it
LEAST_AGREEMENT = 0.7
"""Least share of exemplars that agree with others of their character: nine in ten do of one die, none of two dies."""
_MOST_CONSIDERED = 2000


class Outline(NamedTuple):
    """What the passes over a lot go by, of a reading."""

    part: str
    decision: str
    text: str
    confidence: float
    error: str = ""


def teachers(readings: Iterable[Outline]) -> dict[str, str]:
    """Texts, by name, of accepted parts, surest first, that add a character of which there are few exemplars."""
    sure = (reading for reading in readings if reading.decision == "accept" and not reading.error)
    chosen: dict[str, str] = {}
    exemplars: Counter[str] = Counter()
    for reading in heapq.nsmallest(_MOST_CONSIDERED, sure, key=lambda sure: (-sure.confidence, sure.part)):
        if len(chosen) == MOST_TEACHERS:
            break
        text = "".join(reading.text.split())
        if any(exemplars[char] < EXEMPLARS_EACH for char in text):
            chosen[reading.part] = text
            exemplars.update(text)
    return dict(sorted(chosen.items()))


def needs_another(reading: Outline) -> bool:
    """Whether a part must be read again: accepted and unreadable parts are not."""
    return reading.decision != "accept" and not reading.error


def is_better(second: Outline, first: Outline) -> bool:
    """Whether a second reading replaces one that is not accepted: it is accepted, or surer of the same text."""
    if not needs_another(first) or second.error:
        return False
    return second.decision == "accept" or (second.text == first.text and second.confidence > first.confidence)


Repeats = Mapping[str, Sequence[str]]  # names of the parts by serial, of serials that several parts have


def find_repeats(readings: Iterable[Outline]) -> Repeats:
    """Find the serials with which several parts were accepted."""
    parts = defaultdict[str, list[str]](list)
    for reading in readings:
        if reading.decision == "accept":
            parts[without_blanks(reading.text)].append(reading.part)
    return {text: names for text, names in parts.items() if len(names) > 1}


def repeated(record: ReadingRecord, repeats: Repeats) -> Objection | None:
    """The objection to an accepted part whose serial other parts have: any of them may be the wrong one."""
    others = [name for name in repeats.get(without_blanks(record.text), ()) if name != record.part]
    if record.decision != "accept" or not others:
        return None
    return Objection(SerialAlarm.READ_BEFORE, f"{record.text} was also read on {first_of(others)}")


def reviewed(record: ReadingRecord, objection: Objection | None) -> ReadingRecord:
    """Send a record to review if there is an objection."""
    return record if objection is None else replace(with_objection(record, objection), decision="review")
