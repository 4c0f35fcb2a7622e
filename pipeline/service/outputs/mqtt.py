"""Publish results over MQTT; a result counts as delivered when the broker has accepted it (QoS 1).

{prefix}/parts/{part id}/result     the part as JSON, whole or short, with the delivery's number; not retained
{prefix}/alerts/{name}              an alert as JSON, raised or cleared; retained
{prefix}/status                     online or offline; retained, and the last will of the connection
{prefix}/trigger, {prefix}/touch    taken, if the settings say so: see `mqtt_calls`
{prefix}/answer                     the short result of such a call, or {"error": ...}; a call with a response topic
                                    is answered there, with its correlation data

* A delivery that the broker refuses (no right to the topic, too large) stays in the outbox. Only with MQTT 5 does a
  broker say that it refuses: older ones acknowledge what they drop.
* Every connection has a client object of its own, thrown away with all it holds once the connection is lost or an
  acknowledgement is missing: an old result that the client sent again by itself could overtake a newer one.
* paho's network thread calls back; everything here happens in the event loop.
* A call that comes while there is no connection is lost, and a retained one is ignored: it would be late.
* Services with one prefix share the status: a running one says "online" every few seconds.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import secrets
import socket
import ssl
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from glyphs.errors import MissingExtraError
from pipeline.common.line_decision import short_result
from pipeline.common.reading_records import from_json
from pipeline.common.records import Delivery, PartRecord
from pipeline.service.outputs.dispatch import DeliveryError, body_of
from pipeline.service.tasks import end_tasks, start

if TYPE_CHECKING:
    from pipeline.service.settings import MqttSettings

PORTS = {"mqtt": 1883, "mqtts": 8883}
QOS = 1
_CALLS = ("trigger", "touch")
# maximum number of calls in progress
MOST_CALLS = 16
# keepalive interval, s; a silent broker is noticed after one and a half of it
KEEPALIVE_S = 30
# seconds for an orderly end of a connection
LEAVE_S = 2.0
_UNSUPPORTED_VERSION, _NOT_AUTHORISED, _TOO_LARGE = 0x84, 0x87, 0x95
# protocol error (mosquitto's answer to a large message, which the library does not know), packet too large
_ENDS_OVER_A_MESSAGE = frozenset({0x82, _TOO_LARGE})
_TOO_LONG = "raise the broker's limit for messages"
# maximum overhead of a message beside topic and payload, bytes
_HEAD_BYTES = 16
ONLINE, OFFLINE = b"online", b"offline"
# seconds after which a running service says again that it is online
ONLINE_EVERY_S = 5.0
_log = logging.getLogger(__name__)


def _topic_level(name: str) -> str:
    return re.sub(r"[+#/\0]", "_", name)


async def _answer_nothing(_call: str, _payload: bytes) -> bytes:
    return b""


class MqttSender:
    """Publish deliveries to a broker; connect again after a loss."""

    def __init__(
        self,
        settings: MqttSettings,
        answer_call: Callable[[str, bytes], Awaitable[bytes]] = _answer_nothing,
        *,
        timeout_s: float = 10.0,
    ) -> None:
        """Prepare the sender; `timeout_s` is for connecting, and for one acknowledgement. TLS certificates are checked
        by the system's authorities, or those of the file SSL_CERT_FILE. `answer_call` answers a trigger or touch.
        Raises MissingExtraError: paho-mqtt is not installed."""
        try:
            import paho.mqtt.client  # noqa: F401 - asked for at the start, not with the first result
        except ImportError as error:
            raise MissingExtraError("MQTT", "paho-mqtt", "mqtt") from error
        self._settings, self._timeout_s = settings, timeout_s
        self._prefix, self._status = settings.prefix, f"{settings.prefix}/status"
        self._connecting = asyncio.Lock()
        self._connection: MqttConnection | None = None
        self._closed, self._online_s = False, 0.0
        self._answer_call = answer_call
        self._calling: set[asyncio.Future[Any]] = set()

    async def ping(self) -> bool:
        """Stay connected, so that the status is online with nothing to publish. Raises DeliveryError: no broker."""
        await self._connect()
        return True

    async def send(self, delivery: Delivery) -> None:
        connection = await self._connect()
        try:
            alert = delivery.payload.get("alert")
            about = f"parts/{delivery.part_id}/result" if alert is None else f"alerts/{_topic_level(alert)}"
            if alert is None and self._settings.payload == "short":
                delivery = replace(delivery, payload=_short(delivery.payload))
            await connection.publish(f"{self._prefix}/{about}", body_of(delivery), retain=alert is not None)
        except DeliveryError as error:
            if error.away:
                await connection.end()
            raise

    async def close(self) -> None:
        self._closed = True
        await end_tasks(self._calling)
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

    async def _connect(self) -> MqttConnection:
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
                if self._settings.triggers:
                    connection.subscribe([f"{self._prefix}/{call}" for call in _CALLS], self._take_call)
            elif time.monotonic() - self._online_s < ONLINE_EVERY_S:
                return connection
            try:
                await connection.publish(self._status, ONLINE, retain=True)
            except BaseException as error:
                if not isinstance(error, DeliveryError) or error.away:
                    await self._say_goodbye(connection)  # others may have seen it online
                    raise
                # a broker that refuses only this still takes results
                if self._connection is None:
                    _log.warning("the MQTT status is not set: %s", error)
            self._connection, self._online_s = connection, time.monotonic()
            return connection

    def _take_call(self, message: Any) -> None:
        if message.retain or self._closed:
            _log.warning("a retained call of MQTT was ignored: %s", message.topic)
            return
        if len(self._calling) >= MOST_CALLS:
            _log.warning("a call of MQTT was ignored: %s others are in progress", MOST_CALLS)
            return
        start(self._publish_answer(message), self._calling)

    async def _publish_answer(self, message: Any) -> None:
        answer = await self._answer_call(message.topic.rpartition("/")[2], message.payload)
        properties = getattr(message, "properties", None)
        topic = getattr(properties, "ResponseTopic", None) or f"{self._prefix}/answer"
        with contextlib.suppress(DeliveryError, ValueError):  # the result is in the outbox
            connection = await self._connect()
            await connection.publish(topic, answer, correlation=getattr(properties, "CorrelationData", None))


def _short(payload: Mapping[str, Any]) -> dict[str, Any]:
    known = {field.name for field in fields(PartRecord)}
    part = from_json(PartRecord, {name: value for name, value in payload.items() if name in known})
    return short_result(replace(part, text=part.text or payload.get("candidate", "")))


class MqttConnection:
    """One connection, for as long as it lasts; `lost` is done once the broker is gone, with the reason in words."""

    def __init__(self, settings: MqttSettings, *, will: tuple[str, bytes], timeout_s: float) -> None:
        """`will` are topic and payload that the broker publishes, retained, if this connection breaks."""
        from paho.mqtt import client as paho
        from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

        parts = urlsplit(settings.url)
        self._host, self._port = parts.hostname or "", parts.port or PORTS[parts.scheme]
        self._user = unquote(parts.username) if parts.username else None
        self._timeout_s = timeout_s
        self._loop = asyncio.get_running_loop()
        self._client = client = paho.Client(
            CallbackAPIVersion.VERSION2,
            client_id=f"tactile-marks-{secrets.token_hex(6)}",
            protocol=MQTTProtocolVersion.MQTTv5,
            reconnect_on_failure=False,
        )
        client.connect_timeout = timeout_s
        client.max_inflight_messages_set(1)  # a broker may ask for so few
        if self._user is not None:
            client.username_pw_set(self._user, unquote(parts.password) if parts.password else None)
        if parts.scheme == "mqtts":
            client.tls_set_context(ssl.create_default_context())
        client.will_set(will[0], will[1], QOS, retain=True)
        client.on_connect = lambda _c, _d, _f, code, properties: self._in_loop(self._accept, code, properties)
        client.on_disconnect = lambda _c, _d, _f, code, _p: self._in_loop(self._end_with, code)
        client.on_publish = lambda _c, _d, mid, code, _p: self._in_loop(self._acknowledge, mid, code)
        self.lost: asyncio.Future[str] = self._loop.create_future()
        self._accepted: asyncio.Future[Any] = self._loop.create_future()
        self._pending: dict[int, tuple[asyncio.Future[Any], int]] = {}
        self._blamed = -1  # number of the message for which the broker has ended the connection
        self._most_bytes = 0

    async def open(self) -> None:
        """Connect. Raises DeliveryError: no broker there, or it refuses the connection."""
        try:
            await asyncio.to_thread(self._client.connect, self._host, self._port, KEEPALIVE_S)
        except (OSError, ValueError) as error:
            raise self._away(str(error)) from error
        self._client.loop_start()
        try:
            code = await self._first(self._accepted)
        except asyncio.CancelledError:
            self._drop()  # which ends its thread
            raise
        except DeliveryError:
            await self.end()
            raise
        if code.is_failure:
            await self.end()
            hint = "it has to speak MQTT 5" if code.value == _UNSUPPORTED_VERSION else ""
            raise DeliveryError(f"the broker refuses the connection: {code}", hint=hint, away=True)

    def subscribe(self, topics: Sequence[str], take: Callable[[Any], None]) -> None:
        self._client.on_message = lambda _c, _d, message: self._in_loop(take, message)
        self._client.subscribe([(topic, QOS) for topic in topics])

    async def publish(
        self, topic: str, payload: bytes, *, retain: bool = False, correlation: bytes | None = None
    ) -> None:
        """Publish, and wait. Raises DeliveryError: no acknowledgement in time, or the broker refuses it."""
        n_bytes = _HEAD_BYTES + len(topic.encode()) + len(payload)
        if 0 < self._most_bytes < n_bytes:
            what = f"the broker refuses it: it has {n_bytes} bytes, {self._most_bytes} may be"
            raise DeliveryError(what, hint=_TOO_LONG)
        acknowledged: asyncio.Future[Any] = self._loop.create_future()
        properties = None
        if correlation is not None:
            from paho.mqtt.packettypes import PacketTypes
            from paho.mqtt.properties import Properties

            properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
            properties.CorrelationData = correlation
        sent = self._client.publish(topic, payload, QOS, retain, properties)
        self._pending[sent.mid] = (acknowledged, n_bytes)
        try:
            code = await self._first(acknowledged)
        except DeliveryError:
            if sent.mid != self._blamed:
                raise
            raise DeliveryError(
                f"the broker refuses it: {self.lost.result()}; it has {n_bytes} bytes", hint=_TOO_LONG
            ) from None
        finally:
            del self._pending[sent.mid]
        if code.is_failure:
            denied = f"let the user {self._user or 'without a name'} write to {topic}"
            hints = {_NOT_AUTHORISED: denied, _TOO_LARGE: _TOO_LONG}
            raise DeliveryError(f"the broker refuses it: {code}", hint=hints.get(code.value, ""))

    async def end(self) -> None:
        if self._accepted.done() and not self.lost.done():
            self._client.disconnect()
            await asyncio.wait({self.lost}, timeout=LEAVE_S)
        if not self.lost.done():
            self.lost.set_result("it does not answer")
        self._drop()
        await asyncio.to_thread(self._client.loop_stop)

    async def _first(self, answer: asyncio.Future[Any]) -> Any:
        await asyncio.wait({answer, self.lost}, timeout=self._timeout_s, return_when=asyncio.FIRST_COMPLETED)
        if answer.done():
            return answer.result()
        raise self._away(self.lost.result() if self.lost.done() else "it does not answer")

    def _away(self, why: str) -> DeliveryError:
        return DeliveryError(f"the broker {self._host}:{self._port} cannot be reached: {why}", away=True)

    def _drop(self) -> None:
        raw: Any = self._client.socket()
        if raw is not None:
            with contextlib.suppress(OSError):
                raw.shutdown(socket.SHUT_RDWR)

    def _in_loop(self, call: Callable[..., object], *arguments: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(call, *arguments)

    def _accept(self, code: Any, properties: Any) -> None:
        if not self._accepted.done():
            self._most_bytes = getattr(properties, "MaximumPacketSize", 0)
            self._accepted.set_result(code)

    def _acknowledge(self, number: int, code: Any) -> None:
        acknowledged, _ = self._pending.get(number, (None, 0))
        if acknowledged is not None and not acknowledged.done():
            acknowledged.set_result(code)

    def _end_with(self, code: Any) -> None:
        if self.lost.done():
            return
        if code.value in _ENDS_OVER_A_MESSAGE and self._pending:
            # it does not say which one
            self._blamed = max(self._pending, key=lambda number: self._pending[number][1])
        self.lost.set_result(str(code))
