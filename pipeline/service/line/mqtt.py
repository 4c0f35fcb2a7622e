"""Results published over MQTT 3.1.1, and taken for delivered once the broker has acknowledged them (QoS 1).

{prefix}/parts/{part id}/result     the part as JSON, with the delivery's number; not retained
{prefix}/alerts/{name}              an alert as JSON, raised or cleared; retained
{prefix}/status                     online or offline; retained, and the last will of the connection

* A delivery has arrived when the broker has acknowledged it; one that it has not is for the outbox to send again.
* Every connection has a client object of its own, thrown away with all it holds once the connection is lost or an
  acknowledgement is missing: an old result that the client sent again by itself could overtake a newer one.
* There is one connection at a time, made anew when it is next needed, and every few seconds once `start` was called.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import ssl
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from glyphs.errors import MissingExtraError
from pipeline.common.records import Delivery
from pipeline.common.settings import SettingsError
from pipeline.service.line.dispatch import DeliveryError, body_of

if TYPE_CHECKING:
    import aiomqtt

ONLINE, OFFLINE = "online", "offline"
_QOS = 1
_LOOK_S, _LEAVE_S = 2.0, 2.0
_PORTS = {"mqtt": 1883, "mqtts": 8883}
_NO_TOPIC = frozenset("+#\0")
_log = logging.getLogger(__name__)


def topic_level(name: str) -> str:
    """A name as one level of a topic."""
    return "".join("_" if c in _NO_TOPIC or c == "/" else c for c in name)


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
            MissingExtraError: aiomqtt is not installed.
            SettingsError: no such address, topic or certificate.
        """
        try:
            import aiomqtt  # noqa: F401 - asked for at the start, not with the first result
        except ImportError as error:
            raise MissingExtraError("MQTT", "aiomqtt", "mqtt") from error
        parts = urlsplit(url)
        if parts.scheme not in _PORTS or not parts.hostname:
            raise SettingsError("a broker's address is mqtt://host:1883 or mqtts://host:8883")
        if (
            not prefix
            or not _NO_TOPIC.isdisjoint(prefix)
            or prefix.startswith(("/", "$"))
            or prefix.endswith("/")
        ):
            raise SettingsError(
                f"the MQTT prefix {prefix!r} is not a beginning of a topic", hint="use a word such as line-4"
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
            with contextlib.suppress(DeliveryError):  # the next delivery says so
                await self._connected()
            await asyncio.sleep(_LOOK_S)

    async def send(self, delivery: Delivery) -> None:
        """Publish a delivery and wait until the broker has acknowledged it.

        Raises:
            DeliveryError: no broker, or no acknowledgement.
        """
        if not _NO_TOPIC.isdisjoint(delivery.part_id) or "/" in delivery.part_id:
            raise DeliveryError(f"the part {delivery.part_id!r} makes no topic", lasting=True)
        connection = await self._connected()
        try:
            alert = delivery.payload.get("alert")
            about = f"parts/{delivery.part_id}/result" if alert is None else f"alerts/{topic_level(alert)}"
            await connection.publish(f"{self._prefix}/{about}", body_of(delivery), retain=alert is not None)
        except DeliveryError:
            async with self._connecting:
                if self._connection is connection:
                    self._connection = None
            await connection.end()
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
                await self._say_goodbye(connection)

    async def _say_goodbye(self, connection: _Connection) -> None:
        # a connection that ends in order does not send its will
        with contextlib.suppress(DeliveryError, TimeoutError):
            async with asyncio.timeout(_LEAVE_S):
                await connection.publish(f"{self._prefix}/status", OFFLINE.encode(), retain=True)
        await connection.end()

    async def _connected(self) -> _Connection:
        async with self._connecting:
            if self._closed:
                raise DeliveryError("closed", away=True)
            if self._connection is not None and not self._connection.lost.done():
                return self._connection
            if self._connection is not None:
                await self._connection.end()
                self._connection = None
            connection = _Connection(await self._opened())
            try:
                await connection.publish(f"{self._prefix}/status", ONLINE.encode(), retain=True)
            except BaseException:
                await self._say_goodbye(connection)  # others may have seen it online
                raise
            self._connection = connection
            return connection

    async def _opened(self) -> aiomqtt.Client:
        import aiomqtt

        client = aiomqtt.Client(
            self._host,
            self._port,
            username=self._user,
            password=self._password,
            logger=_log,
            identifier=self._client_id,
            clean_session=True,
            will=aiomqtt.Will(f"{self._prefix}/status", OFFLINE, _QOS, retain=True),
            timeout=self._timeout_s,
            keepalive=self._keepalive_s,
            tls_context=self._tls,
        )
        try:
            return await client.__aenter__()
        except aiomqtt.MqttCodeError as error:
            raise DeliveryError(f"the broker refuses the connection: {error}", away=True) from error
        except (aiomqtt.MqttError, ValueError) as error:
            await _leave(client)
            where = f"{self._host}:{self._port}"
            raise DeliveryError(f"the broker {where} cannot be reached: {error}", away=True) from error


class _Connection:
    """One connection, for as long as it lasts.

    Attributes:
        lost: done once the broker is gone; aiomqtt says so only to those who wait for messages.
    """

    def __init__(self, client: aiomqtt.Client) -> None:
        self._client = client
        self.lost = asyncio.create_task(_until_lost(client))

    async def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """Publish and wait for the acknowledgement.

        Raises:
            DeliveryError: the broker is gone, or has acknowledged nothing in time.
        """
        import aiomqtt

        publishing = asyncio.create_task(self._client.publish(topic, payload, _QOS, retain))
        try:
            await asyncio.wait({publishing, self.lost}, return_when=asyncio.FIRST_COMPLETED)
            if not publishing.done():
                raise DeliveryError("the broker has gone", away=True)
            await publishing
        except aiomqtt.MqttError as error:
            raise DeliveryError(f"the broker has not acknowledged it: {error}", away=True) from error
        except ValueError as error:
            raise DeliveryError(f"cannot be published: {error}", lasting=True) from error
        finally:
            publishing.cancel()

    async def end(self) -> None:
        """Disconnect."""
        await _leave(self._client)
        await self.lost


async def _until_lost(client: aiomqtt.Client) -> None:
    import aiomqtt

    with contextlib.suppress(aiomqtt.MqttError):
        async for _ in client.messages:
            pass


async def _leave(client: aiomqtt.Client) -> None:
    """Close the socket; also that of a client that never got connected, which aiomqtt would leave open."""
    import aiomqtt

    with contextlib.suppress(aiomqtt.MqttError, TimeoutError):
        async with asyncio.timeout(_LEAVE_S):
            await client.__aexit__(None, None, None)


def _tls(ca_file: Path | None, certificate: Path | None, private_key: Path | None) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=str(ca_file) if ca_file is not None else None)
    if certificate is not None:
        context.load_cert_chain(str(certificate), str(private_key) if private_key is not None else None)
    return context
