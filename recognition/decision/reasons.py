"""Reasons why a part is not accepted, in words: the one or two that decide, in order.

flags --importance--> the first two --findings: places and numbers--> words
rules of the mark, what happened to the scan, notes ----------------> all of them, after these

A finding says what a flag means on this part and replaces the flag's general words. The user asked for the
rules of the mark, so every broken rule is named.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING

from recognition.decision.decide import MEASURE_FLAGS, Finding, Kind, ReadingFlag, flags_of
from recognition.language.code_text import holds
from recognition.language.confusions import CharacterState

if TYPE_CHECKING:
    from recognition import Reading

ABOUT_SERIAL = ReadingFlag.of(Kind.CONTRACT, Kind.SCORE, Kind.EXPLANATION)
"""Doubts about a serial, most important first; a reading reports the first one (`reasons_of`)."""


def reasons_of(reading: Reading, *, most_reasons: int = 2) -> tuple[Finding, ...]:
    """Return the reasons of a reading, then other findings, then notes.

    Args:
        reading: reading of the part.
        most_reasons: most flags about the serial that are named.
    """
    about = ABOUT_SERIAL
    if reading.flags & ReadingFlag.FORMAT_NOT_MET:
        # what is read is clear: doubts under a format that does not fit it are no doubts about the part
        about &= ~(
            ReadingFlag.of(Kind.EXPLANATION) | ReadingFlag.LOW_CONFIDENCE | ReadingFlag.FORMAT_OVERRULED
        )
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
    """Return the findings of a flag, or of several flags that give one reason; empty if none is set."""
    if not reading.flags & flag:
        return ()
    found = tuple({finding.text: finding for finding in reading.findings if finding.flag & flag}.values())
    if flag & ReadingFlag.LOW_CONFIDENCE:
        found = (*found, *_doubts(reading, explained=bool(found)))
        if found:
            return found
    bare = flag & reading.flags & ~flags_of(reading.findings)
    return (*_merge(found), *(Finding(one, one.text) for one in bare))


def _merge(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Merge findings with the same explanation: "P or W at place 1, 3 or 2 at place 3: ..."."""
    made: dict[str, Finding] = {}
    for finding in findings:
        head, colon, why = finding.text.partition(": ")
        before = made.get(key := colon + why or finding.text)
        if before is not None:
            text = f"{before.text.removesuffix(colon + why)}, {head}{colon}{why}" if colon else before.text
            finding = replace(before, text=text, places=before.places + finding.places)
        made[key] = finding
    return tuple(made.values())


def _doubts(reading: Reading, *, explained: bool, count_share: float = 0.9) -> Iterator[Finding]:
    """Name the doubtful characters: rivals, unreadable places, their number; else the least certain one.

    Args:
        reading: reading of the part.
        explained: whether another finding says why the confidence is low.
        count_share: the number of characters is doubted if the confidence is below this share of the product of theirs.
    """
    low, why = ReadingFlag.LOW_CONFIDENCE, reading.shortfall or ReadingFlag.LOW_CONFIDENCE.text
    places = tuple(enumerate(reading.characters, start=1))
    unread = [k for k, c in places if c.state is not None and c.state.state is CharacterState.NOT_READ]
    rivals = _rivals(reading)
    if rivals:
        yield Finding(low, f"{why}: {', '.join(rivals.values())}?", tuple(rivals))
    if unread:
        text = f"no character can be made out: {_ranges(unread)} (look at the part)"
        yield Finding(low, text, tuple(unread))
    if rivals or unread or explained or not places:
        return
    if reading.confidence < count_share * math.prod(c.confidence for _, c in places):
        yield Finding(low, f"{why}: are there {len(places)} characters?")
    elif len(places) > 1:
        k, least = min(places, key=lambda place: place[1].confidence)
        yield Finding(low, f"{why}: {least.char} at place {k} is the least certain", (k,))
    elif reading.shortfall:
        yield Finding(low, why)


def _rivals(reading: Reading, *, doubted: float = 0.05, most_places: int = 2) -> dict[int, str]:
    """The places that are hardest to decide, worst first: 2: "B or 8 at place 2", 5: "1 or I at place 5".

    Args:
        reading: reading of the part.
        doubted: least probability of a second candidate for its place to be named.
        most_places: most places that are named for low confidence.
    """
    places = [
        (c.margin, f"{c.char} or {c.candidates[1].char} at place {k}", k)
        for k, c in enumerate(reading.characters, start=1)
        if len(c.candidates) > 1
        and c.candidates[1].probability >= doubted
        and not (c.state is not None and c.state.state is CharacterState.NOT_READ)
    ]
    return {k: text for _, text, k in sorted(places)[:most_places]}


def places_text(reading: Reading, places: Sequence[int], *, most_named: int = 3) -> str:
    """Characters and their places: "I at place 1, 7 at place 4"; if there are many, only places.

    Args:
        reading: reading of the part.
        places: places, from 1, ascending.
        most_named: most characters that are named one by one.
    """
    if len(places) > most_named:
        return _ranges(places)
    return ", ".join(f"{reading.characters[k - 1].char} at place {k}" for k in places)


def _ranges(places: Sequence[int]) -> str:
    """Ascending places in words: "place 3", "places 1, 2 and 4 to 8"."""
    # within a run, a place minus its index is constant
    groups = groupby(enumerate(places), key=lambda one: one[1] - one[0])
    runs = [[k for _, k in group] for _, group in groups]
    words = [
        word
        for run in runs
        for word in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(k) for k in run])
    ]
    if len(places) == 1:
        return f"place {words[0]}"
    return "places " + (f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0])
