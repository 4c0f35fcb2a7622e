"""Results published over MQTT 3.1.1, and taken for delivered once the broker has acknowledged them (QoS 1).

{prefix}/parts/{part id}/result     the part as JSON, with the delivery's number; not retained
{prefix}/status                     online or offline; retained, and the last will of the connection

Every connection has a client object of its own. paho keeps what a broker has not acknowledged and sends it again by
itself after it has connected again; an old result could so overtake a newer one. What is sent again is for the
outbox alone to say, so a client that has lost its broker is thrown away with all it holds.

asyncio loop                                paho's thread
  send: publish, wait for the future  --->    socket
  future done  <--- call_soon_threadsafe ---  on_connect, on_publish, on_disconnect
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import ssl
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from pipeline.common.missing_extra import MissingExtraError
from pipeline.common.records import Delivery
from pipeline.service.line.dispatch import DeliveryError, body_of

if TYPE_CHECKING:
    from paho.mqtt.client import Client

ONLINE, OFFLINE = "online", "offline"
_QOS = 1
_LOOK_S = 2.0
_PORTS = {"mqtt": 1883, "mqtts": 8883}
_NO_TOPIC = frozenset("+#\0")


class MqttSender:
    """Publishes deliveries to a broker; connects again after a loss."""

    def __init__(
        self,
        url: str,
        *,
        prefix: str = "tactile-marks",
        ca_file: Path | None = None,
        certificate: Path | None = None,
        private_key: Path | None = None,
        timeout_s: float = 10.0,
        keepalive_s: int = 30,
    ) -> None:
        """Make ready; nothing is connected yet.

        Args:
            url: mqtt://host:1883 or mqtts://user:password@host:8883 (TLS; the broker's certificate is checked).
            prefix: of the topics.
            ca_file: certificates of authorities to trust, instead of the system's.
            certificate: of this client, PEM, where the broker asks for one.
            private_key: of the certificate.
            timeout_s: for connecting, and for one acknowledgement.
            keepalive_s: between signs of life; a silent broker is noticed after one and a half of it.

        Raises:
            MissingExtraError: paho-mqtt is not installed.
            ValueError: no such address, topic or certificate.
        """
        try:
            import paho.mqtt.client  # noqa: F401 - said at the start, not with the first result
        except ImportError as error:
            raise MissingExtraError("MQTT", "paho-mqtt", "mqtt") from error
        parts = urlsplit(url)
        if parts.scheme not in _PORTS or not parts.hostname:
            raise ValueError("a broker's address is mqtt://host:1883 or mqtts://host:8883")
        if (
            not prefix
            or not _NO_TOPIC.isdisjoint(prefix)
            or prefix.startswith(("/", "$"))
            or prefix.endswith("/")
        ):
            raise ValueError(
                f"the MQTT prefix {prefix!r} is no beginning of a topic; use a word such as line-4"
            )
        self._host, self._port = parts.hostname, parts.port or _PORTS[parts.scheme]
        self._user = unquote(parts.username) if parts.username else None
        self._password = unquote(parts.password) if parts.password else None
        self._tls = _tls(ca_file, certificate, private_key) if parts.scheme == "mqtts" else None
        self._prefix, self._timeout_s, self._keepalive_s = prefix, timeout_s, keepalive_s
        self._client_id = f"tactile-marks-{secrets.token_hex(6)}"
        self._connecting = asyncio.Lock()
        self._connection: _Connection | None = None
        self._closed = False
        self._keeping: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Connect and stay so, that the status says online though there is nothing to publish."""
        self._keeping = asyncio.create_task(self._keep_connected(), name="mqtt")

    async def _keep_connected(self) -> None:
        while not self._closed:
            with contextlib.suppress(DeliveryError):  # told by the next delivery
                await self._connected()
            await asyncio.sleep(_LOOK_S)

    async def send(self, delivery: Delivery) -> None:
        """Publish a delivery and wait until the broker has acknowledged it.

        Raises:
            DeliveryError: no broker, or no acknowledgement.
        """
        if not _NO_TOPIC.isdisjoint(delivery.part_id) or "/" in delivery.part_id:
            raise DeliveryError(f"the part {delivery.part_id!r} makes no topic", lasting=True)
        topic = f"{self._prefix}/parts/{delivery.part_id}/result"
        connection = await self._connected()
        try:
            async with asyncio.timeout(self._timeout_s):
                await connection.publish(topic, body_of(delivery))
        except TimeoutError:
            # whatever the client still holds must not arrive later, behind newer results
            await self._drop(connection)
            raise DeliveryError(
                f"the broker has acknowledged nothing within {self._timeout_s:g} s", away=True
            ) from None
        except DeliveryError:
            await self._drop(connection)
            raise

    async def close(self) -> None:
        """Say goodbye, so that the status is offline at once, and disconnect."""
        self._closed = True
        if self._keeping is not None:
            self._keeping.cancel()
            await asyncio.gather(self._keeping, return_exceptions=True)
        async with self._connecting:
            connection, self._connection = self._connection, None
            if connection is not None:
                with contextlib.suppress(DeliveryError, TimeoutError):
                    async with asyncio.timeout(min(self._timeout_s, 2.0)):
                        await connection.publish(f"{self._prefix}/status", OFFLINE.encode(), retain=True)
                await connection.end()

    async def _connected(self) -> _Connection:
        async with self._connecting:
            if self._closed:
                raise DeliveryError("closed", away=True)
            if self._connection is not None and not self._connection.lost:
                return self._connection
            if self._connection is not None:
                await self._connection.end()
                self._connection = None
            connection = _Connection(self._client())
            try:
                async with asyncio.timeout(self._timeout_s):
                    await connection.open(self._host, self._port, self._keepalive_s)
                    await connection.publish(f"{self._prefix}/status", ONLINE.encode(), retain=True)
            except TimeoutError:
                await connection.end()
                raise DeliveryError(
                    f"the broker {self._host}:{self._port} does not answer", away=True
                ) from None
            except BaseException:
                await connection.end()
                raise
            self._connection = connection
            return connection

    async def _drop(self, connection: _Connection) -> None:
        async with self._connecting:
            if self._connection is connection:
                self._connection = None
        await connection.end()

    def _client(self) -> Client:
        from paho.mqtt.client import Client, MQTTv311
        from paho.mqtt.enums import CallbackAPIVersion

        client = Client(
            CallbackAPIVersion.VERSION2,
            client_id=self._client_id,
            clean_session=True,
            protocol=MQTTv311,
            reconnect_on_failure=False,
        )
        client.connect_timeout = self._timeout_s
        if self._user is not None:
            client.username_pw_set(self._user, self._password)
        if self._tls is not None:
            client.tls_set_context(self._tls)
        client.will_set(f"{self._prefix}/status", OFFLINE, qos=_QOS, retain=True)
        return client


