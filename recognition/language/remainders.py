"""Check digits that keep a remainder and change it character by character; a text is good if it ends at one value.

So they can run along with a search, and be summed over without writing texts out: see `recognition.language.automaton`.
Sources: ISO 7064 (pure and hybrid systems), ISO/IEC 7812-1 annex B (Luhn), GS1 General Specifications 7.9,
49 CFR 565.15 (vehicle identification numbers).
"""

from __future__ import annotations

import string
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

DIGITS = string.digits
ALPHANUMERIC = string.digits + string.ascii_uppercase
VIN_CHARACTERS = "".join(c for c in ALPHANUMERIC if c not in "IOQ")
VIN_LENGTH, VIN_CHECK_PLACE = 17, 8
VIN_WEIGHTS = (8, 7, 6, 5, 4, 3, 2, 10, 0, 9, 8, 7, 6, 5, 4, 3, 2)
"""49 CFR 565.15 table IV; the ninth place is the check digit itself."""
VIN_VALUES = {
    **{str(k): k for k in range(10)},
    **dict(zip("ABCDEFGH", range(1, 9), strict=True)),
    **dict(zip("JKLMN", range(1, 6), strict=True)),
    "P": 7,
    "R": 9,
    **dict(zip("STUVWXYZ", range(2, 10), strict=True)),
}
"""49 CFR 565.15 table III."""


class Remainder(Protocol):
    """A rule that keeps a remainder."""

    @property
    def alphabet(self) -> str:
        """Characters it knows, those of the check digit alone among them."""

    @property
    def modulus(self) -> int:
        """Remainders are 0 to modulus - 1."""

    @property
    def first(self) -> int:
        """The remainder before the first character."""

    @property
    def good(self) -> int:
        """The remainder of a good text."""

    @property
    def least_places(self) -> int:
        """Length of the shortest text with a check digit."""

    @property
    def length(self) -> int | None:
        """The length of every text; None where it may be any."""

    def step(self, char: str, place: int, n_places: int) -> NDArray[np.int64] | None:
        """(modulus,): the next remainder of each one; None where the character may not stand there."""


@dataclass(frozen=True)
class PureSystem:
    """ISO 7064 pure system: r -> (r radix + value) mod M, good at 1.

    Attributes:
        supplementary: character of the alphabet that only a check character may be.
        check_figures: how many figures at the end are check characters (mod 97-10), 0 for one of the alphabet.
    """

    modulus: int
    radix: int
    alphabet: str
    supplementary: str = ""
    check_figures: int = 0

    first = 0
    good = 1
    length = None

    @property
    def least_places(self) -> int:
        """One character and its check characters."""
        return 1 + max(1, self.check_figures)

    def step(self, char: str, place: int, n_places: int) -> NDArray[np.int64] | None:
        """See `Remainder.step`."""
        if char == self.supplementary and place != n_places - 1:
            return None
        if place >= n_places - self.check_figures and char not in DIGITS:
            return None
        value = self.alphabet.index(char)
        # in mod 97-10 letters are written as two figures, 10 to 35
        radix = self.radix**2 if self.check_figures and value > 9 else self.radix
        return (np.arange(self.modulus) * radix + value) % self.modulus


@dataclass(frozen=True)
class HybridSystem:
    """ISO 7064 hybrid system: r -> (2 (r or M) mod (M + 1) + value) mod M, good at 1."""

    alphabet: str

    good = 1
    least_places = 2
    length = None

    @property
    def modulus(self) -> int:
        """As many as there are characters."""
        return len(self.alphabet)

    @property
    def first(self) -> int:
        """Doubled, it is M: the start that ISO 7064 asks for, and 0 after reduction."""
        return len(self.alphabet) // 2

    def step(self, char: str, place: int, n_places: int) -> NDArray[np.int64] | None:
        """See `Remainder.step`."""
        m = self.modulus
        held = np.arange(m)
        held[0] = m
        return (2 * held % (m + 1) + self.alphabet.index(char)) % m


@dataclass(frozen=True)
class Luhn:
    """Every second figure from the right doubled and its figures summed; sum 0 mod 10."""

    alphabet = DIGITS
    modulus = 10
    first = good = 0
    least_places = 2
    length = None

    def step(self, char: str, place: int, n_places: int) -> NDArray[np.int64] | None:
        """See `Remainder.step`."""
        value = int(char)
        if (n_places - 1 - place) % 2:
            value = sum(divmod(2 * value, 10))
        return (np.arange(10) + value) % 10


@dataclass(frozen=True)
class Gs1:
    """Every second figure from the right three times; sum 0 mod 10."""

    alphabet = DIGITS
    modulus = 10
    first = good = 0
    least_places = 2
    length = None

    def step(self, char: str, place: int, n_places: int) -> NDArray[np.int64] | None:
        """See `Remainder.step`."""
        return (np.arange(10) + int(char) * (3 if (n_places - 1 - place) % 2 else 1)) % 10


@dataclass(frozen=True)
class Vin:
    """Weighted sum of transliterated characters mod 11 = the ninth, 10 written X; remainder is their difference."""

    alphabet = VIN_CHARACTERS
    modulus = 11
    first = good = 0
    least_places = length = VIN_LENGTH

    def step(self, char: str, place: int, n_places: int) -> NDArray[np.int64] | None:
        """See `Remainder.step`."""
        if place == VIN_CHECK_PLACE:
            if char not in DIGITS + "X":
                return None
            return (np.arange(11) - (10 if char == "X" else int(char))) % 11
        return (np.arange(11) + VIN_WEIGHTS[place] * VIN_VALUES[char]) % 11


REMAINDERS: dict[str, Remainder] = {
    "vin": Vin(),
    "luhn": Luhn(),
    "gs1": Gs1(),
    "iso7064mod11_2": PureSystem(11, 2, DIGITS + "X", supplementary="X"),
    "iso7064mod37_2": PureSystem(37, 2, ALPHANUMERIC + "*", supplementary="*"),
    "iso7064mod97_10": PureSystem(97, 10, ALPHANUMERIC, check_figures=2),
    "iso7064mod11_10": HybridSystem(DIGITS),
    "iso7064mod37_36": HybridSystem(ALPHANUMERIC),
}
"""The rules by name."""
