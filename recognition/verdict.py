"""What to do with a choice: the doubts that it raises, and accept, review or reject."""

from __future__ import annotations

from collections.abc import Sequence

from recognition.acceptance import Thresholds
from recognition.confusions import CharacterState
from recognition.constrained_decoding import Choice, ChoiceFlag, blind_warnings
from recognition.grammar import Grammar
from recognition.reading import CharacterReading, Decision, ReadingFlag

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
"""What `choice_flags` may set."""
DOUBTS = CHOICE_FLAGS | ReadingFlag.FOREIGN_SHAPES | ReadingFlag.UNREAD_MARKS | ReadingFlag.SENSES_DISAGREE
"""What keeps a reading from being accepted."""


def choice_flags(
    choice: Choice, grammar: Grammar | None, characters: Sequence[CharacterReading], settings: Thresholds
) -> ReadingFlag:
    """The doubts that a choice raises by itself."""
    flags = ReadingFlag.NONE
    if choice.probability < settings.accept_confidence:
        flags |= ReadingFlag.LOW_CONFIDENCE
    if min(c.margin for c in characters) < settings.accept_margin:
        flags |= ReadingFlag.AMBIGUOUS
    if choice.valid_mass < LEAST_VALID_MASS:
        flags |= ReadingFlag.FORMAT_OVERRULED
    if ChoiceFlag.EXHAUSTED in choice.flags:
        flags |= ReadingFlag.SEARCH_EXHAUSTED
    if grammar is not None and blind_warnings(choice, grammar):
        flags |= ReadingFlag.CHECK_BLIND
    return flags


def decision_of(flags: ReadingFlag, characters: Sequence[CharacterReading]) -> Decision:
    """Rejected where half of the places cannot be read, accepted where nothing is in doubt."""
    unread = sum(c.state is not None and c.state.state is CharacterState.NOT_READ for c in characters)
    if unread >= HOPELESS_SHARE * len(characters):
        return Decision.REJECT
    return Decision.REVIEW if flags & DOUBTS else Decision.ACCEPT