class _Connection:
    """One connection, for as long as it lasts.

    paho calls back in its own thread; nothing is done there but to hand it to the loop's.
    """

    def __init__(self, client: Client) -> None:
        self.lost = False
        self._client = client
        self._loop = asyncio.get_running_loop()
        self._opened: asyncio.Future[None] = self._loop.create_future()
        self._waiting: dict[int, asyncio.Future[None]] = {}
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_publish = self._on_publish

    async def open(self, host: str, port: int, keepalive_s: int) -> None:
        try:
            await asyncio.to_thread(self._client.connect, host, port, keepalive_s)
        except (OSError, ValueError) as error:
            raise DeliveryError(f"the broker {host}:{port} cannot be reached: {error}", away=True) from error
        self._client.loop_start()
        await self._opened

    async def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """Publish and wait for the acknowledgement."""
        if self.lost:
            raise _gone()
        arrived: asyncio.Future[None] = self._loop.create_future()
        try:
            info = self._client.publish(topic, payload, qos=_QOS, retain=retain)
        except ValueError as error:
            raise DeliveryError(f"cannot be published: {error}", lasting=True) from error
        # an acknowledgement that is quicker than this line waits for the loop, so it is not missed
        self._waiting[info.mid] = arrived
        try:
            await arrived
        finally:
            self._waiting.pop(info.mid, None)

    async def end(self) -> None:
        """Disconnect and end paho's thread."""
        self._lose(_gone())
        self._client.on_connect = self._client.on_disconnect = self._client.on_publish = None
        await asyncio.shield(asyncio.to_thread(self._end))

    def _end(self) -> None:
        with contextlib.suppress(Exception):
            self._client.disconnect()
        self._client.loop_stop()

    def _on_connect(self, _client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        self._hand(self._connected, bool(reason.is_failure), str(reason))

    def _on_disconnect(self, _client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        self._hand(self._lose, DeliveryError(f"the broker has gone: {reason}", away=True))

    def _on_publish(self, _client: Client, _data: Any, mid: int, _reason: Any, _properties: Any) -> None:
        self._hand(self._acknowledged, mid)

    def _hand(self, function: Any, *args: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed already
            self._loop.call_soon_threadsafe(function, *args)

    def _connected(self, refused: bool, reason: str) -> None:
        if refused:
            self._lose(DeliveryError(f"the broker refuses the connection: {reason}", away=True))
        elif not self._opened.done():
            self._opened.set_result(None)

    def _acknowledged(self, mid: int) -> None:
        arrived = self._waiting.get(mid)
        if arrived is not None and not arrived.done():
            arrived.set_result(None)

    def _lose(self, error: DeliveryError) -> None:
        self.lost = True
        for future in (self._opened, *self._waiting.values()):
            if not future.done():
                future.set_exception(error)
                future.exception()  # looked at here, should nobody wait for it


def _gone() -> DeliveryError:
    return DeliveryError("the connection to the broker is closed", away=True)


def _tls(ca_file: Path | None, certificate: Path | None, private_key: Path | None) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=str(ca_file) if ca_file is not None else None)
    if certificate is not None:
        context.load_cert_chain(str(certificate), str(private_key) if private_key is not None else None)
    return context
