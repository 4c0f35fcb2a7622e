"""Texts that can be read from a marking if its part lies upside down or its map is mirrored.

    text --images of each character, in the new order--> texts --format--> another text, or none

    way                    order      exact images (the same shape in most dies)
    upside down            reversed   0-0 8-8 6-9 H I N O S X Z
    rows reversed          kept       0-0 3-3 8-8 B C D E H I K O X
    mirrored left-right    reversed   0-0 8-8 A H I M O T U V W X Y

A character also has likely images: what the recogniser reads instead, an L for an upside-down 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

import numpy as np

from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice


class Orientation(StrEnum):
    """Orientation of the parts."""

    UPRIGHT = "upright"
    ANY = "any"


class Way(StrEnum):
    """Another orientation in which the same marks can be read."""

    UPSIDE_DOWN = "upside down"
    ROWS_REVERSED = "with its rows in the other order"
    LEFT_RIGHT = "mirrored left to right"

    @property
    def reverses(self) -> bool:
        return self is not Way.ROWS_REVERSED

    @property
    def mirrors(self) -> bool:
        """Whether the map is mirrored: its rows are in reverse order."""
        return self is not Way.UPSIDE_DOWN


@dataclass(frozen=True)
class OtherText:
    """Another text of the same marks; `exact` if the shapes are the same, so that nothing tells the two apart."""

    text: str
    exact: bool


_EXACT = {
    Way.UPSIDE_DOWN: "00 0O OO 69 88 HH II NN SS XX ZZ bq dp ll nu oo ss xx zz -- ++ // :: == ..",
    Way.ROWS_REVERSED: "00 0O OO 33 88 BB CC DD EE HH II KK XX bp dq cc ll oo xx -- ++ :: ==",
    Way.LEFT_RIGHT: "00 0O OO 88 AA HH II MM TT UU VV WW XX YY bd pq ii ll oo vv ww xx -- ++ :: == ..",
}
# first in each word: a character; after it: what the recogniser reads if that is turned or mirrored, with a mean
# probability of at least 3 % in one of two samples; measured by:
# python tests/benchmarks/orientation.py characters [--seed 2]
_LIKELY = {
    Way.UPSIDE_DOWN: (
        "00O 11ILTV 2278Z 32689ES 47TV 59GS 69 724LZ 88 96 AV B8AEGM C03JO D0ACDGIOQ E3IT F134ADHIJ "
        "G09DIMO HH I1IL JCFPRT KIX L7IT MEINW NN O0O PD Q0O RDJ SS T1IL UAMN VA WDEM XX YAX ZZ"
    ),
    Way.ROWS_REVERSED: (
        "00OQ 114IJT 25S 323 4VY 52P 60289EGPQR 714AIJNSX 88 908AO AV BB CCG DD EE FEL GCEGO HH I1IL "
        "J129IT KK LFT MNW N1IMVW O0O PB Q0O R6BK S2 T1IL UAMN VA WM XX YAX Z5EFISTX"
    ),
    Way.LEFT_RIGHT: (
        "00O 11FILNRT 2S 38CE 44A 5278ACDEJZ 6068EO 7FRTVY 88 90289EPQR AA B8AE C03DJO D0ACDGIOQ "
        "E3EIJT F79IT G09DO HH I1IL JLU KINXY L14IJ MM NMVWX O0O P9QS Q0OQ R79AHIST S28E TT UU VV WW "
        "XX YY Z5EFISTXY"
    ),
}


def images_of(char: str, way: Way, *, exact: bool) -> str:
    """Characters as which a character may be read in another orientation, sorted."""
    same = _mutual(_EXACT[way]).get(char, frozenset())
    return "".join(sorted(same if exact else same | _mutual(_LIKELY[way]).get(char, frozenset())))


def other_text(text: str, way: Way, grammar: Grammar | None) -> OtherText | None:
    """Text of the same marks in another orientation, if the format allows one that differs."""
    for exact in (True, False):
        images = [images_of(char, way, exact=exact) for char in (text[::-1] if way.reverses else text)]
        if not text or not all(images):
            continue
        if exact and all(char in same for char, same in zip(text, images, strict=True)):
            return None  # the marks read the same either way
        allowed = _likeliest_allowed(images, way, grammar)
        other = next((candidate for candidate in allowed if candidate != text), None)
        if other is not None:
            return OtherText(other, exact)
    return None


def readable(text: str, way: Way, grammar: Grammar | None, *, exact: bool = False) -> bool:
    """Whether the marks of a text can be read in another orientation, as the same or another text."""
    images = [images_of(char, way, exact=exact) for char in (text[::-1] if way.reverses else text)]
    return bool(text) and all(images) and bool(_likeliest_allowed(images, way, grammar))


def _likeliest_allowed(images: Sequence[str], way: Way, grammar: Grammar | None) -> tuple[str, ...]:
    chars = tuple(sorted({*_mutual(_EXACT[way]), *_mutual(_LIKELY[way])}))
    log = np.full((len(images), len(chars)), -np.inf)
    for place, readings in enumerate(images):
        log[place, [chars.index(char) for char in readings]] = -math.log(len(readings) + 1.0)
    choice = choose(Lattice(chars, log), grammar, k=2)
    return tuple(text for text in (choice.text, *(rival.text for rival in choice.rivals)) if text)


@cache
def _mutual(words: str) -> Mapping[str, frozenset[str]]:
    images_by_char: dict[str, set[str]] = {}
    for word in words.split():
        for image in word[1:]:
            images_by_char.setdefault(word[0], set()).add(image)
            images_by_char.setdefault(image, set()).add(word[0])
    return {char: frozenset(images) for char, images in images_by_char.items()}
