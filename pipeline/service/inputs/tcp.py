"""A raw TCP port for line controllers: one line in, one line out (docs: how-to/plc).

TRIGGER P17<CR><LF>                -->  P17;ACCEPT;KX407251;0.998;fused;01JD...<CR><LF>
TRIGGER:job=KX407251 P17<CR><LF>   -->  the same, read by a job, for a part that should read KX407251
TOUCH P17<CR><LF>                  -->  the same after the part, which lies under the whiskers, was felt
RESULT P17<CR><LF>                 -->  the same of the part as it stands, perhaps reviewed by a person
PING<CR><LF>                       -->  PONG<CR><LF>
anything else                      -->  ERROR;what is wrong<CR><LF>
an HTTP request, or TLS            -->  closed

The result string is made from a format with named fields: {name};{decision};{text};{confidence:.3f};{source};{id}
In values the format's own punctuation, invisible characters and % are %XX, as in web addresses: A;B is sent as A%3BB.

Lines are UTF-8 and end with CR LF, CR or LF; NULs before and after a line are taken off. A line may also come as a
STRING of SIMATIC controllers: two bytes with its maximum and present length before it, with or without an end. Answers
come in the order of the lines. There is neither sign-in nor encryption: beyond this machine, `clients` may call.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from string import Formatter
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from glyphs.errors import MarksError
from glyphs.plain_text import has_hidden, is_hidden
from pipeline.common.line_decision import NO_READING, decision_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord
from pipeline.common.row import codes_text, fields_text, lines_text
from pipeline.service.connections import Peer, SparingLog, longest_idle_of_busiest
from pipeline.service.inputs.trigger import answer_of, in_words
from pipeline.service.settings import host_and_port
from pipeline.service.tasks import end_tasks
from pipeline.service.web.access import is_in

if TYPE_CHECKING:
    from pipeline.service.intake import Intake
    from pipeline.service.settings import TcpSettings

DEFAULT_FORMAT = "{name};{decision};{text};{confidence:.3f};{source};{id}"
# fields of the part, and of its reading
_OF_PART = ("name", "text", "id", "state", "expected", "database", "job")
_OF_READING = ("source", "verdict", "font")
_COMPUTED: dict[str, Callable[[PartRecord, ReadingRecord], str]] = {
    "decision": lambda part, _: decision_of(part).value,
    "lines": lambda _, reading: lines_text(reading.lines),
    "codes": lambda _, reading: codes_text(reading.codes),
    "fields": lambda _, reading: fields_text(reading.fields),
}
TEXT_FIELDS = (*_OF_PART, *_OF_READING, *_COMPUTED)
NUMBER_FIELDS = ("confidence", "height_mm", "rotation_deg", "seconds")
_SPEC = re.compile(r"0?[0-9]{0,2}(\.[0-9]{1,2}f)?")
_LONGEST = 500
LINE_END = b"\r\n"
_LINGER_S = 0.5
# seconds of silence until the system asks whether a controller is there, seconds between questions, and their number
_KEEPALIVE = {"TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3}
_END = re.compile(rb"[\r\n]")
# head of a STRING: its maximum and present length, before a command
_SIMATIC = re.compile(rb"(?s)(?:[^\0\r\n].|.[^\0\r\n])(?=TRIGGER|TOUCH|RESULT|PING)", re.IGNORECASE)
# NULs fill up the strings of fixed length that some controllers send; CR LF may come in two pieces
_PADDING = b"\0\r\n"
# the first line of an HTTP request, or the first bytes of TLS
_WEB = re.compile(rb"[A-Z]+ \S+ HTTP/\d|\x16\x03")


class ResultStringError(MarksError):
    """An invalid format of result strings."""


class ResultString:
    """Makes result strings of one format."""

    def __init__(self, template: str = DEFAULT_FORMAT) -> None:
        """Raises ResultStringError: an unknown field, one written as no number can be, or a control character."""
        self.template = template
        if not template or len(template) > _LONGEST:
            raise ResultStringError(
                f"a result format has 1 to {_LONGEST} characters, this one {len(template)}"
            )
        try:
            parsed = list(Formatter().parse(template))
        except ValueError as error:
            raise ResultStringError(f"the result format {template!r} is broken: {error}") from error
        literals = "".join(literal for literal, *_ in parsed)
        if has_hidden(literals):
            raise ResultStringError(
                "a result format has no control characters", hint="the line's end is added"
            )
        for _, name, spec, conversion in parsed:
            if name is not None:
                _check_field(name, spec or "", conversion)
        if not any(name for _, name, *_ in parsed):
            raise ResultStringError(f"the result format {template!r} names no field, such as {{text}}")
        self._kept_apart = frozenset(char for char in literals if not char.isalnum()) | {"%"}

    def of(self, part: PartRecord) -> str:
        reading = part.reading or NO_READING
        texts = {name: str(getattr(part, name)) for name in _OF_PART}
        texts |= {name: getattr(reading, name) for name in _OF_READING}
        texts |= {name: make(part, reading) for name, make in _COMPUTED.items()}
        texts = {name: self._quote(text) for name, text in texts.items()}
        numbers = {name: getattr(reading, name) or 0.0 for name in NUMBER_FIELDS}
        return self.template.format(**texts, **numbers)

    def _quote(self, text: str) -> str:
        return "".join(
            _percent(char) if char in self._kept_apart or is_hidden(char) else char for char in text
        )


def _percent(char: str) -> str:
    return "".join(f"%{byte:02X}" for byte in char.encode("utf-8", "surrogatepass"))


def _check_field(field: str, spec: str, conversion: str | None) -> None:
    known = (*TEXT_FIELDS, *NUMBER_FIELDS)
    if field not in known:  # so no attribute or index can be reached through a format
        raise ResultStringError(f"the result format asks for {field!r}", hint=f"there are {', '.join(known)}")
    if conversion or (spec and (field in TEXT_FIELDS or not _SPEC.fullmatch(spec))):
        raise ResultStringError(
            f"the field {field} cannot be written as {spec or conversion!r}", hint="numbers as .3f"
        )


@dataclass(frozen=True)
class TcpLimits:
    """Resource limits of callers, and times in seconds."""

    connections: int = 16
    line_bytes: int = 256
    idle_s: float = 3600.0
    line_s: float = 10.0  # for a line that has begun to end
    # of one trigger; after it the answer is an error, but the part is read to its end
    answer_s: float = 120.0
    write_s: float = 10.0  # for the caller to take an answer


class _LineError(Exception):
    """A connection that must be closed."""


class TcpPort:
    """The trigger port; `port` 0 becomes the real one once it is started."""

    title = "TCP trigger port"
    trouble = ""

    def __init__(self, settings: TcpSettings, intake: Intake, *, limits: TcpLimits | None = None) -> None:
        self.host, self.port = host_and_port(settings.port or "0")
        self._intake = intake
        self._result = ResultString(settings.format or DEFAULT_FORMAT)
        self._clients = settings.clients
        self._limits = limits or TcpLimits()
        self._server: asyncio.Server | None = None
        self._callers: dict[asyncio.Task[None], _Caller] = {}
        self._reading: set[asyncio.Future[Any]] = set()
        self._stopping = False
        self._log = SparingLog("TCP port")

    async def start(self) -> dict[str, object]:
        limit = 2 * self._limits.line_bytes
        self._server = await asyncio.start_server(self._serve, self.host, self.port, limit=limit)
        self.port = self._server.sockets[0].getsockname()[1]
        return {"host": self.host, "port": self.port}

    async def stop(self, *, grace_s: float = 20.0) -> None:
        self._stopping = True
        if self._server is not None:
            self._server.close()
        for talk, caller in self._callers.items():
            if caller.idle:
                talk.cancel()
        await end_tasks(self._callers, grace_s=grace_s)
        await end_tasks(self._reading, grace_s=grace_s)  # parts whose callers did not wait for them
        if self._server is not None:
            await self._server.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        caller = _Caller(writer)
        caller.identify(writer)
        # a task of the stream server that ends as cancelled is logged as a failure
        try:
            if self._clients and not is_in(caller.address, self._clients):
                self._log.say(caller.address, f"{caller.address} has called and is not one of tcp.clients")
                return
            if self._stopping or not self._has_room():
                await self._write(writer, _error("too many connections"))
                return
            self._callers[task] = caller
            raw = writer.get_extra_info("socket")  # the system notices a controller that was switched off
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for name, value in _KEEPALIVE.items():
                if hasattr(socket, name):
                    raw.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
            raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            await self._converse(caller, reader)
        except _LineError as error:
            with contextlib.suppress(OSError, TimeoutError):
                await self._write(writer, _error(str(error)))
                await _linger(reader, writer)
        except (OSError, TimeoutError, asyncio.CancelledError):
            pass  # stopped, or the caller has gone or does not take its answers
        finally:
            self._callers.pop(task, None)
            writer.close()
            try:
                await asyncio.wait_for(writer.wait_closed(), 1.0)
            except (OSError, TimeoutError):
                writer.transport.abort()

    def _has_room(self) -> bool:
        if len(self._callers) < self._limits.connections:
            return True
        idle = {caller: task for task, caller in self._callers.items() if caller.idle}
        if not idle:
            return False
        dropped = longest_idle_of_busiest([caller for caller in idle if not caller.spoken] or idle)
        self._log.say("full", f"too many connections; an idle one of {dropped.address} is closed")
        del self._callers[idle[dropped]]
        idle[dropped].cancel()
        return True

    async def _converse(self, caller: _Caller, reader: asyncio.StreamReader) -> None:
        async for line in _lines(reader, self._limits):
            if not caller.spoken and _WEB.match(line):
                # a web page can make a browser send such a request, and its later lines might be a trigger
                self._log.say("web", "a web browser or similar has called; its connection was closed")
                return
            caller.spoken, caller.idle = True, False
            caller.heard_s = time.monotonic()
            await self._write(caller.writer, await self._answer(line))
            caller.idle = True
            if self._stopping:
                return

    async def _answer(self, line: bytes) -> bytes:
        try:
            words = line.decode("utf-8").strip(" ")
        except UnicodeDecodeError:
            return _error("the line is not UTF-8")
        if has_hidden(words):
            return _error("the line holds control characters")
        command, _, arguments = words.partition(" ")
        command, equals, expected = command.partition("=")
        verb, colon, job = command.partition(":")
        part, within_s = arguments.strip(), self._limits.answer_s
        match verb.upper():
            case "PING" if not (arguments or colon or equals):
                return b"PONG"
            case "TRIGGER" if (job or not colon) and (expected or not equals):
                serial = unquote(expected)
                call = self._intake.trigger(part, job, expected=serial, within_s=within_s)
            case "TOUCH" if part and not (colon or equals):
                call = self._intake.release(part, within_s=within_s)
            case "RESULT" if part and not (colon or equals):
                call = self._intake.look_up(part)
            case _:
                return _error(
                    "unknown command; send TRIGGER name, TRIGGER:job name, TOUCH name, RESULT name, or PING"
                )
        try:
            return self._result.of(await answer_of(call, self._reading, within_s=within_s)).encode()
        except Exception as error:
            return _error(in_words(error))

    async def _write(self, writer: asyncio.StreamWriter, answer: bytes) -> None:
        writer.write(answer + LINE_END)
        try:
            await asyncio.wait_for(writer.drain(), self._limits.write_s)
        except TimeoutError:
            writer.transport.abort()
            raise


@dataclass(eq=False)
class _Caller(Peer):
    writer: asyncio.StreamWriter
    spoken: bool = False
    idle: bool = True


async def _lines(reader: asyncio.StreamReader, limits: TcpLimits) -> AsyncIterator[bytes]:
    loop, held = asyncio.get_running_loop(), b""
    begun = idle_since = loop.time()
    while True:
        if not _SIMATIC.match(held):
            held = held.lstrip(_PADDING)
        if _SIMATIC.match(held) and held[0] >= held[1]:
            n_bytes = 2 + held[1]
            if len(held) >= n_bytes:
                line, filler = held[2:n_bytes].rstrip(_PADDING), held[n_bytes : 2 + held[0]]
                # what stands behind the present length is of earlier lines, unless it is the next line
                held = held[n_bytes if _SIMATIC.match(filler) else n_bytes + len(filler) :]
                yield line
                begun = idle_since = loop.time()
                continue
            end = None
        else:
            end = _END.search(held)
        if (end.start() if end is not None else len(held)) > limits.line_bytes:
            raise _LineError(f"a line has at most {limits.line_bytes} bytes")
        if end is not None:
            line, held = held[: end.start()].rstrip(_PADDING), held[end.end() :]
            if line.strip():
                yield line
                begun = idle_since = loop.time()
            continue
        until = begun + limits.line_s if held else idle_since + limits.idle_s
        try:
            async with asyncio.timeout_at(until):
                more = await reader.read(limits.line_bytes)
        except TimeoutError:
            raise _LineError("the line did not end" if held else "nothing came for too long") from None
        if not more:
            return
        begun = begun if held else loop.time()
        held += more


def _error(message: str) -> bytes:
    # one that no blank follows is part of a name, and is written as in results
    return f"ERROR;{message.replace('; ', ', ').replace(';', '%3B')}".encode()


async def _linger(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Read remaining bytes for a moment: closing with unread bytes would lose the last answer."""
    writer.write_eof()
    async with asyncio.timeout(_LINGER_S):
        while await reader.read(4096):
            pass
