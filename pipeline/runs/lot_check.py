"""Checks among the serials of a run: serials that are not in the production order, and duplicates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from pipeline.common.reading_records import ReadingRecord, ReasonRecord
from pipeline.common.serial_rules import ProductionOrder, SerialAlarm
from pipeline.common.texts import without_blanks


@dataclass
class LotCheck:
    """Send parts with impossible serials to review, although they were read with certainty.

    If two parts have one serial, the second goes to review, and its message names the first. The sequence is not
    checked, since a run reads parts in any order.

    Attributes:
        order: production order.
        bearers: first part with each serial that was read with certainty so far.
    """

    order: ProductionOrder
    bearers: dict[str, str] = field(default_factory=dict)

    def remember(self, record: ReadingRecord) -> None:
        """Add a record from an earlier part of the run."""
        if record.decision == "accept":
            self.bearers.setdefault(without_blanks(record.text), record.part)

    def check(self, record: ReadingRecord) -> ReadingRecord:
        """Return the record, with the decision "review" if its serial fails a check."""
        if record.decision != "accept":
            return record
        if not self.order.holds(record.text):
            why, code = f"{record.text} is not in {self.order.name}", SerialAlarm.NOT_IN_ORDER
        elif (first := self.bearers.setdefault(without_blanks(record.text), record.part)) != record.part:
            why, code = f"{record.text} was already read on {first}", SerialAlarm.READ_BEFORE
        else:
            return record
        reasons = (*record.reasons, ReasonRecord(code))
        return replace(record, decision="review", messages=(*record.messages, why), reasons=reasons)
