"""Reasons why a part is not accepted, in words: the one or two that decide, in order.

flags --importance--> the first two --findings: places and numbers--> words
rules of the mark, what happened to the scan, notes ----------------> all of them, after these

A finding's words replace the flag's general ones. The user asked for the rules of the mark: every broken one is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from recognition.decide.decision import EXPLANATIONS, MEASURE_FLAGS, Finding, Kind, ReadingFlag
from recognition.language.code_text import holds

if TYPE_CHECKING:
    from recognition import Reading

ABOUT_SERIAL = ReadingFlag.of(Kind.CONTRACT, Kind.SCORE) | EXPLANATIONS
"""Doubts about a serial, most important first; a reading reports the first one (`reasons_of`)."""


def reasons_of(reading: Reading, *, most_reasons: int = 2) -> tuple[Finding, ...]:
    """Return the reasons of a reading, then other findings, then notes."""
    about = ABOUT_SERIAL
    if reading.flags & ReadingFlag.FORMAT_NOT_MET:
        # what is read is clear: doubts under a format that does not fit it are no doubts about the part
        about &= ~(EXPLANATIONS | ReadingFlag.LOW_CONFIDENCE | ReadingFlag.FORMAT_OVERRULED)
    reasons = [findings for flag in about if (findings := _findings(reading, flag))]
    rules = _findings(reading, reading.flags & MEASURE_FLAGS)
    scan = _findings(reading, reading.flags & ~(ABOUT_SERIAL | MEASURE_FLAGS))
    named = [finding for findings in reasons[:most_reasons] for finding in findings]
    beside = (
        f"another line reads “{line.text}”, which does not fit the serial's format"
        for line in reading.others
        if not line.name and not line.may_be_serial
    )
    same = (
        f"the {code.kind} holds the same serial" for code in reading.codes if holds(code.text, reading.text)
    )
    notes = (Finding(ReadingFlag.NONE, text) for text in (*beside, *same, *reading.notes))
    return (*named, *rules, *scan, *notes)


def _findings(reading: Reading, flag: ReadingFlag) -> tuple[Finding, ...]:
    if not reading.flags & flag:
        return ()
    distinct = tuple({finding.text: finding for finding in reading.findings if finding.flag & flag}.values())
    return distinct if flag & ReadingFlag.LOW_CONFIDENCE else _merge(distinct)


def _merge(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    merged: dict[str, Finding] = {}
    for finding in findings:
        head, colon, why = finding.text.partition(": ")
        before = merged.get(key := colon + why or finding.text)
        if before is not None:
            text = f"{before.text.removesuffix(colon + why)}, {head}{colon}{why}" if colon else before.text
            finding = replace(before, text=text, places=before.places + finding.places)
        merged[key] = finding
    return tuple(merged.values())
