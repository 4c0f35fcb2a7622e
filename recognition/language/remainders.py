"""Check digits as a remainder that each character updates; a text is valid if the remainder ends at a fixed value.

Sources: ISO 7064 (pure and hybrid systems), ISO/IEC 7812-1 annex B (Luhn), GS1 General Specifications 7.9, 49 CFR
565.15 and GB 16735-2019 (vehicle identification numbers), ISO 3780 (their first characters).
"""

from __future__ import annotations

import string
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DIGITS = string.digits
ALPHANUMERIC = string.digits + string.ascii_uppercase
VIN_CHARACTERS = "".join(c for c in ALPHANUMERIC if c not in "IOQ")
VIN_LENGTH, VIN_CHECK_PLACE = 17, 8
VIN_WEIGHTS = (8, 7, 6, 5, 4, 3, 2, 10, 0, 9, 8, 7, 6, 5, 4, 3, 2)
"""49 CFR 565.15 table IV; the ninth place is the check digit itself."""
VIN_VALUES = dict(
    zip("0123456789ABCDEFGHJKLMNPRSTUVWXYZ", map(int, "012345678912345678123457923456789"), strict=True)
)
"""49 CFR 565.15 table III."""
VIN_CHECKED = "12345L"
"""First characters of the regions whose rules ask for the check digit: North America and China (ISO 3780)."""

Remainders = NDArray[np.int64]


@dataclass(frozen=True)
class Remainder:
    """A check digit rule as a remainder."""

    alphabet: str
    modulus: int
    # function of a character, its place and the number of places; returns (modulus,) the next remainder for
    # each remainder, or None if the character is not allowed there
    step: Callable[[str, int, int], Remainders | None]
    first: int = 0
    good: tuple[int, ...] = (0,)
    least_places: int = 2
    length: int | None = None


def pure_system(
    modulus: int, radix: int, alphabet: str, *, supplementary: str = "", check_figures: int = 0
) -> Remainder:
    """ISO 7064 pure system: r -> (r radix + value) mod M, valid if it ends at 1. The `supplementary` character is only
    the check character; mod 97-10 has two check figures, others (0) one."""

    def step(char: str, place: int, n_places: int) -> Remainders | None:
        if char == supplementary and place != n_places - 1:
            return None
        if place >= n_places - check_figures and char not in DIGITS:
            return None
        value = alphabet.index(char)
        # in mod 97-10 a letter counts as two digits, 10 to 35
        shift = radix**2 if check_figures and value > 9 else radix
        return (np.arange(modulus) * shift + value) % modulus

    return Remainder(alphabet, modulus, step, good=(1,), least_places=1 + max(1, check_figures))


def hybrid_system(alphabet: str) -> Remainder:
    """ISO 7064 hybrid system: r -> (2 (r or M) mod (M + 1) + value) mod M, valid if it ends at 1."""
    # it starts at M / 2, which doubled is M, the value that ISO 7064 starts with
    m = len(alphabet)
    held = np.array([m, *range(1, m)])
    return Remainder(
        alphabet, m, lambda char, *_: (2 * held % (m + 1) + alphabet.index(char)) % m, first=m // 2, good=(1,)
    )


def every_second(values: str) -> Remainder:
    """Sum of the digits, every second one from the right replaced by its entry in `values`; valid if 0 mod 10."""

    def step(char: str, place: int, n_places: int) -> Remainders:
        value = values[int(char)] if (n_places - 1 - place) % 2 else char
        return (np.arange(10) + int(value)) % 10

    return Remainder(DIGITS, 10, step)


def _vin_step(char: str, place: int, n_places: int) -> Remainders | None:
    if place == VIN_CHECK_PLACE:
        return (np.arange(11) - (DIGITS + "X").index(char)) % 11 if char in DIGITS + "X" else None
    return (np.arange(11) + VIN_WEIGHTS[place] * VIN_VALUES[char]) % 11


def _vin_step_by_region(char: str, place: int, n_places: int) -> Remainders:
    if place == 0 and char not in VIN_CHECKED:
        return np.full(12, 11)
    checked = _vin_step(char, place, n_places)
    return np.append(np.full(11, -1) if checked is None else checked, 11)


REMAINDERS = {
    "vin": Remainder(
        VIN_CHARACTERS, 12, _vin_step_by_region, good=(0, 11), least_places=VIN_LENGTH, length=VIN_LENGTH
    ),
    "vin-na": Remainder(VIN_CHARACTERS, 11, _vin_step, least_places=VIN_LENGTH, length=VIN_LENGTH),
    "luhn": every_second("0246813579"),  # doubled, and its digits summed
    "gs1": every_second("0369258147"),  # three times
    "iso7064mod11_2": pure_system(11, 2, DIGITS + "X", supplementary="X"),
    "iso7064mod37_2": pure_system(37, 2, ALPHANUMERIC + "*", supplementary="*"),
    "iso7064mod97_10": pure_system(97, 10, ALPHANUMERIC, check_figures=2),
    "iso7064mod11_10": hybrid_system(DIGITS),
    "iso7064mod37_36": hybrid_system(ALPHANUMERIC),
}
