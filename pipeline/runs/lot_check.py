"""Duplicate check among the serials of a run.

Parts are read in any order, and some of them twice: the check is made once, on the final records of all parts.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.serial_rules import Objection, SerialAlarm, with_objection
from pipeline.common.texts import first_of, without_blanks
from pipeline.runs.lot import Outline

Repeats = Mapping[str, Sequence[str]]
"""Names of the parts by serial, of serials that several parts have."""


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
