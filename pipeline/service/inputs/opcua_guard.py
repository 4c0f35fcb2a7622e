"""Limits of the OPC UA server for callers that have not signed in, and rate-limited logging of their faults.

caller --room--> connection --messages--> asyncua
         |                     |- no OPC UA, too large, faults          closed
         |                     |- sign-in after wrong passwords         delayed
         |                     '- Call                                  answered in a task of its own
         '- no room: a caller that has not signed in is dropped

* Callers without a session and callers with one are counted separately. Silent callers are dropped first, starting
  with the address that has the most connections.
* While a method runs, the same session still gets its other answers.
* asyncua logs a traceback for each bad message; here one line of each kind in ten seconds is logged.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pipeline.service.inputs.opcua_device import Users
from pipeline.service.inputs.opcua_model import require_asyncua, ua_types

_log = logging.getLogger(__name__)
_KINDS = frozenset({b"HEL", b"OPN", b"MSG", b"CLO", b"ERR"})
_MOST_ADDRESSES = 1000


@dataclass(frozen=True)
class GuardLimits:
    """Resource limits of callers.

    Attributes:
        sessions: maximum number of connections that have signed in.
        strangers: maximum number of connections that have not signed in.
        grace_s: time for which a stranger that has sent something is not dropped for another, seconds.
        sign_in_s: time within which a stranger must sign in, seconds.
        faults: bad requests after which a stranger's connection is closed.
        calls: methods that run at once for one connection.
        first_delay_s: delay of the sign-in after a wrong password from the same address, seconds; doubled with every
            further one.
        longest_delay_s: maximum delay of a sign-in, seconds.
        forget_s: time without a wrong password after which an address is like any other, seconds.
        message_bytes: maximum size of one message, bytes.
    """

    sessions: int = 16
    strangers: int = 32
    grace_s: float = 2.0
    sign_in_s: float = 10.0
    faults: int = 3
    calls: int = 8
    first_delay_s: float = 0.25
    longest_delay_s: float = 3.0
    forget_s: float = 120.0
    message_bytes: int = 1 << 20


class SparingLog(logging.Handler):
    """Log a message of each kind once in a while, without its traceback, and how many were left out."""

    def __init__(self, *, every_s: float = 10.0) -> None:
        super().__init__(logging.ERROR)
        self._every_s = every_s
        self._last: dict[str, tuple[float, int]] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Take a record of asyncua."""
        error = record.exc_info[1] if record.exc_info else None
        why = f": {type(error).__name__}: {error}" if error is not None else ""
        self.say(f"{record.name}:{record.lineno}", f"{record.getMessage()}{why}", level=record.levelno)

    def say(self, kind: str, message: str, *, level: int = logging.WARNING) -> None:
        """Log a message, unless one of its kind was logged just now."""
        now = time.monotonic()
        last_s, left_out = self._last.get(kind, (-self._every_s, 0))
        if now - last_s < self._every_s:
            self._last[kind] = (last_s, left_out + 1)
            return
        if len(self._last) >= _MOST_ADDRESSES:
            self._last.clear()
        self._last[kind] = (now, 0)
        plain = "".join(char if char.isprintable() else "?" for char in message[:300])
        _log.log(level, "OPC UA: %s%s", plain, f" ({left_out} like it not logged)" if left_out else "")


class SignIns:
    """Wrong passwords by address; each delays the next sign-in from there."""

    def __init__(self, limits: GuardLimits) -> None:
        self._limits = limits
        self._failures: dict[str, tuple[int, float]] = {}

    def delay_s(self, address: str) -> float:
        """Current delay of a sign-in from an address, seconds."""
        n, last_s = self._failures.get(address, (0, 0.0))
        if not n or time.monotonic() - last_s > self._limits.forget_s:
            return 0.0
        return min(self._limits.first_delay_s * 2.0 ** min(n - 1, 30), self._limits.longest_delay_s)

    def failed(self, address: str) -> None:
        """Count a wrong password."""
        n = self._failures.pop(address, (0, 0.0))[0] if self.delay_s(address) else 0
        while len(self._failures) >= _MOST_ADDRESSES:
            del self._failures[next(iter(self._failures))]
        self._failures[address] = (n + 1, time.monotonic())


