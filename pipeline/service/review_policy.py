"""The review policy: number of readers that must agree, share of accepted parts to audit, and blind reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from random import SystemRandom
from typing import TYPE_CHECKING, Self

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState, ReviewRecord

if TYPE_CHECKING:
    from pipeline.service.settings import ReviewSettings


class ReviewMode(StrEnum):
    """Modes of review; all but OPEN are blind: they show the pictures, but no reading."""

    OPEN = "open"
    SECOND = "second"
    """After another reader, with whom the result must agree."""
    AUDIT = "audit"
    """An accepted part, drawn at random."""


@dataclass(frozen=True)
class ReviewPolicy:
    """The rules of review.

    Attributes:
        readers: number of people that must read the same before a part is reviewed, 1 or 2.
        audited: share of the accepted parts that a person reads too.
    """

    readers: int = 1
    audited: float = 0.0

    @classmethod
    def of(cls, settings: ReviewSettings) -> Self:
        """The policy that the settings ask for."""
        return cls(2 if settings.second_reader else 1, settings.audit_per_thousand / 1000.0)

    def draw_audit(self) -> bool:
        """Draw at random whether a part is audited if it is accepted; the draw cannot be predicted."""
        return SystemRandom().random() < self.audited

    def mode(
        self, part: PartRecord, person: Person, *, opinions: Sequence[ReviewRecord], audit: bool
    ) -> ReviewMode:
        """Mode in which a person reviews a part.

        Args:
            part: current record of the part.
            person: the reader.
            opinions: opinions on the part since its last review.
            audit: whether its audit is drawn and still open.
        """
        if audit:
            return ReviewMode.AUDIT
        others = self.readers > 1 and part.state is PartState.REVIEW and bool(opinions)
        return ReviewMode.SECOND if others and not any(map(person.said, opinions)) else ReviewMode.OPEN

    def hidden(
        self, part: PartRecord, person: Person, opinions: Sequence[ReviewRecord]
    ) -> tuple[ReviewRecord, ...]:
        """Opinions that a person does not see before reading the part."""
        mode = self.mode(part, person, opinions=opinions, audit=False)
        return tuple(opinions) if mode is ReviewMode.SECOND else ()
