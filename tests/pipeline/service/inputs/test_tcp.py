"""The raw TCP trigger port, spoken to over real sockets."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
from collections.abc import AsyncIterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.plain_text import is_hidden
from pipeline.common.line_decision import LineDecision, decision_of
from pipeline.common.reading_records import CodeRecord, LineRecord, ReadingRecord
from pipeline.common.records import PartRecord, PartState
from pipeline.service.inputs.opcua import status_of
from pipeline.service.inputs.tcp import (
    DEFAULT_FORMAT,
    ResultString,
    ResultStringError,
    TcpLimits,
    TcpPort,
    _lines,
)
from pipeline.service.inputs.trigger import in_words
from pipeline.service.settings import TcpSettings
from pipeline.service.web.problem import Problem
from pipeline.store.errors import NotFoundError
from tests.support.line_fakes import LONG_S, part, reading, until

pytestmark = pytest.mark.anyio

ANSWER = b"P17;ACCEPT;KX407251;0.998;fused;01KB0000000000000000000017\r\n"


async def read_at_once(name: str, job: str = "", **_: object) -> PartRecord:
    return part(name)


@contextlib.asynccontextmanager
async def listening(trigger: Any = read_at_once, **options: Any) -> AsyncIterator[TcpPort]:
    limits = options.pop("limits", None)
    calls: Any = SimpleNamespace(trigger=trigger, **options.pop("calls", {}))
    port = TcpPort(TcpSettings(**options), calls, limits=limits)
    await port.start()
    try:
        yield port
    finally:
        await port.stop(grace_s=0.2)


async def said(port: TcpPort, sent: bytes) -> bytes:
    """All that comes back for what is sent before this side ends."""
    reader, writer = await asyncio.open_connection(port.host, port.port)
    writer.write(sent)
    writer.write_eof()
    answer = await asyncio.wait_for(reader.read(), LONG_S)
    writer.close()
    return answer


def answer_to(sent: bytes, trigger: Any = read_at_once, **options: Any) -> bytes:
    async def run() -> bytes:
        async with listening(trigger, **options) as port:
            return await said(port, sent)

    return asyncio.run(run())


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r"])
def test_a_trigger_is_answered_with_one_result_string(end: bytes) -> None:
    assert answer_to(b"TRIGGER P17" + end) == ANSWER
    assert answer_to(b"PING" + end + b"trigger P17" + end) == b"PONG\r\n" + ANSWER


def test_a_trigger_may_name_a_job() -> None:
    async def by_job(name: str, job: str = "", **_: object) -> PartRecord:
        return replace(part(name), job=job)

    template = "{name};{job}"
    assert answer_to(b"TRIGGER:housing-left P 17\r\n", by_job, format=template) == b"P 17;housing-left\r\n"
    assert answer_to(b"trigger:L\r\nTRIGGER P18\r\n", by_job, format=template) == b";L\r\nP18;\r\n"


def test_a_trigger_may_say_what_the_part_should_read() -> None:
    async def expecting(name: str, job: str = "", *, expected: str = "", **_: object) -> PartRecord:
        return replace(part(name), job=job, expected=expected)

    template = "{name}/{job}/{expected}"
    for sent, answer in (
        (b"TRIGGER=KX407251 P 17", b"P 17//KX407251"),
        (b"trigger:left=A%3BB%20C P17", b"P17/left/A;B C"),
        (b"TRIGGER=KX407251", b"//KX407251"),
    ):
        assert answer_to(sent + b"\r\n", expecting, format=template) == answer + b"\r\n"
    for line in (b"TRIGGER= P17", b"TRIGGER:=A P17", b"TOUCH", b"TOUCH=A P17", b"RESULT", b"RESULT:left P17"):
        assert answer_to(line + b"\r\n").startswith(b"ERROR;unknown command")


def test_a_part_is_released_and_looked_up_by_name_or_id() -> None:
    async def released(name: str, *, within_s: float) -> PartRecord:
        assert within_s == TcpLimits().answer_s
        return part(name, text="KX4")

    async def looked_up(name: str) -> PartRecord:
        if name == "P18":
            raise NotFoundError("there is no part named 'P18'", hint="check the name")
        return part(name, state=PartState.REVIEWED, text="B77")

    calls = {"release": released, "look_up": looked_up}
    template = "{name};{decision};{text}"
    assert answer_to(b"TOUCH P 17\r\n", calls=calls, format=template) == b"P 17;ACCEPT;KX4\r\n"
    assert answer_to(b"result P17\r\n", calls=calls, format=template) == b"P17;ACCEPT;B77\r\n"
    assert answer_to(b"RESULT P18\r\n", calls=calls).startswith(b"ERROR;there is no part named 'P18'")


COMMANDS = st.sampled_from(
    [b"PING", b"ping", b"TRIGGER P17", b"TRIGGER:left=KX4 P17", b"TOUCH P1", b"RESULT P1"]
)
FILLERS = st.binary(min_size=4, max_size=40)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(COMMANDS, st.sampled_from([b"", b"\r", b"\r\n"]), FILLERS), min_size=1, max_size=4))
def test_lines_as_simatic_strings_are_answered_as_plain_ones(
    strings: list[tuple[bytes, bytes, bytes]],
) -> None:
    """With their length before them, with or without an end, filled up with what stood there before."""

    async def lines(sent: list[bytes]) -> list[bytes]:
        reader = asyncio.StreamReader()
        for string in sent:
            reader.feed_data(string)
        reader.feed_eof()
        return [line async for line in _lines(reader, TcpLimits(line_bytes=1024))]

    for_plc = [
        bytes([len(line + end + filler), len(line + end)]) + line + end + filler
        for line, end, filler in strings
    ]
    assert asyncio.run(lines(for_plc)) == [line for line, *_ in strings]
    # and where only the present length is sent
    short = [bytes([254, len(line + end)]) + line + end for line, end, _ in strings]
    assert asyncio.run(lines(short)) == [line for line, *_ in strings]


async def test_a_line_may_come_in_pieces_and_lines_together() -> None:
    async with listening() as port:
        reader, writer = await asyncio.open_connection(port.host, port.port)
        for piece in (b"TRI", b"GGER P", b"17\r", b"\nPING\r", b"\n\r\n\nPING\n"):
            writer.write(piece)
            await writer.drain()
            await asyncio.sleep(0.02)  # else they travel together, which must be right as well
        answers = [await asyncio.wait_for(reader.readline(), LONG_S) for _ in range(3)]
        assert answers == [ANSWER, b"PONG\r\n", b"PONG\r\n"]
        writer.close()


def test_a_failure_is_told_in_one_line_or_only_that_there_was_one() -> None:
    async def refused(*_: str, **__: object) -> PartRecord:
        raise Problem(422, "no picture of P17;\r\nput one into the folder")

    async def missing(name: str, job: str = "", **_: object) -> PartRecord:
        raise Problem(422, f"no picture of {name}; put {name}.png into the folder")

    async def broken(*_: str, **__: object) -> PartRecord:
        raise KeyError("password")

    assert answer_to(b"TRIGGER P17\r\n", refused) == b"ERROR;no picture of P17, put one into the folder\r\n"
    named = b"ERROR;no picture of a%3Bb, put a%3Bb.png into the folder\r\n"
    assert answer_to(b"TRIGGER a;b\r\n", missing) == named
    assert answer_to(b"TRIGGER P17\r\n", broken) == b"ERROR;the service failed, its log says why\r\n"
    assert len(in_words(Problem(500, "x" * 5000))) == 200


def test_a_long_line_is_refused_and_the_connection_closed() -> None:
    limits = TcpLimits(line_bytes=32)
    wanted = b"ERROR;a line has at most 32 bytes\r\n"
    assert answer_to(b"TRIGGER " + b"x" * 100, limits=limits) == wanted
    assert answer_to(b"TRIGGER " + b"x" * 100 + b"\r\nPING\r\n", limits=limits) == wanted
    assert answer_to(b"TRIGGER " + b"x" * 24 + b"\r\n", limits=limits).startswith(b"x" * 24)


async def test_silence_and_slowness_end_a_connection() -> None:
    async with listening(limits=TcpLimits(idle_s=0.1)) as port:
        reader, _ = await asyncio.open_connection(port.host, port.port)
        assert await asyncio.wait_for(reader.read(), LONG_S) == b"ERROR;nothing came for too long\r\n"
    async with listening(limits=TcpLimits(line_s=0.3)) as port:
        reader, writer = await asyncio.open_connection(port.host, port.port)

        async def drip() -> None:
            while True:
                writer.write(b"x")
                await asyncio.sleep(0.02)

        dripping = asyncio.create_task(drip())
        assert await asyncio.wait_for(reader.read(), LONG_S) == b"ERROR;the line did not end\r\n"
        dripping.cancel()


async def test_more_triggers_than_connections_may_be_are_told_so() -> None:
    go = asyncio.Event()

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        await go.wait()
        return part(name)

    async with listening(trigger, limits=TcpLimits(connections=2)) as port:
        busy = [await asyncio.open_connection(port.host, port.port) for _ in range(2)]
        for _, writer in busy:
            writer.write(b"TRIGGER P17\r\n")
        await until(lambda: len(port._reading) == 2)
        assert await said(port, b"") == b"ERROR;too many connections\r\n"
        go.set()
        for reader, _ in busy:
            assert await asyncio.wait_for(reader.readline(), LONG_S) == ANSWER
        assert await said(port, b"PING\r\n") == b"PONG\r\n"  # an idle one makes room


async def test_callers_who_spoke_once_keep_no_controller_out() -> None:
    async with listening(limits=TcpLimits(connections=4)) as port:
        controller, writer = await asyncio.open_connection(port.host, port.port, local_addr=("127.0.0.2", 0))
        others = [await asyncio.open_connection(port.host, port.port) for _ in range(4)]
        for reader, other in ((controller, writer), *others[1:]):
            other.write(b"PING\r\n")
            assert await asyncio.wait_for(reader.readline(), LONG_S) == b"PONG\r\n"
        assert await asyncio.wait_for(others[0][0].read(), LONG_S) == b""  # it had said nothing
        for _ in range(8):
            assert await said(port, b"PING\r\n") == b"PONG\r\n"
        writer.write(b"TRIGGER P17\r\n")  # idle for longest, but of another address
        assert await asyncio.wait_for(controller.readline(), LONG_S) == ANSWER
        writer.close()


@pytest.mark.parametrize(
    "sent",
    [
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1:9\r\nContent-Type: text/plain\r\n\r\nTRIGGER P17\r\n",
        b"GET /TRIGGER%20P17 HTTP/1.0\nTRIGGER P17\n",
        b"PRI * HTTP/2.0\r\n\r\nTRIGGER P17\r\n",
        b"\x16\x03\x01\x00\x05\nTRIGGER P17\n",
    ],
)
def test_a_web_page_cannot_trigger(sent: bytes) -> None:
    triggered: list[str] = []

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        triggered.append(name)
        return part(name)

    assert (answer_to(sent, trigger), triggered) == (b"", [])


def test_only_the_clients_named_may_call(caplog: pytest.LogCaptureFixture) -> None:
    with contextlib.suppress(ConnectionResetError):  # what was sent is not even read
        assert answer_to(b"PING\r\n", clients=("10.0.0.0/8",)) == b""
    assert "127.0.0.1 has called and is not one of tcp.clients" in caplog.text
    assert answer_to(b"PING\r\n", clients=("10.0.0.0/8", "127.0.0.1")) == b"PONG\r\n"
    with pytest.raises(ValueError, match="10"):
        TcpSettings(clients=("10.0.0.300",))


async def test_answers_keep_the_order_of_the_lines_and_callers_do_not_wait_for_each_other() -> None:
    go = asyncio.Event()

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        if name == "slow":
            await go.wait()
        return part(name)

    async with listening(trigger) as port:
        reader, writer = await asyncio.open_connection(port.host, port.port)
        writer.write(b"TRIGGER slow\r\nTRIGGER fast\r\n")
        assert (await said(port, b"TRIGGER other\r\n")).startswith(b"other;")
        go.set()
        answers = [await asyncio.wait_for(reader.readline(), LONG_S) for _ in range(2)]
        assert [answer.split(b";")[0] for answer in answers] == [b"slow", b"fast"]
        writer.close()


async def test_a_part_is_read_to_its_end_though_the_caller_resets_or_gives_up() -> None:
    begun, go, read = asyncio.Event(), asyncio.Event(), []

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        begun.set()
        await go.wait()
        read.append(name)
        return part(name)

    async with listening(trigger, limits=TcpLimits(answer_s=0.2)) as port:
        _, writer = await asyncio.open_connection(port.host, port.port)
        writer.write(b"TRIGGER gone\r\n")
        await asyncio.wait_for(begun.wait(), LONG_S)
        raw = writer.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        writer.transport.abort()
        late = await said(port, b"TRIGGER late\r\n")
        assert late == b"ERROR;no result in time, the part is still being read\r\n"
        go.set()
        await until(lambda: sorted(read) == ["gone", "late"])


async def test_stopping_answers_what_is_under_way_and_closes_the_rest() -> None:
    begun, go = asyncio.Event(), asyncio.Event()

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        begun.set()
        await go.wait()
        return part(name)

    calls: Any = SimpleNamespace(trigger=trigger)
    port = TcpPort(TcpSettings(), calls)
    await port.start()
    idle_reader, _ = await asyncio.open_connection(port.host, port.port)
    reader, writer = await asyncio.open_connection(port.host, port.port)
    writer.write(b"TRIGGER P17\r\nTRIGGER P18\r\n")
    await asyncio.wait_for(begun.wait(), LONG_S)
    stopping = asyncio.create_task(port.stop(grace_s=LONG_S))
    assert await asyncio.wait_for(idle_reader.read(), LONG_S) == b""
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection(port.host, port.port)
    go.set()
    assert await asyncio.wait_for(reader.read(), LONG_S) == ANSWER  # and P18 was not begun
    await asyncio.wait_for(stopping, LONG_S)


@pytest.mark.parametrize(
    ("record", "word", "status"),
    [
        (part(), LineDecision.ACCEPT, 0),
        (part(state=PartState.TOUCH_NEEDED), LineDecision.TOUCH, 11),
        (part(state=PartState.REVIEW, reading=reading(decision="review")), LineDecision.REVIEW, 11),
        # read with certainty, but not what was expected
        (part(state=PartState.REVIEW, reading=reading(verdict="refuted")), LineDecision.REVIEW, 12),
        (part(state=PartState.REVIEW, reading=reading(decision="reject")), LineDecision.REJECT, 11),
        (part(text=""), LineDecision.REJECT, 8),
        (part(state=PartState.REVIEW, reading=None), LineDecision.REJECT, 11),
        (part(state=PartState.REVIEWED), LineDecision.ACCEPT, 0),
        (part(text="", state=PartState.REVIEWED), LineDecision.REJECT, 8),
        # whatever was read
        (part(state=PartState.SHADOW), LineDecision.SHADOW, 17),
        (part(text="", state=PartState.SHADOW), LineDecision.SHADOW, 17),
    ],
)
def test_a_part_comes_to_one_word_and_one_status_of_opc_ua(
    record: PartRecord, word: LineDecision, status: int
) -> None:
    assert (decision_of(record), status_of(record)) == (word, status)


def test_the_format_is_the_integrators() -> None:
    assert ResultString("{text}").of(part()) == "KX407251"
    assert ResultString("S={text} C={confidence:06.2f}").of(part()) == "S=KX407251 C=001.00"
    assert ResultString("{{{text}}}{verdict}").of(part()) == "{KX407251}"
    lines = (LineRecord("lot", "LOT77", 0.9), LineRecord("", "12/26", 0.9))
    read = ReadingRecord("fused", "KX407251", "accept", 0.9, lines=lines)
    assert ResultString("{text} {lines}").of(part(reading=read)) == "KX407251 lot=LOT77;12/26"
    read = ReadingRecord("fused", "KX407251", "accept", 0.9, codes=(CodeRecord("QR Code", "KX407251", True),))
    assert ResultString("{text};{codes}").of(part(reading=read)) == "KX407251;KX407251 (same)"
    assert ResultString(DEFAULT_FORMAT).of(part(reading=None)).split(";")[3:5] == ["0.000", ""]


@pytest.mark.parametrize(
    "template",
    [
        *(
            "",
            "OK",
            "{serial}",
            "{text.__class__}",
            "{text[0]}",
            "{}",
            "{0}",
            "{text",
            "{text!r}",
            "{text:>9}",
        ),
        *("{confidence:9999999999}", "{confidence:.3e}", "{confidence:{text}}", "{text}\n", "x" * 501),
    ],
)
def test_a_format_that_cannot_be_is_refused_at_once(template: str) -> None:
    with pytest.raises(ResultStringError):
        ResultString(template)


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=20), st.text(max_size=20))
def test_no_value_breaks_the_line_and_every_value_comes_back(name: str, text: str) -> None:
    line = ResultString().of(part(name, text))
    assert not any(is_hidden(char) for char in line)
    line.encode()
    fields = line.split(";")
    assert len(fields) == 6
    assert unquote(fields[0], errors="surrogatepass") == name
    assert unquote(fields[2], errors="surrogatepass") == text
