"""Connections to other systems, as the dashboard and /readyz show them."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime

from pipeline.common.records import WaitingResults

TARGETS = {"mqtt": "MQTT broker", "webhook": "Webhook"}
"""Names of the targets of results, in words."""


@dataclass
class Connection:
    """One connection: a target of results, or a port that listens.

    Attributes:
        key: mqtt, webhook, tcp or opcua.
        name: in words.
        since: begin of the state.
        address: where a port listens; empty for a target.
        error: why a target cannot be reached; empty while it can, as far as is known.
        refused: why a target does not take results, by their numbers.
        waiting: results that wait to be sent, and since when; None if none wait.
    """

    key: str
    name: str
    since: datetime
    address: str = ""
    error: str = ""
    refused: dict[int, str] = field(default_factory=dict)
    waiting: WaitingResults | None = None

    @property
    def why(self) -> str:
        """What is wrong, and what to do about it; empty where nothing is."""
        return self.error or next(iter(self.refused.values()), "")

    @property
    def state(self) -> str:
        """The state in words."""
        if self.error:
            return "cannot be reached"
        if n := len(self.refused):
            return f"refuses {n} {'result' if n == 1 else 'results'}"
        return f"listens at {self.address}" if self.address else "works"

    @property
    def summary(self) -> str:
        """The state without addresses and names, for callers without a token."""
        if not self.why:
            return self.state
        waiting = f", {self.waiting.n} results wait" if self.waiting else ""
        return f"{self.state} since {self.since:%Y-%m-%dT%H:%M:%SZ}{waiting}"