def guarded_server(user_manager: Users, limits: GuardLimits) -> Any:
    """An asyncua server behind this door."""
    asyncua = require_asyncua()
    from asyncua.server.binary_server_asyncio import BinaryServer

    log, sign_ins = SparingLog(), SignIns(limits)
    library = logging.getLogger("asyncua")
    library.handlers[:] = [log]
    library.propagate = False
    for name in ("asyncua", "asyncua.server.address_space", "asyncua.common"):
        logging.getLogger(name).setLevel(logging.ERROR)
    protocol = _guarded_protocol(user_manager, limits, log, sign_ins)

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

    server = GuardedServer(user_manager=user_manager)
    server.iserver.max_connections = limits.sessions + limits.strangers + 1
    server.iserver.max_pending_activation_seconds = limits.sign_in_s
    server.iserver.max_subscriptions = 4 * limits.sessions
    server.limits.max_message_size = limits.message_bytes
    server.limits.max_chunk_count = max(1, limits.message_bytes // server.limits.max_recv_buffer)
    return server


def _guarded_protocol(user_manager: Users, limits: GuardLimits, log: SparingLog, sign_ins: SignIns) -> Any:
    from asyncua.common.utils import ServiceError
    from asyncua.server.binary_server_asyncio import OPCUAProtocol

    ua = ua_types()
    ids = ua.ObjectIds
    create, activate, call = (
        ua.NodeId(one)
        for one in (
            ids.CreateSessionRequest_Encoding_DefaultBinary,
            ids.ActivateSessionRequest_Encoding_DefaultBinary,
            ids.CallRequest_Encoding_DefaultBinary,
        )
    )
    registers = (
        ua.NodeId(ids.RegisterServerRequest_Encoding_DefaultBinary),
        ua.NodeId(ids.RegisterServer2Request_Encoding_DefaultBinary),
    )
    wrong = (
        ua.StatusCodes.BadUserAccessDenied,
        ua.StatusCodes.BadIdentityTokenInvalid,
        ua.StatusCodes.BadIdentityTokenRejected,
    )

    class GuardedProtocol(OPCUAProtocol):
        """One connection."""

        address = ""
        gone = False
        _begun_s = 0.0
        _has_sent = False
        _faults = 0

        def connection_made(self, transport: Any) -> None:
            """Let a caller in, if there is room or another caller can be dropped."""
            self.address = str((transport.get_extra_info("peername") or ("",))[0])
            self._begun_s = time.monotonic()
            self._calls: set[asyncio.Task[None]] = set()
            if not self._has_room():
                log.say(f"full {self.address}", f"no room for a connection from {self.address}")
                self.gone = True
                transport.abort()
                return
            super().connection_made(transport)
            processor = self.processor
            if processor is not None:
                answer, serve = processor.send_response, processor._process_message
                processor.send_response = self._watched(answer)  # type: ignore[method-assign]
                processor._process_message = self._guarded(serve)  # type: ignore[method-assign]

        def connection_lost(self, ex: BaseException | None) -> None:
            """Cancel the calls of the lost connection."""
            self.gone = True
            for task in self._calls:
                task.cancel()
            super().connection_lost(ex)

        def data_received(self, data: bytes) -> None:
            """Take bytes, as long as they look like OPC UA."""
            self._has_sent = True
            begin = self._buffer[:3] + data[: max(0, 3 - len(self._buffer))]
            if len(begin) == 3 and begin not in _KINDS:
                self._let_go("it does not speak OPC UA")
            elif len(self._buffer) + len(data) > 2 * limits.message_bytes:
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
            if len(there) - len(strangers) >= limits.sessions:
                return False
            if len(strangers) < limits.strangers:
                return True
            late_s = time.monotonic() - limits.grace_s
            silent = [one for one in strangers if not one._has_sent]
            may_go = silent or [one for one in strangers if one._begun_s < late_s]
            if not may_go:
                return False
            by_address = Counter(one.address for one in strangers)
            max(may_go, key=lambda one: by_address[one.address])._let_go("others wait")
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

        def _watched(self, answer: Callable[..., Any]) -> Callable[..., Any]:
            def send(handle: Any, sequence: Any, response: Any, *more: Any) -> None:
                answer(handle, sequence, response, *more)
                if isinstance(response, ua.ServiceFault) and not self.signed_in:
                    self._faults += 1
                    if self._faults >= limits.faults:
                        self._let_go("it sends bad requests without having signed in")

            return send

        def _guarded(self, serve: Callable[..., Any]) -> Callable[..., Any]:
            async def process(kind: Any, header: Any, sequence: Any, body: Any) -> bool:
                arguments = (kind, header, sequence, body)
                if kind in registers:
                    raise ServiceError(ua.StatusCodes.BadServiceUnsupported)
                if kind == create and self.processor is not None and self.processor.session is not None:
                    raise ServiceError(ua.StatusCodes.BadTooManySessions)
                if kind == activate:
                    return await self._sign_in(serve, *arguments)
                if kind == call and self.signed_in:
                    if len(self._calls) >= limits.calls:
                        raise ServiceError(ua.StatusCodes.BadTooManyOperations)
                    task = asyncio.create_task(self._called(serve, *arguments))
                    self._calls.add(task)
                    task.add_done_callback(self._calls.discard)
                    return True
                return bool(await serve(*arguments))

            return process

        async def _sign_in(self, serve: Callable[..., Any], *arguments: Any) -> bool:
            await asyncio.sleep(sign_ins.delay_s(self.address))
            user_manager.denied = ""
            try:
                return bool(await serve(*arguments))
            except Exception as error:
                if getattr(error, "code", None) in wrong:
                    sign_ins.failed(self.address)
                    user = user_manager.denied[:40]
                    who = f"{user!r} from {self.address}"
                    log.say(f"sign-in {who}", f"sign-in denied to {who}: wrong user or password")
                raise

        async def _called(
            self, serve: Callable[..., Any], kind: Any, header: Any, sequence: Any, body: Any
        ) -> None:
            try:
                await serve(kind, header, sequence, body)
            except Exception as error:
                fault = ua.ServiceFault()
                code = getattr(error, "code", ua.StatusCodes.BadInternalError)
                fault.ResponseHeader.ServiceResult = ua.StatusCode(code)
                processor: Any = self.processor
                if processor is not None and not self.gone:
                    processor.send_response(header.RequestHandle, sequence, fault)

    return GuardedProtocol
