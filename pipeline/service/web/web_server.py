"""The web server around the application: stopping, and limits of connections and slow request heads.

* After a first SIGTERM, SIGINT or SIGHUP it keeps answering for `drain_s` and reports that it is stopping; a second one
  stops it at once.
* A connection that has not sent a whole request head within HEAD_S is closed.
* One address has a limited number of connections; more are closed as they come. A trusted proxy, which connects for
  many callers, has no limit.
* A request that is answered before all of it has come gets its answer: the rest is read and dropped for LINGER_S.
  A connection closed with bytes unread is reset by the system, and a proxy then has no answer to pass on (502).
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from types import FrameType
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from pipeline.service.web.access import is_in

MOST_CONNECTIONS = 1000
KEEP_ALIVE_S = 30
HEAD_S = 15.0
LINGER_S = 5.0


class DrainingServer(uvicorn.Server):
    """A web server that announces for a while that it is stopping; a second signal stops it at once."""

    def __init__(self, config: uvicorn.Config, *, drain: Callable[[], None], drain_s: float) -> None:
        """Make the server; nothing is opened yet.

        Args:
            config: config of the server.
            drain: called when it is asked to stop.
            drain_s: time for which it still answers.
        """
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
        """Start to drain."""
        super().handle_exit(sig, frame)
        if self._stop_at_s is None and self.started and not self.force_exit:
            self._stop_at_s = time.monotonic() + self._drain_s
            self.should_exit = False  # `on_tick` says when
        self._drain()

    async def on_tick(self, counter: int) -> bool:
        """Return whether to stop."""
        if self._stop_at_s is not None and time.monotonic() >= self._stop_at_s:
            self.should_exit = True
        return await super().on_tick(counter)


def patient_protocol(
    *, an_address: int, proxies: Sequence[str] = (), head_s: float = HEAD_S
) -> type[H11Protocol]:
    """Make the HTTP protocol class, with a time limit for request heads and a limit of connections per address.

    Args:
        an_address: connections that one address may have.
        proxies: addresses and networks that may have any number.
        head_s: seconds for the head of a request.
    """
    open_now: Counter[str] = Counter()

    class PatientProtocol(H11Protocol):
        """One connection."""

        _head_timer: asyncio.TimerHandle | None = None
        _address = ""

        def connection_made(self, transport: Any) -> None:
            """Count the connection; close it if there are too many."""
            super().connection_made(transport)
            self.app_state = {**self.app_state, "connection": {}}  # shared by all requests of this connection
            self.transport = _Lingering(transport, self)  # type: ignore[assignment]
            self._address = self.client[0] if self.client else ""
            open_now[self._address] += 1
            if open_now[self._address] > an_address and not is_in(self._address, proxies):
                transport.abort()
            else:
                self._wait_for_head()

        def data_received(self, data: bytes) -> None:
            """End the time limit once the head is complete."""
            if self.transport.is_closing():
                return
            if self._head_timer is None and (self.cycle is None or self.cycle.response_complete):
                self._wait_for_head()
            before = self.cycle
            super().data_received(data)
            if self.cycle is not before:
                self._wait_for_head(ends=True)

        def connection_lost(self, exc: Exception | None) -> None:
            """Remove the connection from the count."""
            self._wait_for_head(ends=True)
            open_now[self._address] -= 1
            if not open_now[self._address]:
                del open_now[self._address]
            super().connection_lost(exc)

        def _wait_for_head(self, *, ends: bool = False) -> None:
            if self._head_timer is not None:
                self._head_timer.cancel()
            self._head_timer = None if ends else self.loop.call_later(head_s, self.transport.abort)

    return PatientProtocol


class _Lingering:
    """A connection's transport.

    If a request was not read to its end, close in two steps: end our side, then read and drop the rest for LINGER_S or
    until the caller closes.
    """

    def __init__(self, transport: Any, protocol: H11Protocol) -> None:
        self._transport, self._protocol = transport, protocol
        self._lingers = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def is_closing(self) -> bool:
        return self._lingers or bool(self._transport.is_closing())

    def close(self) -> None:
        if self.is_closing() or self._protocol.conn.their_state not in (h11.SEND_BODY, h11.ERROR):
            self._transport.close()
            return
        self._lingers = True
        if self._transport.can_write_eof():  # not over TLS
            self._transport.write_eof()
        self._transport.resume_reading()
        asyncio.get_running_loop().call_later(LINGER_S, self._transport.abort)
