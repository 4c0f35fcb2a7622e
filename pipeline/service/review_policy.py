"""The review policy: number of readers that must agree, share of accepted parts to audit, and blind reading."""

from __future__ import annotations

from enum import StrEnum
from random import SystemRandom
from typing import TYPE_CHECKING

from pydantic import Field

from pipeline.common.settings import Settings

if TYPE_CHECKING:  # the command line loads this module for every command
    from pipeline.common.people_records import Person
    from pipeline.common.records import PartStory, ReviewRecord


class ReviewMode(StrEnum):
    """Modes of review; all but OPEN are blind: they show the pictures, but no reading."""

    OPEN = "open"
    SECOND = "second"
    """After another reader, with whom the result must agree."""
    AUDIT = "audit"
    """An accepted part, drawn at random."""


class ReviewSettings(Settings):
    """Review by people."""

    second_reader: bool = False
    """A part is reviewed when two people have read the same; the second does not see what was read before."""
    audit_per_thousand: float = Field(default=0.0, ge=0.0, le=1000.0)
    """Number of accepted parts, of a thousand, that a person reads too, drawn at random, without seeing what was
    accepted. The dashboard shows how many parts are accepted wrong."""

    @property
    def readers(self) -> int:
        """Number of people that must read the same before a part is reviewed."""
        return 2 if self.second_reader else 1

    def draw_audit(self) -> bool:
        """Draw at random whether a part is audited if it is accepted; the draw cannot be predicted."""
        return 1000.0 * SystemRandom().random() < self.audit_per_thousand

    def mode(self, story: PartStory, person: Person) -> ReviewMode:
        """Mode in which a person reviews a part."""
        from pipeline.common.records import PartState

        if story.awaits_audit:
            return ReviewMode.AUDIT
        others = self.second_reader and story.part.state is PartState.REVIEW and bool(story.opinions)
        return ReviewMode.SECOND if others and not any(map(person.said, story.opinions)) else ReviewMode.OPEN

    def shown(self, story: PartStory, person: Person) -> tuple[ReviewRecord, ...]:
        """Reviews of a part that a person may see: a second reader sees no opinion before reading the part."""
        hidden = story.opinions if self.mode(story, person) is ReviewMode.SECOND else ()
        return tuple(review for review in story.reviews if review not in hidden)
