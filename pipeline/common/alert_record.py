"""An alert that is raised."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True)
class AlertRecord:
    """Something that has gone wrong, until it is right again.

    Attributes:
        name: reject_rate, review_rate, drift, drift:JOB, bench, golden or golden_overdue.
        part_id: the latest part when it was raised.
        at: when.
        message: what is wrong, for a person.
    """

    name: str
    part_id: str
    at: datetime
    message: str
