"""Limits of the OPC UA server for callers that have not signed in, and rate-limited logging of their faults.

caller --room--> connection --messages--> asyncua
         |                     |- no OPC UA, too large, faults          closed
         |                     |- sign-in after a wrong password        answered late
         |                     '- Call                                  answered in a task of its own
         '- no room: a caller that has not signed in is dropped

* Callers without a session and callers with one are counted separately. Of those without one, the address with the
  most connections loses its oldest.
* While a method runs, the same session still gets its other answers.
* asyncua logs a traceback for each bad message; here one line of each kind in ten seconds is logged.
"""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Any

from glyphs.plain_text import visible
from pipeline.service.inputs.opcua_device import Users
from pipeline.service.inputs.opcua_model import require_asyncua, ua_types
from pipeline.service.inputs.trigger import one_of_the_busiest

_log = logging.getLogger(__name__)
_KINDS = frozenset({b"HEL", b"OPN", b"MSG", b"CLO", b"ERR"})
# connections that have not signed in
MOST_STRANGERS = 32
# seconds within which a stranger must sign in
SIGN_IN_S = 10.0
# bad requests after which a stranger's connection is closed
MOST_FAULTS = 3
# methods that run at once for one connection
MOST_CALLS = 8
# seconds before a wrong password is answered, against guessing
WRONG_PASSWORD_S = 1.0
# bytes of one message
MESSAGE_BYTES = 1 << 20
# seconds between two lines of the log of one kind
LOG_EVERY_S = 10.0
# kinds of lines kept in mind: callers may make addresses up
_MOST_KINDS = 1000


class SparingLog(logging.Handler):
    """Log a message of each kind once in a while, without its traceback."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self._last_s: dict[str, float] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Take a record of asyncua."""
        error = record.exc_info[1] if record.exc_info else None
        why = f": {type(error).__name__}: {error}" if error is not None else ""
        self.say(f"{record.name}:{record.lineno}", f"{record.getMessage()}{why}")

    def say(self, kind: str, message: str) -> None:
        """Log a message, unless one of its kind was logged just now."""
        now = time.monotonic()
        if now - self._last_s.get(kind, -LOG_EVERY_S) < LOG_EVERY_S:
            return
        if len(self._last_s) >= _MOST_KINDS:
            self._last_s.clear()
        self._last_s[kind] = now
        _log.warning("OPC UA: %s", visible(message[:300]))


