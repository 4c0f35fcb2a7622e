"""Duplicate, order and sequence checks of a serial that was read with certainty.

    in the order?         KX407299 is not in lot-7.csv
    read before?          KX407251 was already read on tray-7/part-3        (`pipeline.store.parts` asks)
    in its place?         KX407299 is 48 ahead of the parts before it

The expected number is the median over the last `WINDOW` parts, while most of them form a series: one misread serial
raises one alarm, a lot that starts at another number `WINDOW // 2 + 1`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from statistics import median_low
from typing import NamedTuple

from pipeline.common.reading_records import ReadingRecord, ReasonRecord
from pipeline.common.texts import without_blanks

WINDOW = 9  # number of preceding parts that predict the number of the next one
_MOST = WINDOW // 2 + 1
_DIGITS = re.compile(r"[0-9]+")


class SerialAlarm(StrEnum):
    """A kind of objection to a serial."""

    NOT_IN_ORDER = "not_in_order"
    READ_BEFORE = "read_before"
    OUT_OF_SEQUENCE = "out_of_sequence"


@dataclass(frozen=True)
class Objection:
    """Reason to send a part to review although it was read with certainty; `of`: the part that has the serial."""

    alarm: SerialAlarm
    why: str
    of: str = ""


def with_objection(reading: ReadingRecord, objection: Objection) -> ReadingRecord:
    """The same reading with the objection among its messages and reasons; its decision stays."""
    reasons = (*reading.reasons, ReasonRecord(objection.alarm))
    return replace(reading, messages=(*reading.messages, objection.why), reasons=reasons)


class NumberedSerial(NamedTuple):
    """A serial with a number that counts: KX407251 is KX, 407251. The last number in it counts."""

    head: str
    number: int
    digits: int
    tail: str

    @property
    def series(self) -> tuple[str, int, str]:
        return self.head, self.digits, self.tail


@dataclass(frozen=True)
class ProductionOrder:
    """Single serials of an order, without blanks, and ranges by their ends, such as KX400000..KX409999."""

    name: str
    serials: frozenset[str] = frozenset()
    ranges: tuple[tuple[NumberedSerial, NumberedSerial], ...] = ()

    def holds(self, text: str) -> bool:
        place = split_serial(text)
        return without_blanks(text) in self.serials or any(
            place is not None and place.series == first.series and first.number <= place.number <= last.number
            for first, last in self.ranges
        )


@dataclass(frozen=True)
class SerialRules:
    """Rules for serials; `jump` is the largest distance of a serial from its expected number, 0: no limit."""

    duplicates: bool = False
    jump: int = 0
    order: ProductionOrder | None = None

    @property
    def any(self) -> bool:
        return self.duplicates or self.jump > 0 or self.order is not None

    def by_order(self, text: str) -> Objection | None:
        if self.order is None or self.order.holds(text):
            return None
        return Objection(SerialAlarm.NOT_IN_ORDER, f"{text} is not in {self.order.name}")

    def by_place(self, text: str, before: Sequence[tuple[int, str]]) -> Objection | None:
        """The objection to a serial that is out of sequence, by (number of parts back, serial), the latest first."""
        place = split_serial(text)
        serials = ((back, split_serial(other)) for back, other in before)
        known = [(back, serial) for back, serial in serials if serial is not None][:WINDOW]
        if not self.jump or len(known) < _MOST:
            return None
        ((head, tail), n_alike), *_ = Counter((serial.head, serial.tail) for _, serial in known).most_common()
        # the present part's number, as each of them predicts it
        predicted = [
            serial.number + back for back, serial in known if (serial.head, serial.tail) == (head, tail)
        ]
        middle = median_low(predicted)
        if n_alike < _MOST or sum(abs(number - middle) <= self.jump for number in predicted) < _MOST:
            return None  # they form no series
        row = f"{head}...{tail}"
        if place is None or (place.head, place.tail) != (head, tail):
            return Objection(SerialAlarm.OUT_OF_SEQUENCE, f"{text} does not match the preceding series {row}")
        off = place.number - middle
        if abs(off) <= self.jump:
            return None
        where = f"{off} ahead of" if off > 0 else f"{-off} behind"
        return Objection(SerialAlarm.OUT_OF_SEQUENCE, f"{text} is {where} the parts before it")


ANY_SERIAL = SerialRules()


def split_serial(text: str) -> NumberedSerial | None:
    """Split a serial with a number into its parts; None for a serial without one."""
    plain = without_blanks(text)
    runs = list(_DIGITS.finditer(plain))
    if not runs:
        return None
    last = runs[-1]
    return NumberedSerial(plain[: last.start()], int(last[0]), len(last[0]), plain[last.end() :])
