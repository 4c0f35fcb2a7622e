"""Looks every few seconds whether an alert is to be raised or cleared.

latest parts, drift, golden part --store--> alerts --outbox--> webhook, MQTT
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import structlog

from pipeline.store.alerts import REJECT_RATE, REVIEW_RATE
from pipeline.store.store import Store, StoreError

if TYPE_CHECKING:
    from pipeline.service.settings import AlertSettings

LOOK_S = 5.0
"""Between looks: a window of parts takes longer."""
log = structlog.get_logger("tactile-marks")


class AlertWatch:
    """Raises alerts, and clears them."""

    def __init__(
        self,
        store: Store,
        settings: AlertSettings,
        *,
        drifts: Callable[[], Mapping[str, str | None]],
        others: Callable[[], Mapping[str, str | None]],
        targets: Sequence[str],
        sent: Callable[[], object],
    ) -> None:
        """Take what it works with.

        Args:
            store: of parts and alerts.
            settings: limits and window.
            drifts: how the parts differ from the certified ones, by job, as `look_for_alerts` has it.
            others: what the golden part and the bench show, by the alert's name.
            targets: where alerts are sent.
            sent: called when there is something to be sent.
        """
        self._store, self._drifts, self._others, self._sent = store, drifts, others, sent
        self._targets = tuple(targets)
        self._limits = {REJECT_RATE: settings.reject_rate, REVIEW_RATE: settings.review_rate}
        self._window = settings.window

    def look(self) -> None:
        """Look once.

        Raises:
            StoreError: the store cannot be used.
        """
        raised = self._store.look_for_alerts(
            limits=self._limits,
            window=self._window,
            drifts=self._drifts(),
            others=self._others(),
            targets=self._targets,
        )
        for alert in raised:
            log.warning("alert", alert=alert.name, why=alert.message)
        self._sent()

    async def run(self) -> None:
        """Look for ever."""
        away = False
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await asyncio.to_thread(self.look)
                away = False
            except StoreError:
                if not away:
                    log.exception("alerts cannot be looked for; trying again")
                away = True
            except Exception:  # a fault in one alert may not end all
                log.exception("look for alerts failed")
