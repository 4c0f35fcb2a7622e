"""Serials among serials: what speaks against one that is read surely, by those before it and by the production order.

    in the order?         KX407299 is not in lot-7.csv
    read before?          KX407251 was read before, of tray-7/part-3        (`pipeline.store.serials` asks)
    in its place?         KX407299 is 48 ahead of the parts before it

A misread serial must not condemn the next hundred, so a place is told by the middle of the last `WINDOW` parts
that were read surely, and not by the last one; and only while most of them stand in a row. Their own serials count
whether or not they were in their place: a lot that begins with another number is asked about `WINDOW // 2 + 1`
times, then it is the row.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from statistics import median_low
from typing import NamedTuple

from pipeline.common.texts import without_blanks

WINDOW = 9
"""Parts by which a place is told."""
_MOST = WINDOW // 2 + 1
_DIGITS = re.compile(r"[0-9]+")


class SerialAlarm(StrEnum):
    """A kind of objection to a serial."""

    NOT_IN_ORDER = "not_in_order"
    READ_BEFORE = "read_before"
    OUT_OF_SEQUENCE = "out_of_sequence"


@dataclass(frozen=True)
class Objection:
    """Why a part that is read surely goes to a person all the same.

    Attributes:
        alarm: of which kind.
        why: in words.
        of: id of the part that bears the serial already; empty otherwise.
    """

    alarm: SerialAlarm
    why: str
    of: str = ""


class Counted(NamedTuple):
    """A serial with a number that counts: KX407251 is KX, 407251.

    Attributes:
        head, tail: what stands before and after it.
        number: that counts, the last one in the serial.
        digits: of it.
    """

    head: str
    number: int
    digits: int
    tail: str

    @property
    def series(self) -> tuple[str, int, str]:
        """The parts that all serials of its series have in common."""
        return self.head, self.digits, self.tail


@dataclass(frozen=True)
class ProductionOrder:
    """The serials that are to come.

    Attributes:
        name: of its file.
        serials: one by one, without blanks.
        ranges: first and last of serials that count, such as KX400000..KX409999.
    """

    name: str
    serials: frozenset[str] = frozenset()
    ranges: tuple[tuple[Counted, Counted], ...] = ()

    def holds(self, text: str) -> bool:
        """Whether a serial is in it, blanks or not."""
        place = counted(text)
        return without_blanks(text) in self.serials or any(
            place is not None and place.series == first.series and first.number <= place.number <= last.number
            for first, last in self.ranges
        )


@dataclass(frozen=True)
class SerialRules:
    """Rules for serials.

    Attributes:
        duplicates: refuse a serial that another part bears.
        jump: how far a serial may be from its place in the row; 0: anywhere.
        order: the serials that are to come; None: any.
    """

    duplicates: bool = False
    jump: int = 0
    order: ProductionOrder | None = None

    @property
    def any(self) -> bool:
        """Whether anything is asked."""
        return self.duplicates or self.jump > 0 or self.order is not None

    def by_order(self, text: str) -> Objection | None:
        """The objection to a serial that is not in the order."""
        if self.order is None or self.order.holds(text):
            return None
        return Objection(SerialAlarm.NOT_IN_ORDER, f"{text} is not in {self.order.name}")

    def by_place(self, text: str, before: Sequence[tuple[int, str]]) -> Objection | None:
        """The objection to a serial that is out of sequence.

        Args:
            text: of the part now.
            before: (how many parts before it, serial) of those that were read surely, the latest first.
        """
        place = counted(text)
        known = [(back, found) for back, one in before if (found := counted(one)) is not None][:WINDOW]
        if not self.jump or len(known) < _MOST:
            return None
        ((head, tail), n_alike), *_ = Counter((one.head, one.tail) for _, one in known).most_common()
        # where each of them says that the part now stands
        said = [one.number + back for back, one in known if (one.head, one.tail) == (head, tail)]
        middle = median_low(said)
        if n_alike < _MOST or sum(abs(one - middle) <= self.jump for one in said) < _MOST:
            return None  # they stand in no row
        row = f"{head}...{tail}"
        if place is None or (place.head, place.tail) != (head, tail):
            return Objection(SerialAlarm.OUT_OF_SEQUENCE, f"{text} is none of the row {row} before it")
        off = place.number - middle
        if abs(off) <= self.jump:
            return None
        where = f"{off} ahead of" if off > 0 else f"{-off} behind"
        return Objection(SerialAlarm.OUT_OF_SEQUENCE, f"{text} is {where} the parts before it")


def counted(text: str) -> Counted | None:
    """The parts of a serial with a number; None of one without."""
    plain = without_blanks(text)
    runs = list(_DIGITS.finditer(plain))
    if not runs:
        return None
    last = runs[-1]
    return Counted(plain[: last.start()], int(last[0]), len(last[0]), plain[last.end() :])
