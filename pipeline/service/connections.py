"""Connections to other systems, as the dashboard and /readyz show them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from pipeline.common.records import WaitingResults

if TYPE_CHECKING:
    from pipeline.service.line.dispatch import TargetState

TARGETS = {"mqtt": "MQTT broker", "webhook": "Webhook"}


@dataclass(frozen=True)
class Connection:
    """One connection.

    Attributes:
        key: mqtt, webhook, tcp or opcua.
        name: in words.
        state: in words.
        works: nothing has to be done about it.
        since: begin of the state.
        waiting: results that wait to be sent, and since when; None if none wait.
        why: what is wrong, and what to do about it.
        is_target: results are sent to it; else it is a port that listens.
    """

    key: str
    name: str
    state: str
    works: bool
    since: datetime
    waiting: WaitingResults | None = None
    why: str = ""
    is_target: bool = False

    @property
    def summary(self) -> str:
        """The state, without addresses and names, for those who need no token."""
        if self.works:
            return self.state
        waiting = f", {self.waiting.n} results wait" if self.waiting else ""
        return f"{self.state} since {self.since:%Y-%m-%dT%H:%M:%SZ}{waiting}"


def target_connection(target: str, state: TargetState, waiting: WaitingResults | None) -> Connection:
    """The connection to a target of results."""
    words, why, n = "works", "", len(state.refused)
    if state.error:
        words, why = "cannot be reached", state.error
    elif n:
        words = f"refuses {n} {'result' if n == 1 else 'results'}"
        why = next(iter(state.refused.values()))
    return Connection(target, TARGETS[target], words, not why, state.since, waiting, why, is_target=True)
