"""The one place where a reading is built: beliefs in, doubts and accept, review or reject out.

characters, confidence --thresholds--> LOW_CONFIDENCE, AMBIGUOUS ----+
choice, grammar -------> FORMAT_OVERRULED, SEARCH_EXHAUSTED, CHECK_BLIND --> any doubt: review --> Reading
flags of who has read it --------------------------------------------+       half unread: reject
strokes felt -----------> STROKES_MISSING, STROKES_UNDECIDED --------+       (recognition.decision.accept)
rules for the marks ----> TOO_SHALLOW, TOO_DEEP, BURR_TOO_HIGH ... --+

Accept means that nothing is left to do. So an accepted part asks for no action (`Reading.actions`); its grades still
say how well it is marked, and dirt beside strokes that are all there costs a grade and no acceptance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from recognition.decision.accept import decided_anew, decision_of
from recognition.decision.flags import Finding, ReadingFlag, flags_of
from recognition.decision.reading import CharacterReading, Decision, Reading
from recognition.language.constrained_decoding import Choice, ChoiceFlag, blind_warnings
from recognition.language.grammar import Grammar

LEAST_VALID_MASS = 0.02
"""Belief in all serials of the format together below which another one stands there."""
CHOICE_FLAGS = (
    ReadingFlag.LOW_CONFIDENCE
    | ReadingFlag.AMBIGUOUS
    | ReadingFlag.FORMAT_OVERRULED
    | ReadingFlag.SEARCH_EXHAUSTED
    | ReadingFlag.CHECK_BLIND
)
"""What `decided` may set."""


class Thresholds(Protocol):
    """What a decision needs of the settings."""

    @property
    def accept_confidence(self) -> float:
        """Least confidence for acceptance."""

    @property
    def accept_margin(self) -> float:
        """Least margin for acceptance."""


def decided(
    characters: Sequence[CharacterReading],
    confidence: float,
    settings: Thresholds,
    *,
    flags: ReadingFlag = ReadingFlag.NONE,
    choice: Choice | None = None,
    grammar: Grammar | None = None,
    findings: tuple[Finding, ...] = (),
    **about: Any,
) -> Reading:
    """The reading of these characters; rejected without any.

    Args:
        characters: left to right.
        confidence: that all of them are right.
        settings: thresholds of acceptance.
        flags: known beside what is found out here.
        choice: what the grammar made of the beliefs, if it was asked.
        grammar: that the choice was made under.
        findings: known beside what is found out here; their flags are set.
        about: other fields of the reading.
    """
    flags |= flags_of(findings)
    if not characters:
        flags |= ReadingFlag.NO_CHARACTERS
        return Reading((), Decision.REJECT, 0.0, flags, findings=findings, **about)
    if confidence < settings.accept_confidence:
        flags |= ReadingFlag.LOW_CONFIDENCE
    if min(c.margin for c in characters) < settings.accept_margin:
        flags |= ReadingFlag.AMBIGUOUS
    if choice is not None:
        if choice.valid_mass < LEAST_VALID_MASS or not choice.text:
            flags |= ReadingFlag.FORMAT_OVERRULED
        if ChoiceFlag.EXHAUSTED in choice.flags:
            flags |= ReadingFlag.SEARCH_EXHAUSTED
    made = Reading(
        tuple(characters),
        decision_of(flags, characters),
        confidence,
        flags,
        findings=findings,
        threshold=settings.accept_confidence,
        **about,
    )
    return made if choice is None or grammar is None else check_doubted(made, choice, grammar)


def check_doubted(reading: Reading, choice: Choice, grammar: Grammar) -> Reading:
    """The reading, doubted where the check digit cannot tell a character from its rival."""
    blind = blind_warnings(choice, grammar) if choice.text else ()
    if not blind:
        return reading
    return decided_anew(reading.found(*(Finding(ReadingFlag.CHECK_BLIND, text) for text in blind)))
