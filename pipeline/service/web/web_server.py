"""The web server around the application: stopping, and limits of connections and slow request heads.

* After a first SIGTERM, SIGINT or SIGHUP it keeps answering for `drain_s` and reports that it is stopping; a second one
  stops it at once.
* A connection that has not done its TLS handshake, or sent a whole request head, within HEAD_S is closed; so is one
  whose caller does not read its answer. One address has a limited number of them; a trusted proxy has no limit.
* After an early answer the rest of a request is read and dropped for LINGER_S: a connection closed with bytes unread is
  reset, and a proxy then has no answer to pass on (502).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import ssl
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from types import FrameType
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from pipeline.service.connections import MOST_CONNECTIONS, WRITE_S, Peer, SparingLog, longest_idle_of_busiest
from pipeline.service.web.access import is_in
from pipeline.service.web.problem import MEDIA_TYPE, ProblemBody

KEEP_ALIVE_S = 30
HEAD_S = 10.0
LINGER_S = 5.0


class DrainingServer(uvicorn.Server):
    """A web server that calls `drain` when told to stop, and answers for `drain_s` more; a second signal ends it."""

    def __init__(self, config: uvicorn.Config, *, drain: Callable[[], None], drain_s: float) -> None:
        super().__init__(config)
        self._drain, self._drain_s = drain, drain_s
        self._stop_at_s: float | None = None

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Drain on a hangup, too, unless it is ignored (`nohup`)."""
        hangup = getattr(signal, "SIGHUP", None)
        ours = threading.current_thread() is threading.main_thread()
        with super().capture_signals(), contextlib.ExitStack() as stack:
            if hangup is not None and ours and signal.getsignal(hangup) is signal.SIG_DFL:
                stack.callback(signal.signal, hangup, signal.signal(hangup, self.handle_exit))
            yield

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        super().handle_exit(sig, frame)
        if self._stop_at_s is None and self.started and not self.force_exit:
            self._stop_at_s = time.monotonic() + self._drain_s
            self.should_exit = False  # `on_tick` says when
        self._drain()

    async def on_tick(self, counter: int) -> bool:
        if self._stop_at_s is not None and time.monotonic() >= self._stop_at_s:
            self.should_exit = True
        return await super().on_tick(counter)


class Room:
    """Open connections, limited in all and, but for `proxies`, by address; the longest idle of the busiest goes."""

    def __init__(self, *, an_address: int, most: int = MOST_CONNECTIONS, proxies: Sequence[str] = ()) -> None:
        self._an_address, self._most, self._proxies = an_address, most, proxies
        self._open: set[Peer] = set()
        self._log = SparingLog("web interface")

    def enter(self, connection: Peer) -> bool:
        n_same = sum(other.block == connection.block for other in self._open)
        if n_same >= self._an_address and not self._is_proxy(connection):
            self._log.say(connection.block, f"{connection.address} has over {self._an_address} connections")
            return False
        if len(self._open) >= self._most:
            callers = [other for other in self._open if not self._is_proxy(other)]
            dropped = longest_idle_of_busiest(callers or self._open)
            self._log.say(
                "full", f"over {self._most} connections; an idle one of {dropped.address} is closed"
            )
            self._open.discard(dropped)
            dropped.transport.abort()
        self._open.add(connection)
        return True

    def leave(self, connection: Peer) -> None:
        self._open.discard(connection)

    def _is_proxy(self, connection: Peer) -> bool:
        return is_in(connection.address, self._proxies)


