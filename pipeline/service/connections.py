"""Connections to other systems, as the dashboard and /readyz show them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from pipeline.common.records import WaitingResults


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
        """The state without addresses and names, for callers without a token."""
        if self.works:
            return self.state
        waiting = f", {self.waiting.n} results wait" if self.waiting else ""
        return f"{self.state} since {self.since:%Y-%m-%dT%H:%M:%SZ}{waiting}"
