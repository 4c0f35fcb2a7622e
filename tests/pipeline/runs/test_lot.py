"""A lot teaches itself: who teaches, what a second reading may change, and that one wrong reading teaches nobody."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from pipeline.runs.lot import (
    EXEMPLARS_EACH,
    LEAST_AGREEMENT,
    MOST_TEACHERS,
    is_better,
    needs_another,
    teachers,
)
from recognition.enrol.exemplars import ExemplarError
from recognition.enrol.learned_font import Learned, agreement, learn_font
from tests.support.felt import blow

GOTHIC, TIMES = load_font("gothic"), load_font("timesr")


@dataclass(frozen=True)
class Read:
    part: str
    text: str
    decision: str = "accept"
    confidence: float = 0.95
    error: str = ""


def texts(n: int) -> list[Read]:
    rng = np.random.default_rng(1)
    letters = list("ABCDEFGH0123456789")
    return [
        Read(f"p{k:03d}", "".join(rng.choice(letters, 8)), confidence=round(float(rng.uniform(0.9, 1.0)), 2))
        for k in range(n)
    ]


def learned(parts: list[tuple[str, str]]) -> Learned:
    """Of parts (stamped, as read)."""
    chars = [char for _, read in parts for char in read]
    reliefs = [blow(char, 10 * k, GOTHIC) for k, (stamped, _) in enumerate(parts) for char in stamped]
    return learn_font("lot-die", chars, reliefs, known=(TIMES,), vouching=False)


# ---------------------------------------------------------------------------------------------------- who teaches


def test_the_order_of_the_parts_makes_no_difference() -> None:
    lot = texts(200)
    assert teachers(lot) == teachers(lot[::-1]) == teachers(lot[77:] + lot[:77])


def test_only_what_was_accepted_teaches_and_the_surest_first() -> None:
    lot = [
        Read("unsure", "ABCD", "review", 0.99),
        Read("bad", "ABCD", "accept", 0.99, error="cannot be read"),
        *(Read(f"late{k}", "EFGH", confidence=0.91) for k in range(EXEMPLARS_EACH)),
        *(Read(f"sure{k}", "EFGH", confidence=0.99) for k in range(EXEMPLARS_EACH)),
        Read("rare", "E F9", confidence=0.9),
    ]
    chosen = teachers(lot)
    assert [*chosen] == ["rare", *(f"sure{k}" for k in range(EXEMPLARS_EACH))]
    assert chosen["rare"] == "EF9"


def test_every_character_gets_its_exemplars_and_no_more_parts_than_that_takes() -> None:
    chosen = teachers(texts(400))
    assert len(chosen) <= MOST_TEACHERS
    assert min(Counter("".join(chosen.values())).values()) >= EXEMPLARS_EACH


def test_nobody_teaches_where_nothing_was_accepted() -> None:
    assert teachers([replace(outline, decision="review") for outline in texts(30)]) == {}


# --------------------------------------------------------------------------------- what a second reading may change


@pytest.mark.parametrize(
    ("first", "second", "better"),
    [
        (Read("a", "AB12"), Read("a", "AB17", "accept", 0.99), False),  # an accepted part never changes
        (Read("a", "AB12"), Read("a", "AB12", "accept", 0.99), False),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB17", "accept", 0.95), True),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB12", "review", 0.8), True),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB12", "review", 0.5), False),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB17", "review", 0.8), False),
        (Read("a", "", "reject", 0.0), Read("a", "AB12", "accept", 0.95), True),
        (Read("a", "AB12", "review", 0.6), Read("a", "", "", 0.0, "its worker is lost"), False),
        (Read("a", "", "", 0.0, "cannot be read"), Read("a", "AB12", "accept", 0.95), False),
    ],
)
def test_a_second_reading_counts_where_it_is_accepted_or_surer(
    first: Read, second: Read, better: bool
) -> None:
    assert is_better(second, first) is better
    assert needs_another(first) or not better


def test_what_counts_counts_for_good() -> None:
    """Asked again of the reading that was taken, as a run taken up again asks, nothing changes."""
    second = Read("a", "AB12", "review", 0.8)
    assert not is_better(second, second)


# -------------------------------------------------------------------------------------- a wrong reading teaches nobody


def test_fewer_than_three_that_agree_teach_nothing() -> None:
    """Two of M, three of W of which one is an H: neither is of the die, and readings with them are doubted."""
    database = learned([*[("K7B2", "K7B2")] * 4, ("MW", "MW"), ("MW", "MW"), ("H", "W")])
    assert {char for char, used in database.used.items() if used} == set("K7B2")
    assert database.font.glyphs["M"].guessed
    assert database.font.glyphs["W"].guessed
    assert not database.font.glyphs["K"].guessed


def test_a_lot_of_which_no_character_is_sure_teaches_nothing() -> None:
    with pytest.raises(ExemplarError, match="no character has 3 exemplars that agree"):
        learned([("K7B2", "K7B2")] * 2)


def test_parts_of_two_dies_do_not_agree() -> None:
    text = "K7B2"
    assert agreement(text * 8, learned([(text, text)] * 8).used) == 1.0
    reliefs = [blow(c, 10 * k, font) for k, font in enumerate([GOTHIC, TIMES] * 4) for c in text]
    mixed = learn_font("lot-die", text * 8, reliefs, known=(TIMES,), vouching=False)
    assert agreement(text * 8, mixed.used) < LEAST_AGREEMENT
