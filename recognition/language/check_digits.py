"""Check digits as state machines that advance with each character, so that a search can use them.

Every built-in rule has a remainder that each character updates; the text is valid if the remainder
ends at one value. `stdnum:NAME` uses python-stdnum, which can only check a whole text.

    rule              text                                              source
    vin               17 of A-Z 0-9 without I O Q; as vin-na if the     ISO 3779, 49 CFR 565.15, GB 16735
                      first is 1 to 5 or L (North America, China)
    vin-na            17 of A-Z 0-9 without I O Q, ninth 0-9 or X       49 CFR 565.15
    luhn              digits                                            ISO/IEC 7812-1 annex B
    gs1               digits (GTIN-8, -12, -13, -14, SSCC)              GS1 General Specifications 7.9
    iso7064mod11_2    digits, the last may be X                         ISO 7064 pure systems
    iso7064mod37_2    A-Z 0-9, the last may be *
    iso7064mod97_10   A-Z 0-9, the last two are digits
    iso7064mod11_10   digits                                            ISO 7064 hybrid systems
    iso7064mod37_36   A-Z 0-9
    stdnum:NAME       whatever stdnum.NAME.is_valid accepts             python-stdnum

`luhn@3-8` checks places 3 to 8 only, `luhn@3-` place 3 to the end.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import combinations
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.serials import FormatError
from recognition.language.automaton import Machine
from recognition.language.remainders import REMAINDERS, Remainder

CHECK_DIGITS = (*REMAINDERS, "stdnum:NAME")
_FORM = re.compile(r"(?P<name>[^@]+)(?:@(?P<first>\d+)-(?P<last>\d*))?")


@dataclass(frozen=True)
class CheckDigit:
    """A rule and the places it checks, from 1. Raises FormatError."""

    name: str
    first_place: int = 1
    last_place: int | None = None

    def __post_init__(self) -> None:
        if self.name.startswith("stdnum:"):
            _stdnum_module(self.name)
        elif self.name not in REMAINDERS:
            raise FormatError(
                f"unknown check digit {self.name!r}",
                hint=f"known are {', '.join(CHECK_DIGITS)} (NAME: a module of python-stdnum, such as imei)",
            )
        if self.first_place < 1 or (self.last_place is not None and self.last_place < self.first_place):
            raise FormatError(f"{self} looks at no place", hint=f"places count from 1: {self.name}@3-8")

    @classmethod
    def parse(cls, text: str) -> CheckDigit:
        """Parse a text such as `vin`, `ISO 7064 mod 37-2`, `luhn@3-8` or `stdnum:imei`."""
        match = _FORM.fullmatch(text.strip())
        if match is None:
            raise FormatError(
                f"{text!r} is not a check digit", hint=f"write {', '.join(CHECK_DIGITS)} or luhn@3-8"
            )
        name = match["name"].strip().lower()
        if not name.startswith("stdnum:"):
            plain = re.sub(r"[^a-z0-9]", "", name)
            name = {re.sub(r"[^a-z0-9]", "", known): known for known in REMAINDERS}.get(plain, name)
        last = int(match["last"]) if match["last"] else None
        return cls(name, int(match["first"] or 1), last)

    def __str__(self) -> str:
        if (self.first_place, self.last_place) == (1, None):
            return self.name
        return f"{self.name}@{self.first_place}-{self.last_place or ''}"

    @property
    def remainder(self) -> Remainder | None:
        return REMAINDERS.get(self.name)

    @property
    def alphabet(self) -> str:
        return self.remainder.alphabet if self.remainder is not None else ""

    @property
    def length(self) -> int | None:
        if self.remainder is None or self.remainder.length is None or self.last_place is not None:
            return None
        return self.first_place - 1 + self.remainder.length

    def holds(self, text: str) -> bool:
        """Whether a text is valid; it must have no blanks."""
        if self.remainder is None:
            return bool(_stdnum_module(self.name).is_valid(text[self.first_place - 1 : self.last_place]))
        state = self.remainder.first
        for place, char in enumerate(text):
            state = int(_table(self, len(text), (char,), place)[state, 0])
            if state < 0:
                return False
        return bool(self.machine(len(text), ()).accepts[state])

    def machine(self, n_places: int, chars: tuple[str, ...]) -> Machine:
        """The rule over characters of texts of a length. Raises FormatError for one that needs the whole text."""
        rule, looked_at = self._rule(), self._looked_at(n_places)
        good = np.zeros(rule.modulus, dtype=bool)
        if looked_at >= rule.least_places and rule.length in (None, looked_at):
            good[list(rule.good)] = True
        return Machine(partial(_table, self, n_places, chars), good, rule.first)

    def _looked_at(self, n_places: int) -> int:
        last = n_places if self.last_place is None else self.last_place
        return max(0, last - self.first_place + 1) if last <= n_places else 0

    def _rule(self) -> Remainder:
        rule = self.remainder
        if rule is None:
            raise FormatError(f"{self} needs the whole text")
        return rule


@lru_cache(maxsize=512)
def _table(check: CheckDigit, n_places: int, chars: tuple[str, ...], place: int) -> NDArray[np.int64]:
    rule = check._rule()
    looked_at = check._looked_at(n_places)
    inside = place - (check.first_place - 1)
    if not 0 <= inside < looked_at:
        return np.repeat(np.arange(rule.modulus)[:, None], len(chars), axis=1)
    table = np.full((rule.modulus, len(chars)), -1, dtype=np.int64)
    if rule.length in (None, looked_at):
        for k, char in enumerate(chars):
            to = rule.step(char, inside, looked_at) if char in rule.alphabet else None
            if to is not None:
                table[:, k] = to
    return table


@lru_cache(maxsize=16)
def _stdnum_module(name: str) -> ModuleType:
    module = name.removeprefix("stdnum:")
    if not re.fullmatch(r"[a-z0-9_]+(\.[a-z0-9_]+)*", module):
        raise FormatError(
            f"{module!r} is not a module of python-stdnum", hint="write stdnum:imei or stdnum:us.ssn"
        )
    try:
        importlib.import_module("stdnum")
    except ImportError as error:
        raise FormatError(
            f"the check digit {name} needs python-stdnum: pip install 'tactile-marks[checkdigits]'"
        ) from error
    try:
        checker = importlib.import_module(f"stdnum.{module}")
    except ImportError as error:
        raise FormatError(
            f"python-stdnum has no {module!r}", hint="its documentation lists the modules"
        ) from error
    if not hasattr(checker, "is_valid"):
        raise FormatError(f"stdnum.{module} checks no numbers", hint="name one that has is_valid()")
    return checker


def blind_pairs(check: CheckDigit, allowed: Sequence[str]) -> frozenset[tuple[str, str, int]]:
    """Pairs of characters that the check digit confuses, with their place (from 1). Raises FormatError."""
    chars = tuple(sorted(set("".join(allowed))))
    machine, pairs = check.machine(len(allowed), chars), set()
    for place, here in enumerate(allowed):
        table = machine.table(place)
        for (j, char), (k, other) in combinations(enumerate(chars), 2):
            same = (table[:, j] == table[:, k]).all() and (table[:, j] >= 0).all()
            if same and char in here and other in here:
                pairs.add((char, other, place + 1))
    return frozenset(pairs)