def guarded_server(users: Users, *, sessions: int) -> Any:
    """An asyncua server behind these limits.

    Args:
        users: users that may sign in.
        sessions: maximum number of connections that have signed in.
    """
    asyncua = require_asyncua()
    from asyncua.server.binary_server_asyncio import BinaryServer

    log = SparingLog()
    library = logging.getLogger("asyncua")
    library.handlers[:] = [log]
    library.propagate = False
    for name in ("asyncua", "asyncua.server.address_space", "asyncua.common"):
        logging.getLogger(name).setLevel(logging.ERROR)
    protocol = _guarded_protocol(users, sessions, log)

    class GuardedBinaryServer(BinaryServer):
        """Hands connections to the guarded protocol."""

        def _make_protocol(self) -> Any:
            return protocol(self.iserver, self._policies, self.clients, self.closing_tasks, self.limits)

    class GuardedServer(asyncua.Server):  # type: ignore[name-defined,misc]
        """As asyncua's, with the guarded protocol."""

        async def start(self) -> None:
            """Listen."""
            await self._setup_server_nodes()
            await self.iserver.start()
            try:
                where = (self.endpoint.hostname, self.endpoint.port)
                self.bserver = GuardedBinaryServer(self.iserver, *where, self.limits)
                self.bserver.set_policies(self._policies)
                await self.bserver.start()
            except BaseException:
                await self.iserver.stop()
                raise

    server = GuardedServer(user_manager=users)
    server.iserver.max_connections = sessions + MOST_STRANGERS + 1
    server.iserver.max_pending_activation_seconds = SIGN_IN_S
    server.iserver.max_subscriptions = 4 * sessions
    server.limits.max_message_size = MESSAGE_BYTES
    server.limits.max_chunk_count = max(1, MESSAGE_BYTES // server.limits.max_recv_buffer)
    return server


def _guarded_protocol(users: Users, sessions: int, log: SparingLog) -> Any:
    from asyncua.common.utils import ServiceError
    from asyncua.server.binary_server_asyncio import OPCUAProtocol
    from asyncua.ua.ua_binary import nodeid_from_binary

    ua = ua_types()
    codes = ua.StatusCodes
    create, activate, call, *registers = (
        ua.NodeId(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary"))
        for name in ("CreateSession", "ActivateSession", "Call", "RegisterServer", "RegisterServer2")
    )
    wrong = (codes.BadUserAccessDenied, codes.BadIdentityTokenInvalid, codes.BadIdentityTokenRejected)

    class GuardedProtocol(OPCUAProtocol):
        """One connection."""

        address = ""
        gone = False
        _faults = 0

        def connection_made(self, transport: Any) -> None:
            """Let a caller in, if there is room or another caller can be dropped."""
            self.address = str((transport.get_extra_info("peername") or ("",))[0])
            self._calls: set[asyncio.Task[Any]] = set()
            if not self._has_room():
                log.say(f"full {self.address}", f"no room for a connection from {self.address}")
                self.gone = True
                transport.abort()
                return
            super().connection_made(transport)
            processor: Any = self.processor
            if processor is not None:
                self._library: tuple[Any, ...] = (
                    processor.send_response,
                    processor.process_message,
                    processor._process_message,
                )
                processor.send_response = self._send
                processor.process_message = self._hear
                processor._process_message = self._process

        def connection_lost(self, ex: BaseException | None) -> None:
            """Cancel the calls of the lost connection."""
            self.gone = True
            for task in self._calls:
                task.cancel()
            super().connection_lost(ex)

        def data_received(self, data: bytes) -> None:
            """Take bytes, as long as they look like OPC UA."""
            begin = self._buffer[:3] + data[: max(0, 3 - len(self._buffer))]
            if len(begin) == 3 and begin not in _KINDS:
                self._let_go("it does not speak OPC UA")
            elif len(self._buffer) + len(data) > 2 * MESSAGE_BYTES:
                self._let_go("its message is too large")
            elif not self.gone:
                super().data_received(data)

        @property
        def signed_in(self) -> bool:
            """Whether the connection has an activated session."""
            session = self.processor.session if self.processor is not None else None
            return session is not None and session.is_activated()

        def _has_room(self) -> bool:
            clients: list[Any] = self.clients
            there = [one for one in clients if not one.gone]
            strangers = [one for one in there if not one.signed_in]
            if len(there) - len(strangers) >= sessions:
                return False
            if len(strangers) >= MOST_STRANGERS:
                one_of_the_busiest(strangers, lambda one: one.address)._let_go("others wait")
            return True

        def _let_go(self, why: str) -> None:
            if not self.gone and self.transport is not None:
                self.gone = True
                log.say(f"{why} {self.address}", f"a connection from {self.address} was closed: {why}")
                self.transport.abort()

        async def _process_one_msg(self, header: Any, buf: Any) -> bool:
            try:
                return await super()._process_one_msg(header, buf)
            except Exception as error:
                self._let_go(f"it sends what cannot be understood ({type(error).__name__})")
                return False

        def _send(self, handle: Any, sequence: Any, response: Any, *more: Any) -> None:
            if self.gone:
                return
            self._library[0](handle, sequence, response, *more)
            if isinstance(response, ua.ServiceFault) and not self.signed_in:
                self._faults += 1
                if self._faults >= MOST_FAULTS:
                    self._let_go("it sends bad requests without having signed in")

        async def _hear(self, sequence: Any, body: Any) -> Any:
            """Process a message; a call in a task of its own."""
            processing = self._library[1](sequence, body)
            if not self.signed_in or nodeid_from_binary(body.copy()) != call:
                return await processing
            task = asyncio.create_task(processing)
            self._calls.add(task)
            task.add_done_callback(self._calls.discard)
            return True

        async def _process(self, kind: Any, *message: Any) -> bool:
            if kind in registers:
                raise ServiceError(codes.BadServiceUnsupported)
            if kind == create and self.processor is not None and self.processor.session is not None:
                raise ServiceError(codes.BadTooManySessions)
            if kind == call and len(self._calls) > MOST_CALLS:
                raise ServiceError(codes.BadTooManyOperations)
            if kind == activate:
                users.denied = ""
            try:
                return bool(await self._library[2](kind, *message))
            except Exception as error:
                if kind == activate and getattr(error, "code", None) in wrong:
                    who = f"{users.denied[:40]!r} from {self.address}"
                    log.say(f"sign-in {who}", f"sign-in denied to {who}: wrong user or password")
                    await asyncio.sleep(WRONG_PASSWORD_S)
                raise

    return GuardedProtocol
