"""The one place where a reading is built: beliefs in, doubts and accept, review or reject out.

characters, confidence --thresholds--> LOW_CONFIDENCE, AMBIGUOUS ----+
choice, grammar -------> FORMAT_OVERRULED, SEARCH_EXHAUSTED, CHECK_BLIND --> any doubt: review --> Reading
flags of who has read it --------------------------------------------+       half unread: reject
grades of the marks ----> STROKES_MISSING ---------------------------+
rules for the marks ----> TOO_SHALLOW, TOO_DEEP, BURR_TOO_HIGH ... --+

Accept means that nothing is left to do: the serial is sure, no character lacks most of its strokes, and no rule that
was asked for is broken. So an accepted part asks for no action (`Reading.actions`); its grades still say how well it
is marked, and dirt beside strokes that are all there costs a grade and no acceptance.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, Protocol

from recognition.decision.flags import MEASURE_FLAGS, Finding, ReadingFlag, flags_of
from recognition.decision.grade import Action
from recognition.decision.reading import CharacterReading, Decision, Reading
from recognition.decision.reasons import places_text
from recognition.language.confusions import CharacterState
from recognition.language.constrained_decoding import Choice, ChoiceFlag, blind_warnings
from recognition.language.grammar import Grammar

LEAST_VALID_MASS = 0.02
"""Belief in all serials of the format together below which another one stands there."""
LEAST_STROKES = 0.5
"""Share of a character's strokes that must be there for it to be accepted."""
_REMEDIES = {
    Action.NONE: "look at the part",
    Action.CLEAN: "clean it and scan it again",
    Action.CLEAN_FIRST: "clean it and scan it again",
    Action.RE_STRIKE: "strike it again",
    Action.SCAN_AGAIN: "scan it again",
}
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
    | ReadingFlag.STROKES_MISSING
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
        tuple(characters), decision_of(flags, characters), confidence, flags, findings=findings, **about
    )
    return made if choice is None or grammar is None else check_doubted(made, choice, grammar)


def check_doubted(reading: Reading, choice: Choice, grammar: Grammar) -> Reading:
    """The reading, doubted where the check digit cannot tell a character from its rival."""
    blind = blind_warnings(choice, grammar) if choice.text else ()
    if not blind:
        return reading
    return decided_anew(reading.found(*(Finding(ReadingFlag.CHECK_BLIND, text) for text in blind)))


def decided_anew(reading: Reading) -> Reading:
    """The reading, decided by the flags that it has now."""
    return replace(reading, decision=decision_of(reading.flags, reading.characters))


def strokes_asked(reading: Reading, *, vouched: Collection[int] = ()) -> Reading:
    """The reading, doubted where a character lacks most of its strokes: what is filled to the land may be another one.

    Args:
        reading: with the grades of its marks.
        vouched: places, from 0, that another sense is sure of.
    """
    reading = reading.without(ReadingFlag.STROKES_MISSING)
    lacking = {
        k: c.grade.action
        for k, c in enumerate(reading.characters)
        if k not in vouched and c.grade is not None and (c.grade.value("completeness") or 0.0) < LEAST_STROKES
    }
    if lacking:
        where = places_text(reading, list(lacking))
        remedy = _REMEDIES[max(lacking.values(), key=list(lacking.values()).count)]
        reading = reading.found(
            Finding(ReadingFlag.STROKES_MISSING, f"most strokes are missing: {where} ({remedy})")
        )
    return decided_anew(reading)


def serial_is_sure(reading: Reading) -> bool:
    """Whether it would be accepted whatever the rules for its mark say: another scan reads nothing better."""
    return decision_of(reading.flags & ~MEASURE_FLAGS, reading.characters) is Decision.ACCEPT


def decision_of(flags: ReadingFlag, characters: Sequence[CharacterReading]) -> Decision:
    """Rejected where half of the places cannot be read, accepted where nothing is in doubt."""
    unread = sum(c.state is not None and c.state.state is CharacterState.NOT_READ for c in characters)
    if unread >= HOPELESS_SHARE * len(characters):
        return Decision.REJECT
    return Decision.REVIEW if flags & DOUBTS else Decision.ACCEPT
