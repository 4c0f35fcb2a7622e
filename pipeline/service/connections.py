"""The service's connections to others, as the dashboard and /readyz show them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from pipeline.common.records import WaitingResults

TARGETS = {"mqtt": "MQTT broker", "webhook": "Webhook"}


@dataclass(frozen=True)
class Connection:
    """One connection.

    Attributes:
        key: mqtt, webhook, tcp or opcua.
        name: in words.
        state: in words.
        works: whether nothing has to be done about it.
        since: when the state began.
        waiting: results that wait to be sent, and since when; None of a port, to which nothing is sent.
        why: what is wrong, and what to do about it.
    """

    key: str
    name: str
    state: str
    works: bool
    since: datetime
    waiting: WaitingResults | None = None
    why: str = ""

    @property
    def summary(self) -> str:
        """The state, without addresses and names, for those who need no token."""
        if self.works:
            return self.state
        waiting = f", {self.waiting.n} results wait" if self.waiting else ""
        return f"{self.state} since {self.since:%Y-%m-%dT%H:%M:%SZ}{waiting}"


def target_connection(
    target: str, *, since: datetime, error: str, refused: Mapping[int, str], waiting: WaitingResults | None
) -> Connection:
    """The connection to a target of results.

    Args:
        target: mqtt or webhook.
        since: when it became reachable, or ceased to be.
        error: why it cannot be reached; empty while it can.
        refused: why it does not take results, by their numbers.
        waiting: results for it.
    """
    if error:
        words, why = "cannot be reached", error
    elif refused:
        n = len(refused)
        words, why = f"refuses {n} {'result' if n == 1 else 'results'}", next(iter(refused.values()))
    else:
        words, why = "works", ""
    return Connection(target, TARGETS[target], words, not why, since, waiting, why)
