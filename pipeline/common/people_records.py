"""Records of people at the service: identities, claims and audits."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from pipeline.common.names import clean_name, folded
from pipeline.common.records import ReviewRecord
from pipeline.common.shares import Share


@dataclass(frozen=True)
class Person:
    """A person at the service; a name with hidden characters raises HiddenCharacterError."""

    name: str  # signature of reviews: the token's name, or the name typed where no token is required
    token: str = ""
    seat: str = ""  # secret of the person's browser; it distinguishes persons without tokens

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", clean_name(self.name))

    @property
    def holder(self) -> str:
        return f"token:{self.token}" if self.token else f"seat:{self.seat}" if self.seat else ""

    def wrote(self, review: ReviewRecord) -> bool:
        same_token = folded(self.token) == folded(review.token)
        return same_token and bool(self.token or folded(self.name) == folded(review.who))


@dataclass(frozen=True)
class ClaimRecord:
    """A part that a person works on; `holder` as in `Person.holder`."""

    part_id: str
    holder: str
    who: str
    until: datetime


@dataclass(frozen=True)
class AuditFigures:
    """Results of audits of accepted parts that were drawn since a time.

    Attributes:
        disputed: parts read differently that wait for the deciding review.
        accepted_wrong: share of wrong readings among those judged, with the Clopper-Pearson interval.
    """

    drawn: int
    waiting: int
    disputed: int
    not_judged: int
    accepted_wrong: Share
