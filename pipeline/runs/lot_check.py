"""A run's serials among each other: those that its production order lacks, and those that two parts bear."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from pipeline.common.reading_records import ReadingRecord, ReasonRecord
from pipeline.common.serial_rules import ProductionOrder, SerialAlarm
from pipeline.common.texts import without_blanks


@dataclass
class LotCheck:
    """Sends to a person what was read surely and cannot be so.

    Of two parts with one serial the second is sent, and its message names the first. Where parts stand in a row is not
    asked: a run reads them in any order.

    Attributes:
        order: the serials that are to come.
        bearers: part that bears each serial read surely so far.
    """

    order: ProductionOrder
    bearers: dict[str, str] = field(default_factory=dict)

    def known(self, record: ReadingRecord) -> None:
        """Take a record of an earlier sitting into account."""
        if record.decision == "accept":
            self.bearers.setdefault(without_blanks(record.text), record.part)

    def checked(self, record: ReadingRecord) -> ReadingRecord:
        """The record, to be reviewed where something speaks against its serial."""
        if record.decision != "accept":
            return record
        if not self.order.holds(record.text):
            why, code = f"{record.text} is not in {self.order.name}", SerialAlarm.NOT_IN_ORDER
        elif (first := self.bearers.setdefault(without_blanks(record.text), record.part)) != record.part:
            why, code = f"{record.text} was read before, of {first}", SerialAlarm.READ_BEFORE
        else:
            return record
        reasons = (*record.reasons, ReasonRecord(code))
        return replace(record, decision="review", messages=(*record.messages, why), reasons=reasons)
