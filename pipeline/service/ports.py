"""Inputs and outputs of the service beside HTTP: trigger ports, a watched folder, targets of results."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Protocol

import structlog

from pipeline.service.outputs.dispatch import Connection, Dispatcher, Sender

if TYPE_CHECKING:
    from pipeline.service.intake import Intake
    from pipeline.service.settings import ServiceSettings

log = structlog.get_logger("tactile-marks")


class Input(Protocol):
    """Bring parts to the intake; `title` is its name in the log."""

    title: str

    async def start(self) -> dict[str, object]:
        """Start; return its address or folder for the log. Raise OSError for an address that is not available."""

    async def stop(self, *, grace_s: float) -> None:
        """Stop; parts being read get `grace_s`."""


def senders_of(settings: ServiceSettings) -> dict[str, Sender]:
    """The targets of results in the settings.

    Raises:
        MissingExtraError: a library of an extra is not installed.
        SettingsError: an invalid webhook secret.
    """
    senders: dict[str, Sender] = {}
    if settings.webhook.url:
        from pipeline.service.outputs.webhook import WebhookSender

        senders["webhook"] = WebhookSender(settings.webhook)
    if settings.mqtt.url:
        from pipeline.service.outputs.mqtt import MqttSender

        senders["mqtt"] = MqttSender(settings.mqtt)
    return senders


class Ports:
    """Inputs and the dispatcher of one service."""

    def __init__(self, settings: ServiceSettings, intake: Intake, senders: Mapping[str, Sender]) -> None:
        """Make inputs and outputs from the settings; nothing is opened or sent yet.

        Raises:
            FileError: an unusable folder to watch.
            MissingExtraError: a library of an extra is not installed.
            ValueError: an invalid address or format.
        """
        self._intake, self._grace_s = intake, settings.shutdown_grace_s
        self._dispatcher = Dispatcher(intake.store, senders)
        self._inputs: dict[str, Input] = {}
        self._open: list[Connection] = []
        if settings.tcp.port is not None:
            from pipeline.service.inputs.tcp import TcpPort

            self._inputs["tcp"] = TcpPort(settings.tcp, intake.trigger)
        if settings.opcua.port is not None:
            from pipeline.service.inputs.opcua import OpcUaPort

            self._inputs["opcua"] = opcua = OpcUaPort(settings.opcua, intake.trigger)
            intake.on_part = opcua.show
        if settings.watch.folder is not None:
            from pipeline.service.inputs.watch_folder import WatchedFolder

            self._inputs["watch"] = WatchedFolder(
                settings.watch, intake, most_bytes=settings.limits.upload_bytes, at_once=settings.jobs
            )

    def connections(self) -> tuple[Connection, ...]:
        """The present connections.

        Raises:
            StoreError: the store does not answer.
        """
        states = self._dispatcher.states
        waiting = self._intake.store.waiting_results() if states else {}
        targets = (replace(state, waiting=waiting.get(target)) for target, state in states.items())
        return (*targets, *self._open)

    @contextlib.asynccontextmanager
    async def opened(self) -> AsyncIterator[None]:
        """Open the inputs and send waiting results; on leaving, running work may finish first.

        Raises:
            OSError: an address that cannot be had.
        """
        async with contextlib.AsyncExitStack() as stack:
            self._dispatcher.start()
            # results come from threads as well
            wake = partial(asyncio.get_running_loop().call_soon_threadsafe, self._dispatcher.wake)
            self._intake.on_result = wake
            stack.push_async_callback(self._dispatcher.stop, grace_s=min(self._grace_s, 10.0))
            for key, one in self._inputs.items():
                place = await one.start()
                stack.push_async_callback(one.stop, grace_s=self._grace_s)
                log.info(one.title, **place)
                if "port" in place:
                    address = f"{place['host']}:{place['port']}"
                    self._open.append(Connection(key, one.title, datetime.now(UTC), address))
            yield
