"""Services that share a PostgreSQL, killed on the way: the history of a short run, and what its judge finds.

The database is killed too, and frozen for a while.
"""

from __future__ import annotations

import contextlib

from tests.faults.history import DATABASE, Arrival, Kill, judged
from tests.faults.plant import FROZEN, played
from tests.support.postgres_server import PostgresServer

PARTS, KILLS = 9, 1


def test_two_services_lose_double_and_reorder_nothing() -> None:
    with contextlib.closing(PostgresServer()) as server:
        outcome = played(server, "plant", parts=PARTS, kills=KILLS, database=[DATABASE, FROZEN], seed=5)
    assert not outcome.verdict.wrong, outcome.verdict
    assert outcome.parts == PARTS
    assert outcome.kills == KILLS + 2
    assert outcome.deliveries >= 3 * PARTS  # each part is read, and reviewed twice


def _arrived(*numbers: tuple[float, str, int]) -> list[Arrival]:
    return [Arrival(at_s, sender, "p", number) for at_s, sender, number in numbers]


def test_the_judge_sees_what_is_lost_doubled_and_reordered() -> None:
    whole = _arrived((0.0, "a", 1), (1.0, "b", 2))

    def wrong(
        arrivals: list[Arrival], *kills: Kill, wanted: int = 2, stored: tuple[str, ...] = ("p",)
    ) -> list[str]:
        return judged({"k": ["p"]}, {"k": stored}, {"p": wanted}, arrivals, kills, patience_s=3.0).wrong

    assert wrong(whole) == []
    assert wrong(whole, wanted=3) == ["p: 2 of 3 deliveries have arrived"]
    assert wrong(whole, stored=()) == ["k was answered and is not there: ['p']"]
    assert wrong(whole, stored=("p", "q")) == ["k has made ['p', 'q']"]
    assert wrong([*whole, *_arrived((2.0, "b", 1))]) == ["p: 1 by a, 2.00 s later by b", "p: 1 after 2"]
    again = [*whole, *_arrived((2.0, "a", 2))]
    assert wrong(again) == ["p: 2 by b, 1.00 s later by a"]
    assert wrong(again, Kill(1.5, "a", 1.5)) == wrong(again)  # not the one that had sent it
    assert wrong(again, Kill(1.5, "b", 1.5)) == []
    assert wrong(again, Kill(0.5, DATABASE, 1.2)) == []  # was away when it was to be noted
    assert wrong([*whole, *_arrived((4.0, "a", 2))]) == []
