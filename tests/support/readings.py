"""Readings made up for tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.reading import Box, Candidate, CharacterReading, Reading

BOX = Box(0.0, 0.0, 1.0, 1.0)


def reading_of(
    text: str,
    confidence: float = 0.99,
    *,
    beliefs: float | Sequence[float] = 0.99,
    flags: ReadingFlag = ReadingFlag.NONE,
    findings: Sequence[Finding] = (),
    **more: Any,
) -> Reading:
    """A text, each place believed so much, with flags in general words; `more` is for the reading."""
    each = [beliefs] * len(text) if isinstance(beliefs, float) else beliefs
    places = (CharacterReading((Candidate(c, 1.0, p),), BOX) for c, p in zip(text, each, strict=True))
    return Reading(tuple(places), confidence, (*map(Finding.of, flags), *findings), **more)


def traced(reading: Reading, **fields: Any) -> Reading:
    """The reading with these fields of its trace."""
    return replace(reading, trace=replace(reading.trace, **fields))
