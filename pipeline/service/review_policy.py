"""The review policy: who must agree on a part, what share of accepted parts is audited, and who reads blind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from random import SystemRandom

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState, ReviewRecord


class ReviewMode(StrEnum):
    """How a person reads a part; all but OPEN are blind: pictures, and nothing that was read."""

    OPEN = "open"
    SECOND = "second"
    """After somebody else, who must be agreed with."""
    AUDIT = "audit"
    """An accepted part, drawn at random."""


@dataclass(frozen=True)
class ReviewPolicy:
    """The rules of review.

    Attributes:
        readers: people who must read the same before a part is reviewed, 1 or 2.
        audited: share of the accepted parts that a person reads too.
    """

    readers: int = 1
    audited: float = 0.0

    def draw_audit(self) -> bool:
        """Whether a part is to be audited if it is accepted; nobody who knows the parts can predict it."""
        return SystemRandom().random() < self.audited

    def mode(
        self, part: PartRecord, person: Person, *, opinions: Sequence[ReviewRecord], audit: bool
    ) -> ReviewMode:
        """How a person reads a part.

        Args:
            part: as it stands.
            person: who looks at it.
            opinions: what people have said of it since it was last reviewed.
            audit: whether it was drawn to be audited, and nobody has.
        """
        if audit:
            return ReviewMode.AUDIT
        others = self.readers > 1 and part.state is PartState.REVIEW and bool(opinions)
        return ReviewMode.SECOND if others and not any(map(person.said, opinions)) else ReviewMode.OPEN
