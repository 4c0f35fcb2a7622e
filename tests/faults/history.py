"""What must be true of a history of services that share a store, whoever was killed on the way.

clients:   a part with a key, asked for until it is answered; reviews of it
receiver:  deliveries as they arrived, each with its number and who sent it
store:     what is there once everything has come to rest
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Arrival:
    """A delivery that reached the receiver, in the order that they did."""

    at_s: float
    sender: str
    part_id: str
    number: int


@dataclass(frozen=True)
class Kill:
    """Somebody was killed: a sender, or the database, which makes everybody forget what he was about to note."""

    at_s: float
    who: str
    back_s: float


DATABASE = "database"


@dataclass
class Verdict:
    """What was found; only who was killed, or had no answer, may have sent again."""

    lost: list[str] = field(default_factory=list)
    two_parts: list[str] = field(default_factory=list)
    repeated: list[str] = field(default_factory=list)
    reordered: list[str] = field(default_factory=list)
    repeated_after_a_kill: int = 0
    repeated_unanswered: int = 0

    @property
    def wrong(self) -> list[str]:
        """All that may not be."""
        return [*self.lost, *self.two_parts, *self.repeated, *self.reordered]


def judged(
    answered: Mapping[str, Sequence[str]],
    stored: Mapping[str, Sequence[str]],
    deliveries: Mapping[str, int],
    arrivals: Sequence[Arrival],
    kills: Sequence[Kill],
    *,
    patience_s: float,
) -> Verdict:
    """Judge a history.

    Args:
        answered: ids that were told for each key.
        stored: ids of the parts that the store has of each key.
        deliveries: how many there were to be of each part: it was read, and reviewed so many times.
        arrivals: in order.
        kills: in order.
        patience_s: a sender that had no answer for so long sends again, and rightly.
    """
    verdict = Verdict()
    for key, told in answered.items():
        if missing := set(told) - set(stored.get(key, ())):
            verdict.lost.append(f"{key} was answered and is not there: {sorted(missing)}")
    for key, ids in stored.items():
        if len(ids) > 1 or len(set(answered.get(key, ()))) > 1:
            verdict.two_parts.append(f"{key} has made {sorted({*ids, *answered.get(key, ())})}")
    by_part: dict[str, list[Arrival]] = defaultdict(list)
    for arrival in arrivals:
        by_part[arrival.part_id].append(arrival)
    for part_id, wanted in deliveries.items():
        had = len({arrival.number for arrival in by_part[part_id]})
        if had != wanted:
            verdict.lost.append(f"{part_id}: {had} of {wanted} deliveries have arrived")
    for part_id, came in by_part.items():
        _judge_order(verdict, part_id, came, kills, patience_s)
    return verdict


def _judge_order(
    verdict: Verdict, part_id: str, came: Iterable[Arrival], kills: Sequence[Kill], patience_s: float
) -> None:
    last: dict[int, Arrival] = {}
    newest = 0
    for arrival in came:
        before = last.get(arrival.number)
        if arrival.number < newest:
            verdict.reordered.append(f"{part_id}: {arrival.number} after {newest}")
        if before is not None:
            between = [kill for kill in kills if before.at_s <= kill.back_s and kill.at_s <= arrival.at_s]
            if any(kill.who in (before.sender, DATABASE) for kill in between):
                verdict.repeated_after_a_kill += 1
            elif arrival.at_s - before.at_s >= patience_s:
                verdict.repeated_unanswered += 1
            else:
                verdict.repeated.append(
                    f"{part_id}: {arrival.number} by {before.sender}, {arrival.at_s - before.at_s:.2f} s later by"
                    f" {arrival.sender}"
                )
        last[arrival.number] = arrival
        newest = max(newest, arrival.number)
