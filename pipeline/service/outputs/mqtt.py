"""Publish results over MQTT; a result counts as delivered when the broker has accepted it (QoS 1).

{prefix}/parts/{part id}/result     the part as JSON, with the delivery's number; not retained
{prefix}/alerts/{name}              an alert as JSON, raised or cleared; retained
{prefix}/status                     online or offline; retained, and the last will of the connection

* With MQTT 5 a delivery has arrived when the broker has accepted it; one that it refuses (no right to the topic, too
  large) stays in the outbox. With MQTT 3.1.1 a broker cannot refuse: it acknowledges what it drops.
* Every connection has a client object of its own, thrown away with all it holds once the connection is lost or an
  acknowledgement is missing: an old result that the client sent again by itself could overtake a newer one.
* There is one connection at a time, made anew when it is next needed: for a result, or the next `ping`.
* Services with one prefix share the status. A running service says "online" every few seconds, so that it stands again
  after another one has said "offline".
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import TYPE_CHECKING

from glyphs.errors import MissingExtraError
from pipeline.common.records import Delivery
from pipeline.service.outputs.dispatch import DeliveryError, body_of
from pipeline.service.outputs.mqtt_connection import LEAVE_S, MqttConnection

if TYPE_CHECKING:
    from pipeline.service.settings import MqttSettings

ONLINE, OFFLINE = b"online", b"offline"
# seconds after which a running service says again that it is online
ONLINE_EVERY_S = 5.0
_NO_TOPIC = frozenset("+#\0")
_log = logging.getLogger(__name__)


def topic_level(name: str) -> str:
    """A name as one level of a topic."""
    return "".join("_" if c in _NO_TOPIC or c == "/" else c for c in name)


class MqttSender:
    """Publishes deliveries to a broker; connects again after a loss."""

    def __init__(self, settings: MqttSettings, *, timeout_s: float = 10.0) -> None:
        """Make the sender; nothing is connected yet.

        Args:
            settings: mqtt://host:1883 or mqtts://user:password@host:8883 (TLS; the broker's certificate is checked by
                the system's authorities, or those of the file SSL_CERT_FILE), and the prefix of the topics.
            timeout_s: for connecting, and for one acknowledgement.

        Raises:
            MissingExtraError: paho-mqtt is not installed.
        """
        try:
            import paho.mqtt.client  # noqa: F401 - asked for at the start, not with the first result
        except ImportError as error:
            raise MissingExtraError("MQTT", "paho-mqtt", "mqtt") from error
        self._settings, self._timeout_s = settings, timeout_s
        self._prefix, self._status = settings.prefix, f"{settings.prefix}/status"
        self._connecting = asyncio.Lock()
        self._connection: MqttConnection | None = None
        self._closed, self._online_s = False, 0.0
        if settings.version != "5":
            _log.warning(
                "MQTT %s: the broker cannot say that it refuses a result, and one that it refuses is lost",
                settings.version,
            )

    async def ping(self) -> bool:
        """Connect and stay so, that the status says online though there is nothing to publish.

        Raises:
            DeliveryError: no broker.
        """
        await self._connected()
        return True

    async def send(self, delivery: Delivery) -> None:
        """Publish a delivery and wait until the broker has accepted it.

        Raises:
            DeliveryError: no broker, no acknowledgement, or the broker refuses it.
        """
        connection = await self._connected()
        try:
            alert = delivery.payload.get("alert")
            about = f"parts/{delivery.part_id}/result" if alert is None else f"alerts/{topic_level(alert)}"
            await connection.publish(f"{self._prefix}/{about}", body_of(delivery), retain=alert is not None)
        except DeliveryError as error:
            if error.away:
                await connection.end()
            raise

    async def close(self) -> None:
        """Say goodbye, so that the status is offline at once, and disconnect."""
        self._closed = True
        async with self._connecting:
            connection, self._connection = self._connection, None
            if connection is not None:
                await self._say_goodbye(connection)

    async def _say_goodbye(self, connection: MqttConnection) -> None:
        # a connection that ends in order does not send its will
        with contextlib.suppress(DeliveryError, TimeoutError):
            async with asyncio.timeout(LEAVE_S):
                await connection.publish(self._status, OFFLINE, retain=True)
        await connection.end()

    async def _connected(self) -> MqttConnection:
        async with self._connecting:
            if self._closed:
                raise DeliveryError("closed", away=True)
            connection = self._connection
            if connection is not None and connection.lost.done():
                await connection.end()
                connection = self._connection = None
            if connection is None:
                will = (self._status, OFFLINE)
                connection = MqttConnection(self._settings, will=will, timeout_s=self._timeout_s)
                await connection.open()
            elif time.monotonic() - self._online_s < ONLINE_EVERY_S:
                return connection
            try:
                await connection.publish(self._status, ONLINE, retain=True)
            except BaseException as error:
                if not isinstance(error, DeliveryError) or error.away:
                    await self._say_goodbye(connection)  # others may have seen it online
                    raise
                # a broker that refuses this alone may take results all the same
                if self._connection is None:
                    _log.warning("the MQTT status is not set: %s", error)
            self._connection, self._online_s = connection, time.monotonic()
            return connection
