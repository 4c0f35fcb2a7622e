"""One connection to an MQTT broker, with a client object of its own that is thrown away with it.

* With MQTT 5 the broker says of each message whether it takes it. MQTT 3.1.1 knows no such answer: a broker that drops
  a message acknowledges it all the same.
* paho's network thread calls back; everything here happens in the event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.service.line.dispatch import DeliveryError

QOS = 1
LEAVE_S = 2.0
"""Seconds for an orderly end of a connection."""
_UNSUPPORTED_VERSION, _NOT_AUTHORISED, _TOO_LARGE = 0x84, 0x87, 0x95
_ENDS_OVER_A_MESSAGE = frozenset({0x82, _TOO_LARGE})
"""Protocol error (mosquitto's answer to a large message, which the library does not know), packet too large."""
_TOGETHER = 20
"""Messages on the way at most; a broker may ask for fewer."""
_HEAD_BYTES = 16
"""Of a message, beside topic and payload, at most."""

MqttVersion = Literal["5", "3.1.1"]


@dataclass(frozen=True)
class Broker:
    """A broker and how it is called.

    Attributes:
        host, port: where it listens.
        client_id: of this program.
        version: of the protocol.
        user, password: None where it asks for none.
        tls: settings of TLS; None without it.
        timeout_s: for connecting, and for one acknowledgement.
        keepalive_s: between signs of life; a silent broker is noticed after one and a half of it.
    """

    host: str
    port: int
    client_id: str
    version: MqttVersion = "5"
    user: str | None = None
    password: str | None = field(default=None, repr=False)
    tls: ssl.SSLContext | None = None
    timeout_s: float = 10.0
    keepalive_s: int = 30


class MqttConnection:
    """One connection, for as long as it lasts.

    Attributes:
        lost: done once the broker is gone, with the reason in words.
    """

    def __init__(self, broker: Broker, *, will: tuple[str, bytes], heard: Callable[[bytes], object]) -> None:
        """Make ready; nothing is connected yet.

        Args:
            broker: to connect to.
            will: topic and payload that the broker publishes, retained, if this connection breaks.
            heard: called with the payloads of a topic that is listened to.
        """
        from paho.mqtt import client as paho
        from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

        new = broker.version == "5"
        self._broker, self._loop = broker, asyncio.get_running_loop()
        self._client = client = paho.Client(
            CallbackAPIVersion.VERSION2,
            client_id=broker.client_id,
            clean_session=None if new else True,
            protocol=MQTTProtocolVersion.MQTTv5 if new else MQTTProtocolVersion.MQTTv311,
            reconnect_on_failure=False,
        )
        client.connect_timeout = broker.timeout_s
        if broker.user is not None:
            client.username_pw_set(broker.user, broker.password)
        if broker.tls is not None:
            client.tls_set_context(broker.tls)
        client.will_set(will[0], will[1], QOS, retain=True)
        client.on_connect = self._on_connect
        client.on_disconnect = lambda _c, _d, _f, code, _p: self._in_loop(self._end_with, code)
        client.on_publish = lambda _c, _d, mid, code, _p: self._in_loop(self._acknowledge, mid, code)
        client.on_message = lambda _c, _d, message: self._in_loop(heard, message.payload)
        self.lost: asyncio.Future[str] = self._loop.create_future()
        self._accepted: asyncio.Future[Any] = self._loop.create_future()
        self._pending: dict[int, tuple[asyncio.Future[Any], int]] = {}
        self._blamed = -1  # number of the message for which the broker has ended the connection
        self._most_bytes = 0
        self._room = asyncio.Semaphore(_TOGETHER)

    async def open(self) -> None:
        """Connect.

        Raises:
            DeliveryError: no broker there, or it refuses the connection.
        """
        broker, where = self._broker, f"{self._broker.host}:{self._broker.port}"
        try:
            await asyncio.to_thread(self._client.connect, broker.host, broker.port, broker.keepalive_s)
        except (OSError, ValueError) as error:
            raise DeliveryError(f"the broker {where} cannot be reached: {error}", away=True) from error
        self._client.loop_start()
        try:
            await asyncio.wait(
                {self._accepted, self.lost}, timeout=broker.timeout_s, return_when=asyncio.FIRST_COMPLETED
            )
        except asyncio.CancelledError:
            self._drop()  # which ends its thread
            raise
        code = self._accepted.result() if self._accepted.done() else None
        if code is not None and not code.is_failure:
            return
        await self.end()
        if code is None:
            why = self.lost.result() if self.lost.done() else "it does not answer"
            raise DeliveryError(f"the broker {where} cannot be reached: {why}", away=True)
        hint = ""
        if code.value == _UNSUPPORTED_VERSION and broker.version == "5":
            hint = 'it does not speak MQTT 5; set mqtt_version = "3.1.1"'
        raise DeliveryError(f"the broker refuses the connection: {code}", hint=hint, away=True)

    async def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """Publish and wait for the acknowledgement.

        Raises:
            DeliveryError: the broker is gone, has acknowledged nothing in time, or refuses the message.
        """
        n_bytes = _HEAD_BYTES + len(topic.encode()) + len(payload)
        if 0 < self._most_bytes < n_bytes:
            raise DeliveryError(
                f"the broker refuses it: it has {n_bytes} bytes, {self._most_bytes} may be",
                hint="raise the broker's limit for messages",
            )
        async with self._room:
            await self._publish(topic, payload, n_bytes, retain=retain)

    async def _publish(self, topic: str, payload: bytes, n_bytes: int, *, retain: bool) -> None:
        try:
            sent = self._client.publish(topic, payload, QOS, retain)
        except ValueError as error:
            raise DeliveryError(f"cannot be published: {error}", lasting=True) from error
        acknowledged: asyncio.Future[Any] = self._loop.create_future()
        self._pending[sent.mid] = (acknowledged, n_bytes)
        try:
            await asyncio.wait(
                {acknowledged, self.lost},
                timeout=self._broker.timeout_s,
                return_when=asyncio.FIRST_COMPLETED,
            )
        finally:
            del self._pending[sent.mid]
        if acknowledged.done():
            code = acknowledged.result()
            if code.is_failure:
                raise DeliveryError(f"the broker refuses it: {code}", hint=self._hint(code, topic))
        elif sent.mid == self._blamed:
            raise DeliveryError(
                f"the broker refuses it: {self.lost.result()}; it has {n_bytes} bytes",
                hint="raise the broker's limit for messages",
            )
        elif self.lost.done():
            raise DeliveryError(f"the broker has gone: {self.lost.result()}", away=True)
        else:
            raise DeliveryError("the broker has not acknowledged it in time", away=True)

    def listen(self, topic: str) -> None:
        """Hear what others publish under a topic, as far as the broker allows it."""
        self._client.subscribe(topic, QOS)

    async def end(self) -> None:
        """Disconnect; a broker that does not answer is left."""
        if self._accepted.done() and not self.lost.done():
            self._client.disconnect()
            await asyncio.wait({self.lost}, timeout=LEAVE_S)
        self._drop()
        await asyncio.to_thread(self._client.loop_stop)

    @property
    def over_a_message(self) -> bool:
        """Whether the broker has ended it because of a message, and not because it is going away."""
        return self._blamed >= 0

    def _hint(self, code: Any, topic: str) -> str:
        if code.value == _NOT_AUTHORISED:
            return f"let the user {self._broker.user or 'without a name'} write to {topic}"
        return "raise the broker's limit for messages" if code.value == _TOO_LARGE else ""

    def _drop(self) -> None:
        raw: Any = self._client.socket()
        if raw is not None:
            with contextlib.suppress(OSError):
                raw.shutdown(socket.SHUT_RDWR)

    def _in_loop(self, call: Callable[..., object], *arguments: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(call, *arguments)

    def _on_connect(self, _client: Any, _data: Any, _flags: Any, code: Any, properties: Any) -> None:
        self._in_loop(self._accept, code, properties)

    def _accept(self, code: Any, properties: Any) -> None:
        if not self._accepted.done():
            self._most_bytes = getattr(properties, "MaximumPacketSize", 0)
            self._room = asyncio.Semaphore(min(_TOGETHER, getattr(properties, "ReceiveMaximum", _TOGETHER)))
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