def patient_protocol(
    room: Room, *, tls: ssl.SSLContext | None = None, head_s: float = HEAD_S, write_s: float = WRITE_S
) -> Any:
    """Make the factory of HTTP protocols, with limits, s, for handshakes and request heads, and for reading answers."""

    class PatientProtocol(H11Protocol, Peer):
        _head_timer: asyncio.TimerHandle | None = None
        _write_timer: asyncio.TimerHandle | None = None

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            self.app_state = {**self.app_state, "connection": {}}  # shared by all requests of this connection
            self.transport = _Lingering(transport, self, write_s=write_s)  # type: ignore[assignment]
            self.identify(transport)
            if room.enter(self):
                self._wait_for_head()
            else:
                transport.abort()

        def data_received(self, data: bytes) -> None:
            if self.transport.is_closing():
                return
            self.heard_s = time.monotonic()
            if self._head_timer is None and (self.cycle is None or self.cycle.response_complete):
                self._wait_for_head()
            before = self.cycle
            super().data_received(data)
            if self.cycle is not before:
                self._wait_for_head(ends=True)

        def pause_writing(self) -> None:
            super().pause_writing()
            self._write_timer = self.loop.call_later(write_s, self.transport.abort)

        def resume_writing(self) -> None:
            super().resume_writing()
            self._end_write_timer()

        def connection_lost(self, exc: Exception | None) -> None:
            self._wait_for_head(ends=True)
            self._end_write_timer()
            room.leave(self)
            super().connection_lost(exc)

        def send_400_response(self, msg: str) -> None:
            body = ProblemBody("Bad Request", 400, "this is not an HTTP request; check address and port", "")
            content = json.dumps(asdict(body)).encode()
            headers = [
                (b"content-type", MEDIA_TYPE.encode()),
                (b"content-length", str(len(content)).encode()),
                (b"connection", b"close"),
            ]
            for event in (
                h11.Response(status_code=400, headers=headers, reason=b"Bad Request"),
                h11.Data(data=content),
                h11.EndOfMessage(),
            ):
                self.transport.write(self.conn.send(event) or b"")
            self.transport.close()

        def _wait_for_head(self, *, ends: bool = False) -> None:
            if self._head_timer is not None:
                self._head_timer.cancel()
            self._head_timer = None if ends else self.loop.call_later(head_s, self.transport.abort)

        def _end_write_timer(self) -> None:
            if self._write_timer is not None:
                self._write_timer.cancel()

    if tls is None:
        return PatientProtocol
    return lambda **options: _Handshake(PatientProtocol(**options), room, tls, head_s)


class _Handshake(asyncio.Protocol, Peer):
    """A connection until the end of its TLS handshake, which asyncio itself would neither count nor end soon."""

    def __init__(self, http: H11Protocol, room: Room, tls: ssl.SSLContext, head_s: float) -> None:
        self._http, self._room, self._tls, self._head_s = http, room, tls, head_s
        self._early = b""

    def connection_made(self, transport: Any) -> None:
        self.transport = transport
        transport.pause_reading()  # until `start_tls` has taken over
        self.identify(transport)
        if self._room.enter(self):
            self._task = asyncio.get_running_loop().create_task(self._shake_hands())
        else:
            transport.abort()

    def data_received(self, data: bytes) -> None:
        self._early += data  # of a request that has come with the end of the handshake

    async def _shake_hands(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            tls: Any = await loop.start_tls(
                self.transport, self, self._tls, server_side=True, ssl_handshake_timeout=self._head_s
            )
        except OSError:  # not TLS, refused by the caller, gone, or too slow
            self.transport.abort()
            return
        finally:
            self._room.leave(self)
        if tls is not None and not tls.is_closing():
            self._http.connection_made(tls)
            tls.set_protocol(self._http)
            if self._early:
                self._http.data_received(self._early)


class _Lingering:
    """A transport that, with a request not read to its end, ends our side and reads on for LINGER_S to its close."""

    def __init__(self, transport: Any, protocol: H11Protocol, *, write_s: float) -> None:
        self._transport, self._protocol, self._write_s = transport, protocol, write_s
        self._lingers = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def is_closing(self) -> bool:
        return self._lingers or bool(self._transport.is_closing())

    def close(self) -> None:
        if self.is_closing() or self._protocol.conn.their_state not in (h11.SEND_BODY, h11.ERROR):
            self._transport.close()  # once the caller has read what is written
            asyncio.get_running_loop().call_later(self._write_s, self._transport.abort)
            return
        self._lingers = True
        if self._transport.can_write_eof():  # not over TLS
            self._transport.write_eof()
        self._transport.resume_reading()
        asyncio.get_running_loop().call_later(LINGER_S, self._transport.abort)
