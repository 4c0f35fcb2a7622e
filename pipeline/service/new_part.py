"""A part as it is sent to the service."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Touch(StrEnum):
    """Choice of the stage or the sender to feel a part, if the camera is unsure."""

    ASKED = "asked"
    """The service's stage, on a later request; without a stage a person gets the part."""
    STAGE = "stage"
    """The service's stage, at once; without a stage a person gets the part."""
    PLAN = "plan"
    """The sender, by the plan in the answer."""


@dataclass(frozen=True)
class NewPart:
    """Data of a part beside its files.

    Attributes:
        name: name on the line.
        expected: text that it should read; empty if unknown.
        database: name of the glyph database; empty for the service's own.
        job: name of the job that says how to read; empty for the service's own settings.
        touch: stage or sender that feels it if the camera is unsure.
    """

    name: str = ""
    expected: str = ""
    database: str = ""
    job: str = ""
    touch: Touch = Touch.ASKED
