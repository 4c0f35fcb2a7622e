"""Accept, review or reject: the one place, and a pure function.

    score: probability that the whole serial is right ---- at least the threshold ----+
    contracts: rules that hold whatever the score is ----- none broken ---------------+--> accept; else review
    places: half of them cannot be read -------------------------------------------------> reject

Accept means that nothing is left to do. So an accepted part asks for no action (`Reading.actions`); its grades still
say how well it is marked.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from functools import reduce
from operator import or_
from types import MappingProxyType
from typing import Protocol

from recognition.decision.flags import MEASURE_FLAGS, ReadingFlag
from recognition.language.confusions import CharacterState, PlaceState

CONTRACTS = MappingProxyType(
    {
        ReadingFlag.FORMAT_NOT_MET: "the text obeys the format",
        ReadingFlag.FORMAT_OVERRULED: "the text stands there, and not by the format's word alone",
        ReadingFlag.SEARCH_EXHAUSTED: "all serials of the format were compared",
        ReadingFlag.CHECK_BLIND: "no rival has the same check digit",
        ReadingFlag.CASE_UNKNOWN: "no letter may be a small one, where no format tells",
        ReadingFlag.FOREIGN_SHAPES: "the characters are those of the font that was named",
        ReadingFlag.NOT_WHOLE: "every character was felt from edge to edge",
        ReadingFlag.UNTOLD: "of what is felt pass by pass, enough lines tell each character from its rivals",
        ReadingFlag.UNREAD_MARKS: "no other line can be read that may be the serial",
        ReadingFlag.LINE_MISSING: "every other line that was asked for is read surely",
        ReadingFlag.SENSES_DISAGREE: "touch and camera agree where both are sure",
        ReadingFlag.CODE_DISAGREES: "a Data Matrix or QR code beside it, if one speaks of a serial, holds this one",
        ReadingFlag.ORIENTATION_UNKNOWN: "upside down or mirrored, as far as may be, the marks read no other serial",
        ReadingFlag.NOT_CERTIFIED: "the certificate, if there is one, vouches for it",
        ReadingFlag.MISMATCH: "the text is the one that was expected, if one was",
        ReadingFlag.BELIEVED_OTHERWISE: "no other text was believed while the part was felt",
        ReadingFlag.STAGE_FAILED: "the stage felt all that was asked of it",
        MEASURE_FLAGS: "the mark keeps every rule that was asked for",
    }
)
"""Flags that send a reading to review whatever its score, and the rule that each stands for."""
BROKEN = reduce(or_, CONTRACTS)


class Decision(StrEnum):
    """Accept, review or reject."""

    ACCEPT = "accept"
    REVIEW = "review"
    REJECT = "reject"


class Place(Protocol):
    """A character, as far as a decision needs it."""

    @property
    def state(self) -> PlaceState | None:
        """Read, confused, not read or mismatch; None where it was not determined."""


def decide(
    places: Sequence[Place],
    *,
    score: float,
    threshold: float | None,
    flags: ReadingFlag,
    hopeless_share: float = 0.5,
) -> Decision:
    """Decide on a reading.

    Args:
        places: its characters.
        score: probability that all of them are right, 0 to 1.
        threshold: least score for acceptance; None asks for none.
        flags: what is known about it.
        hopeless_share: share of places that cannot be read from which a part is rejected.
    """
    unread = sum(one.state is not None and one.state.state is CharacterState.NOT_READ for one in places)
    if unread >= hopeless_share * len(places):
        return Decision.REJECT
    if flags & BROKEN or (threshold is not None and score < threshold):
        return Decision.REVIEW
    return Decision.ACCEPT
