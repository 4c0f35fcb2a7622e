"""A part on its way through the service: as it is sent, and what is decided about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from pipeline.common.reading_records import ScanPlanRecord
from pipeline.common.records import PartState, ShadowRecord, TouchWait


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


@dataclass(frozen=True)
class Decision:
    """Decision about a part after a reading.

    Attributes:
        state: new state of the part.
        shadow: comparison with the line's own reader, in shadow mode.
        plan: scan plan.
        touch: wait for touch.
        not_felt: why it is not felt, though the camera is unsure.
    """

    state: PartState
    shadow: ShadowRecord | None = None
    plan: ScanPlanRecord | None = None
    touch: TouchWait | None = None
    not_felt: str = ""
