"""The device and the server of OPC UA: nodes, users, and limits for callers that have not signed in.

The part of OPC 30010 (AutoID) that an OCR reader needs is loaded from `opcua_autoid.xml`.

caller --room--> connection --messages--> asyncua
         |                     |- no OPC UA, too large, faults          closed
         |                     |- sign-in after a wrong password        answered late
         |                     '- Call                                  answered in a task of its own
         '- no room: an idle caller is dropped

Callers without a session and callers with one are counted separately: of too many, the address with the most loses its
longest idle one, but none with a call in progress. One line of each kind of bad message is logged in ten seconds.
asyncua is untyped here. Raises MissingExtraError on import without it.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import math
import time
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from glyphs.errors import MissingExtraError
from pipeline.common.version import program_version
from pipeline.service.connections import WRITE_S, Peer, SparingLog, longest_idle_of_busiest
from pipeline.service.tasks import start

try:
    from asyncua import ua as _untyped
    from asyncua.common.utils import ServiceError
    from asyncua.crypto.permission_rules import User, UserRole
    from asyncua.server.binary_server_asyncio import BinaryServer, OPCUAProtocol
    from asyncua.server.server import Server
    from asyncua.server.uaprocessor import UaProcessor
    from asyncua.server.user_managers import UserManager
    from asyncua.ua.ua_binary import nodeid_from_binary
except ImportError as error:
    raise MissingExtraError("OPC UA", "asyncua", "opcua") from error

ua: Any = _untyped
DI_URI = "http://opcfoundation.org/UA/DI/"
AUTOID_URI = "http://opcfoundation.org/UA/AutoID/"
READER_URI = "urn:tactile-marks:reader"
NODE_SET = Path(__file__).with_name("opcua_autoid.xml")
# texts that are empty at first, which the file of the model cannot say
_EMPTY = (
    *("DeviceInfo", "LastScanData", "LastPartId", "LastDecision"),
    *("SerialNumber", "DeviceManual", "DeviceRevision", "HardwareRevision"),
)
_KINDS = frozenset({b"HEL", b"OPN", b"MSG", b"CLO", b"ERR"})
# connections that have not signed in
MOST_ANONYMOUS = 32
# seconds within which a caller must sign in
SIGN_IN_S = 10.0
# bad requests after which an anonymous connection is closed
MOST_FAULTS = 3
# methods that run at once for one connection
MOST_CALLS = 8
# seconds before a wrong password is answered, against guessing
WRONG_PASSWORD_S = 1.0
# bytes of one message
MESSAGE_BYTES = 1 << 20
_CREATE, _ACTIVATE, _CALL, *_REGISTER = (
    ua.NodeId(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary"))
    for name in ("CreateSession", "ActivateSession", "Call", "RegisterServer", "RegisterServer2")
)
_CODES = ua.StatusCodes
_WRONG = (_CODES.BadUserAccessDenied, _CODES.BadIdentityTokenInvalid, _CODES.BadIdentityTokenRejected)


# methods in plain types, with the names of their arguments; each returns the part
PLAIN_METHODS = {
    "TriggerPart": ("PartName",),
    "TriggerJob": ("PartName", "JobName"),
    "TouchPart": ("PartName",),
    "PartResult": ("PartName",),
}
_ANSWER = ("PartId", "Text", "Decision")


def _argument(name: str, kind: int = ua.ObjectIds.String) -> Any:
    return ua.Argument(Name=name, DataType=ua.NodeId(kind), ValueRank=-1)


async def set_up_device(server: Any, methods: Mapping[str, Callable[..., Any]]) -> tuple[dict[str, Any], Any]:
    """Load the model and set up its device; returns its nodes by name, and the generator of its events. `methods` are
    Scan, ScanStart and ScanStop of the model, and further ones with the arguments in `PLAIN_METHODS`."""
    uris = (DI_URI, AUTOID_URI, READER_URI)
    _, autoid, reader = [await server.register_namespace(uri) for uri in uris]
    await server.import_xml(NODE_SET)
    await server.load_data_type_definitions()
    device = server.get_node(ua.NodeId("reader", reader))
    nodes = {(await node.read_browse_name()).Name: node for node in await device.get_children()}
    words = {
        **dict.fromkeys(_EMPTY, ""),
        "SoftwareRevision": program_version(),
        "Manufacturer": ua.LocalizedText("tactile-marks"),
        "Model": ua.LocalizedText("camera and whisker array"),
    }
    for name, value in words.items():
        await nodes[name].write_value(value)
    for name, method in methods.items():
        if name in nodes:
            server.link_method(nodes[name], method)
            continue
        node_id, inputs = ua.NodeId(f"reader.{name}", reader), map(_argument, PLAIN_METHODS[name])
        outputs = [
            *map(_argument, _ANSWER),
            _argument("Confidence", ua.ObjectIds.Double),
            _argument("Source"),
        ]
        await device.add_method(node_id, ua.QualifiedName(name, reader), method, [*inputs], outputs)
    events = await server.get_event_generator(ua.NodeId(1005, autoid), device)
    events.event.DeviceName = await nodes["DeviceName"].read_value()
    # the node set has no values to take them from
    events.event.data_types |= {
        "DeviceName": ua.VariantType.String,
        "ScanResult": ua.VariantType.ExtensionObject,
    }
    return nodes, events


class Users(UserManager):
    """Users of the server, by name and password; each may read, subscribe and call, but not write."""

    def __init__(self, passwords: Mapping[str, str]) -> None:
        self._passwords = dict(passwords)
        self.denied = ""

    def get_user(
        self, _server: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> Any:
        if self._passwords:
            wanted = self._passwords.get(username or "", "")
            same = hmac.compare_digest(wanted.encode(), (password or "").encode("utf-8", "replace"))
            if not wanted or not same:
                self.denied = username or ""
                return None
        return User(role=UserRole.User, name=username)


def settings_fit(arguments: tuple[Any, ...], *, endless: bool) -> bool:
    """Whether ScanSettings are supported: at most one cycle; without any end only where that is allowed."""
    settings = arguments[0].Value if len(arguments) == 1 else None
    duration, cycles = getattr(settings, "Duration", None), getattr(settings, "Cycles", None)
    if not isinstance(duration, float | int) or not 0.0 <= duration < math.inf or cycles not in (0, 1):
        return False
    return endless or duration > 0.0 or cycles == 1 or bool(getattr(settings, "DataAvailable", False))


def bad(code: str) -> Any:
    """The status code with a name."""
    return ua.StatusCode(ua.UInt32(getattr(ua.StatusCodes, code)))


def variant(value: str | int | float | datetime) -> Any:
    """A value with the type of OPC UA that its nodes have."""
    kinds = {str: "String", int: "Int32", float: "Double", datetime: "DateTime"}
    return ua.Variant(value, getattr(ua.VariantType, kinds[type(value)]))


class GuardedServer(Server):
    """An asyncua server behind these limits; `sessions` is the most connections that have signed in."""

    def __init__(self, users: Users, *, sessions: int) -> None:
        super().__init__(user_manager=users)
        self.users, self.sessions, self.log = users, sessions, SparingLog("OPC UA")
        library = logging.getLogger("asyncua")
        library.handlers[:] = [self.log]
        library.propagate = False
        for name in ("asyncua", "asyncua.server.address_space", "asyncua.common"):
            logging.getLogger(name).setLevel(logging.ERROR)
        self.iserver.allow_remote_admin = False
        self.iserver.max_connections = sessions + MOST_ANONYMOUS + 1
        self.iserver.max_pending_activation_seconds = SIGN_IN_S
        self.iserver.max_subscriptions = 4 * sessions
        self.limits.max_message_size = MESSAGE_BYTES
        self.limits.max_chunk_count = max(1, MESSAGE_BYTES // self.limits.max_recv_buffer)

    async def start(self) -> None:
        await self._setup_server_nodes()
        await self.iserver.start()
        try:
            self.bserver = _Listener(self)
            self.bserver.set_policies(self._policies)
            await self.bserver.start()
        except BaseException:
            await self.iserver.stop()
            raise


class _Listener(BinaryServer):
    def __init__(self, server: GuardedServer) -> None:
        endpoint: Any = server.endpoint
        super().__init__(server.iserver, endpoint.hostname, endpoint.port, server.limits)
        self.server = server

    def _make_protocol(self) -> _Connection:
        return _Connection(self)


class _Connection(OPCUAProtocol, Peer):
    def __init__(self, listener: _Listener) -> None:
        super().__init__(
            listener.iserver, listener._policies, listener.clients, listener.closing_tasks, listener.limits
        )
        self.server, self.log = listener.server, listener.server.log
        self.gone, self.faults = False, 0
        self.unread: asyncio.TimerHandle | None = None
        self.calls: set[asyncio.Future[Any]] = set()

    def connection_made(self, transport: Any) -> None:
        self.identify(transport)
        anonymous = [client for client in self._live() if not client.signed_in]
        if len(anonymous) >= MOST_ANONYMOUS:
            longest_idle_of_busiest(anonymous).disconnect("others wait")
        super().connection_made(transport)
        self.processor = _Processor(self)

    def connection_lost(self, ex: BaseException | None) -> None:
        self.gone = True
        if self.unread is not None:
            self.unread.cancel()
        for task in self.calls:
            task.cancel()
        super().connection_lost(ex)

    def data_received(self, data: bytes) -> None:
        begin = self._buffer[:3] + data[: max(0, 3 - len(self._buffer))]
        if len(begin) == 3 and begin not in _KINDS:
            self.disconnect("it does not speak OPC UA")
        elif len(self._buffer) + len(data) > 2 * MESSAGE_BYTES:
            self.disconnect("its message is too large")
        elif not self.gone:
            self.heard_s = time.monotonic()
            super().data_received(data)

    def pause_writing(self) -> None:
        if self.transport is not None:
            self.transport.pause_reading()
            loop = asyncio.get_running_loop()
            self.unread = loop.call_later(WRITE_S, self.disconnect, "it does not read its answers")

    def resume_writing(self) -> None:
        if self.transport is not None and self.unread is not None:
            self.unread.cancel()
            self.transport.resume_reading()

    @property
    def signed_in(self) -> bool:
        session = self.processor.session if self.processor is not None else None
        return session is not None and bool(session.is_activated())

    def disconnect(self, why: str) -> None:
        if not self.gone and self.transport is not None:
            self.gone = True
            self.log.say(f"{why} {self.address}", f"a connection from {self.address} was closed: {why}")
            self.transport.abort()

    def make_room(self) -> bool:
        signed_in = [client for client in self._live() if client.signed_in and client is not self]
        if len(signed_in) < self.server.sessions:
            return True
        idle = [client for client in signed_in if not client.calls]
        if idle:
            longest_idle_of_busiest(idle).disconnect("others wait")
        return bool(idle)

    def _live(self) -> list[_Connection]:
        clients: list[Any] = self.clients
        return [client for client in clients if not client.gone]

    async def _process_one_msg(self, header: Any, buf: Any) -> bool:
        try:
            return bool(await super()._process_one_msg(header, buf))
        except Exception as error:
            self.disconnect(f"it sends what cannot be understood ({type(error).__name__})")
            return False


class _Processor(UaProcessor):
    def __init__(self, connection: _Connection) -> None:
        super().__init__(connection.iserver, connection.transport, connection.limits)
        self.set_policies(connection.policies)  # type: ignore[no-untyped-call]
        self.connection = connection

    def send_response(self, handle: Any, sequence: Any, response: Any, *more: Any) -> None:
        if self.connection.gone:
            return
        super().send_response(handle, sequence, response, *more)  # type: ignore[no-untyped-call]
        if isinstance(response, ua.ServiceFault) and not self.connection.signed_in:
            self.connection.faults += 1
            if self.connection.faults >= MOST_FAULTS:
                self.connection.disconnect("it sends bad requests without having signed in")

    async def process_message(self, sequence: Any, body: Any) -> Any:
        processing = super().process_message(sequence, body)  # type: ignore[no-untyped-call]
        if not self.connection.signed_in or nodeid_from_binary(body.copy()) != _CALL:
            return await processing
        start(processing, self.connection.calls)
        return True

    async def _process_message(self, kind: Any, *message: Any) -> bool:
        if kind in _REGISTER:
            raise ServiceError(_CODES.BadServiceUnsupported)
        if kind == _CREATE and self.session is not None:
            raise ServiceError(_CODES.BadTooManySessions)
        if kind == _CALL and len(self.connection.calls) > MOST_CALLS:
            raise ServiceError(_CODES.BadTooManyOperations)
        users = self.connection.server.users
        if kind == _ACTIVATE:
            users.denied = ""
        try:
            done = bool(await super()._process_message(kind, *message))  # type: ignore[no-untyped-call]
            if kind == _ACTIVATE and not self.connection.make_room():
                self.connection.disconnect("too many have signed in, and all are scanning")
            return done
        except Exception as error:
            if kind == _ACTIVATE and getattr(error, "code", None) in _WRONG:
                who = f"{users.denied[:40]!r} from {self.connection.address}"
                self.connection.log.say(f"sign-in {who}", f"sign-in denied to {who}: wrong user or password")
                await asyncio.sleep(WRONG_PASSWORD_S)
            raise
