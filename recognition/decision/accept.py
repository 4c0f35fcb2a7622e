"""Why a part is accepted: everything on this list holds. Anything that does not sends it to a person.

A doubt that is found is a flag of the reading, with its finding: which place, and what of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import or_

from recognition.decision.flags import MEASURE_FLAGS, ReadingFlag
from recognition.decision.reading import CharacterReading, Decision, Reading
from recognition.language.confusions import CharacterState

ACCEPTED_WHERE_NOT = {
    ReadingFlag.LOW_CONFIDENCE: "the whole text is believed as much as the settings ask",
    ReadingFlag.AMBIGUOUS: "every character leads its rivals by as much as they ask",
    ReadingFlag.FORMAT_OVERRULED: "the text stands there, and not by the format's word alone",
    ReadingFlag.SEARCH_EXHAUSTED: "all serials of the format were compared",
    ReadingFlag.CHECK_BLIND: "no rival has the same check digit",
    ReadingFlag.STROKES_MISSING: "most strokes of every character were felt",
    ReadingFlag.STROKES_UNDECIDED: "strokes tell it from its rivals: they were felt, or were not where they could be",
    ReadingFlag.FOREIGN_SHAPES: "the characters are those of the font that was named",
    ReadingFlag.UNREAD_MARKS: "no other line can be read that may be the serial",
    ReadingFlag.LINE_MISSING: "every other line that was asked for was found",
    ReadingFlag.SENSES_DISAGREE: "touch and camera agree",
    ReadingFlag.CODE_DISAGREES: "a Data Matrix or QR code beside it, if one speaks of a serial, holds this one",
    ReadingFlag.ORIENTATION_UNKNOWN: "upside down or mirrored, as far as that may be, the marks read no other serial",
    ReadingFlag.NOT_CERTIFIED: "the certificate, if there is one, vouches for it",
    MEASURE_FLAGS: "the mark keeps every rule that was asked for",
}
"""What keeps a reading from being accepted, and what holds where it is not set."""
DOUBTS = reduce(or_, ACCEPTED_WHERE_NOT)
HOPELESS_SHARE = 0.5
"""Share of places that cannot be read from which a part is rejected."""


def decision_of(flags: ReadingFlag, characters: Sequence[CharacterReading]) -> Decision:
    """Rejected where half of the places cannot be read, accepted where nothing is in doubt."""
    unread = sum(c.state is not None and c.state.state is CharacterState.NOT_READ for c in characters)
    if unread >= HOPELESS_SHARE * len(characters):
        return Decision.REJECT
    return Decision.REVIEW if flags & DOUBTS else Decision.ACCEPT


def decided_anew(reading: Reading) -> Reading:
    """The reading, decided by the flags that it has now."""
    return replace(reading, decision=decision_of(reading.flags, reading.characters))


def serial_is_sure(reading: Reading) -> bool:
    """Whether another scan reads nothing better: it is accepted but for rules for its mark and its orientation."""
    settled = reading.flags & ~(MEASURE_FLAGS | ReadingFlag.ORIENTATION_UNKNOWN)
    return decision_of(settled, reading.characters) is Decision.ACCEPT
