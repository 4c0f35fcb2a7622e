"""What the service has beside HTTP: trigger ports, a folder that it watches, targets that it publishes results to."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING

import structlog

from pipeline.common.version import program_version
from pipeline.service.connections import Connection, target_connection
from pipeline.service.line.dispatch import Dispatcher, Sender
from pipeline.service.line.watch_folder import WatchedFolder, watch_journal

if TYPE_CHECKING:
    from pipeline.service.part_service import PartService
    from pipeline.service.settings import ServiceSettings
    from pipeline.store.store import Store

log = structlog.get_logger("tactile-marks")


class Ports:
    """The trigger ports and the dispatcher of one service."""

    def __init__(self, settings: ServiceSettings) -> None:
        """Make ready what the settings ask for; nothing is opened or sent yet.

        Raises:
            FileError: a folder to watch that is none, or the journal of its files that cannot be used.
            MissingExtraError: a library of an extra is not installed.
            ValueError: an address that cannot be.
        """
        self._settings = settings
        self.senders: dict[str, Sender] = {}
        self._dispatcher: Dispatcher | None = None
        self._open: dict[str, Connection] = {}
        if settings.webhook:
            from pipeline.service.line.webhook import WebhookSender

            self.senders["webhook"] = WebhookSender(settings.webhook, secret=settings.webhook_secret)
        if settings.mqtt:
            from pipeline.service.line.mqtt import MqttSender

            self.senders["mqtt"] = MqttSender(
                settings.mqtt, prefix=settings.mqtt_prefix, version=settings.mqtt_version
            )
        if settings.tcp_format:
            from pipeline.service.line.result_string import ResultString

            ResultString(settings.tcp_format)
        if settings.opcua_port is not None:
            from pipeline.service.line.opcua import require_asyncua

            require_asyncua()
        self._watch_journal = watch_journal(settings)

    def connections(self, store: Store) -> tuple[Connection, ...]:
        """The connections to others as they are now.

        Raises:
            StoreError: the store does not answer.
        """
        states = self._dispatcher.states if self._dispatcher is not None else {}
        waiting = store.waiting_results() if states else {}
        targets = (
            target_connection(
                target,
                since=state.since,
                error=state.error,
                refused=state.refused,
                waiting=waiting.get(target),
            )
            for target, state in states.items()
        )
        return (*targets, *self._open.values())

    def _note_open(self, key: str, name: str, host: str, port: int) -> None:
        log.info(name, host=host, port=port)
        self._open[key] = Connection(key, name, f"listens at {host}:{port}", True, datetime.now(UTC))

    @contextlib.asynccontextmanager
    async def opened(self, parts: PartService) -> AsyncIterator[None]:
        """Open the ports and send what waits; on leaving, what is at work may end first.

        Raises:
            OSError: an address that cannot be had.
        """
        settings, grace_s = self._settings, self._settings.shutdown_grace_s
        async with contextlib.AsyncExitStack() as stack:
            if self.senders:
                self._dispatcher = dispatcher = Dispatcher(parts.store, self.senders)
                dispatcher.start()
                loop = asyncio.get_running_loop()
                # results come from threads as well
                parts.on_result = partial(loop.call_soon_threadsafe, dispatcher.wake)
                stack.push_async_callback(dispatcher.stop, grace_s=min(grace_s, 10.0))
            if settings.tcp_port is not None:
                from pipeline.service.line.result_string import DEFAULT_FORMAT
                from pipeline.service.line.tcp import TcpPort

                tcp = TcpPort(
                    parts.trigger,
                    host=settings.line_host,
                    port=settings.tcp_port,
                    template=settings.tcp_format or DEFAULT_FORMAT,
                    clients=settings.tcp_clients,
                )
                await tcp.start()
                stack.push_async_callback(tcp.stop, grace_s=grace_s)
                self._note_open("tcp", "TCP trigger port", tcp.host, tcp.port)
            if settings.opcua_port is not None:
                from pipeline.service.line.opcua import OpcUaPort

                opcua = OpcUaPort(
                    parts.trigger,
                    host=settings.line_host,
                    port=settings.opcua_port,
                    version=program_version(),
                    users=settings.opcua_users,
                    certificate=settings.opcua_certificate,
                    private_key=settings.opcua_key,
                )
                await opcua.start()
                stack.push_async_callback(opcua.stop, grace_s=grace_s)
                parts.on_part = opcua.show
                self._note_open("opcua", "OPC UA server", opcua.host, opcua.port)
            if settings.watch is not None and self._watch_journal is not None:
                watched = WatchedFolder(
                    settings.watch,
                    parts,
                    journal=self._watch_journal,
                    job=settings.watch_job,
                    every_s=settings.watch_every_s,
                    a_set=settings.watch_photos,
                    settle_s=settings.watch_settle_s,
                    most_bytes=settings.max_upload_mb * 1_000_000,
                    at_once=settings.jobs,
                )
                stack.callback(self._watch_journal.close)
                watched.start()
                stack.push_async_callback(watched.stop, grace_s=grace_s)
                log.info("watched folder", folder=str(watched.folder), every_s=settings.watch_every_s)
            yield
