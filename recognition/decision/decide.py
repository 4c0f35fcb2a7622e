"""The one place where a reading is built: beliefs in, doubts and accept, review or reject out.

characters, confidence --thresholds--> LOW_CONFIDENCE, AMBIGUOUS ----+
choice, grammar -------> FORMAT_OVERRULED, SEARCH_EXHAUSTED, CHECK_BLIND --> any doubt: review --> Reading
flags of who has read it --------------------------------------------+       half unread: reject
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

from recognition.decision.reading import MEASURE_FLAGS, CharacterReading, Decision, Reading, ReadingFlag
from recognition.language.confusions import CharacterState
from recognition.language.constrained_decoding import Choice, ChoiceFlag, blind_warnings
from recognition.language.grammar import Grammar

LEAST_VALID_MASS = 0.02
"""Belief in all serials of the format together below which another one stands there."""
HOPELESS_SHARE = 0.5
"""Share of places that cannot be read from which a part is rejected."""
CHOICE_FLAGS = (
    ReadingFlag.LOW_CONFIDENCE
    | ReadingFlag.AMBIGUOUS
    | ReadingFlag.FORMAT_OVERRULED
    | ReadingFlag.SEARCH_EXHAUSTED
    | ReadingFlag.CHECK_BLIND
)
"""What `decided` may set."""
DOUBTS = (
    CHOICE_FLAGS
    | ReadingFlag.FOREIGN_SHAPES
    | ReadingFlag.UNREAD_MARKS
    | ReadingFlag.SENSES_DISAGREE
    | ReadingFlag.LINE_MISSING
    | MEASURE_FLAGS
)
"""What keeps a reading from being accepted."""


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
    notes: tuple[str, ...] = (),
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
        notes: known beside what is found out here.
        about: other fields of the reading.
    """
    if not characters:
        return Reading((), Decision.REJECT, 0.0, flags | ReadingFlag.NO_CHARACTERS, notes=notes, **about)
    if confidence < settings.accept_confidence:
        flags |= ReadingFlag.LOW_CONFIDENCE
    if min(c.margin for c in characters) < settings.accept_margin:
        flags |= ReadingFlag.AMBIGUOUS
    if choice is not None:
        if choice.valid_mass < LEAST_VALID_MASS or not choice.text:
            flags |= ReadingFlag.FORMAT_OVERRULED
        if ChoiceFlag.EXHAUSTED in choice.flags:
            flags |= ReadingFlag.SEARCH_EXHAUSTED
    made = Reading(tuple(characters), decision_of(flags, characters), confidence, flags, notes=notes, **about)
    return made if choice is None or grammar is None else check_doubted(made, choice, grammar)


def check_doubted(reading: Reading, choice: Choice, grammar: Grammar) -> Reading:
    """The reading, doubted where the check digit cannot tell a character from its rival."""
    blind = blind_warnings(choice, grammar) if choice.text else ()
    if not blind:
        return reading
    flags = reading.flags | ReadingFlag.CHECK_BLIND
    decision = decision_of(flags, reading.characters)
    return replace(reading, flags=flags, decision=decision, notes=(*reading.notes, *blind))


def serial_is_sure(reading: Reading) -> bool:
    """Whether it would be accepted whatever the rules for its mark say: another scan reads nothing better."""
    return decision_of(reading.flags & ~MEASURE_FLAGS, reading.characters) is Decision.ACCEPT


def decision_of(flags: ReadingFlag, characters: Sequence[CharacterReading]) -> Decision:
    """Rejected where half of the places cannot be read, accepted where nothing is in doubt."""
    unread = sum(c.state is not None and c.state.state is CharacterState.NOT_READ for c in characters)
    if unread >= HOPELESS_SHARE * len(characters):
        return Decision.REJECT
    return Decision.REVIEW if flags & DOUBTS else Decision.ACCEPT
