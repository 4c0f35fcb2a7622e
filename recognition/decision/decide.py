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

from recognition.decision.flags import BROKEN, ReadingFlag
from recognition.language.confusions import CharacterState, PlaceState


class Decision(StrEnum):
    """Accept, review or reject."""

    ACCEPT = "accept"
    REVIEW = "review"
    REJECT = "reject"


def decide(
    places: Sequence[PlaceState | None],
    *,
    score: float,
    threshold: float | None,
    flags: ReadingFlag,
    hopeless_share: float = 0.5,
) -> Decision:
    """Decide on a reading.

    Args:
        places: state of each character; None where it was not determined.
        score: probability that all of them are right, 0 to 1.
        threshold: least score for acceptance; None asks for none.
        flags: what is known about it.
        hopeless_share: share of places that cannot be read from which a part is rejected.
    """
    unread = sum(one is not None and one.state is CharacterState.NOT_READ for one in places)
    if unread >= hopeless_share * len(places):
        return Decision.REJECT
    if flags & BROKEN or (threshold is not None and score < threshold):
        return Decision.REVIEW
    return Decision.ACCEPT
