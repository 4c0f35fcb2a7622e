"""The OPC UA server, asked by asyncua's own client: in this process, and in one that knows nothing of the types."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import socket
import struct
import subprocess
import sys
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar
from unittest.mock import Mock

import pytest
from asyncua import Client, ua

from pipeline.common.records import EvidenceKind, PartRecord, PartState
from pipeline.common.version import program_version
from pipeline.reading.part_job import RECORDING, PartJob
from pipeline.reading.triage import ReadPart
from pipeline.service.inputs.opcua import OpcUaPort, ocr_scan_result
from pipeline.service.settings import OpcUaSettings
from pipeline.service.stage.work import CameraPictures
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import Upload
from pipeline.store.errors import NotFoundError
from tests.support.line_broker import hello, message
from tests.support.line_fakes import LONG_S, NOW, part, reading, until
from tests.support.service_fixtures import inline_service
from tests.support.store_samples import PLAN

pytestmark = pytest.mark.anyio

T = TypeVar("T")
DEVICE = ["2:DeviceSet", "4:tactile-marks"]
STRANGER = """
import asyncio, json, sys
from asyncua import Client, ua

async def main(url):
    async with Client(url, timeout=60) as client:
        await client.load_data_type_definitions()
        spaces = await client.get_namespace_array()
        autoid = spaces.index("http://opcfoundation.org/UA/AutoID/")
        di = spaces.index("http://opcfoundation.org/UA/DI/")
        device_set = await client.nodes.objects.get_child(f"{di}:DeviceSet")
        (device,) = await device_set.get_children()
        kind = client.get_node(await device.read_type_definition())
        events = []
        class Handler:
            def event_notification(self, event):
                events.append(event)
        subscription = await client.create_subscription(20, Handler())
        await subscription.subscribe_events(device, client.get_node(ua.NodeId(1005, autoid)))
        settings = ua.ScanSettings(Duration=5000.0, Cycles=1, DataAvailable=True)
        results, status = await device.call_method(f"{autoid}:Scan", settings)
        started = await device.call_method(f"{autoid}:ScanStart", settings)
        for _ in range(500):
            if events:
                break
            await asyncio.sleep(0.02)
        result, (event,) = results[0], events
        told = event.ScanResult[0]
        print(json.dumps({
            "type": (await kind.read_browse_name()).to_string(), "type_id": kind.nodeid.to_string(),
            "status": status, "started": started, "code": result.CodeType, "data": result.ScanData.String,
            "at": result.Timestamp.isoformat(), "quality": result.Quality, "font": result.Font,
            "location": result.Location, "x": result.Position.PositionX, "width": result.Position.SizeX,
            "rotation": result.Position.Rotation, "event": told.ScanData.String, "device": event.DeviceName,
            "message": event.Message.Text, "event_type": event.EventType.to_string(),
            "source": event.SourceName, "status_name": ua.AutoIdOperationStatusEnumeration(status).name,
        }))

asyncio.run(main(sys.argv[1]))
"""


async def read_at_once(name: str, job: str = "", **_: object) -> PartRecord:
    return part(name)


def numbered() -> Any:
    """A trigger that makes a new part each time."""
    count = 0

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        nonlocal count
        count += 1
        return part(name, id=f"PART{count}", changed_at=NOW + timedelta(seconds=count))

    return trigger


class Shared:
    """One server for most tests: each takes seconds to build its standard nodes."""

    def __init__(self) -> None:
        self._trigger: Any = read_at_once
        self.jobs: list[str] = []
        self.port = OpcUaPort(OpcUaSettings(), self)

    async def release(self, name: str, **_: object) -> PartRecord:
        return await self.trigger(name)

    async def look_up(self, name: str) -> PartRecord:
        if name == "nobody":
            raise NotFoundError("there is no part named 'nobody'")
        return part(name, state=PartState.REVIEWED, text="B77")

    async def trigger(self, name: str, job: str = "", **_: object) -> PartRecord:
        self.jobs.append(job)
        record: PartRecord = await self._trigger(name, job)
        return record

    @contextlib.asynccontextmanager
    async def serving(self, trigger: Any = read_at_once) -> AsyncIterator[tuple[OpcUaPort, str]]:
        self._trigger = trigger
        self.jobs.clear()
        self.port._shown.clear()
        yield self.port, f"opc.tcp://127.0.0.1:{self.port.port}/tactile-marks"
        await until(lambda: self.port._scanning is None)


@pytest.fixture(scope="module")
async def shared(anyio_backend: str) -> AsyncIterator[Shared]:
    made = Shared()
    await made.port.start()
    yield made
    await made.port.stop(grace_s=1.0)


@contextlib.asynccontextmanager
async def asking(url: str) -> AsyncIterator[tuple[Client, Any]]:
    async with Client(url, timeout=LONG_S) as client:
        await client.load_data_type_definitions()
        yield client, await client.nodes.objects.get_child(DEVICE)


def settings(duration: float = 0.0, cycles: int = 1, available: bool = True) -> Any:
    kinds: Any = ua
    return kinds.ScanSettings(Duration=duration, Cycles=cycles, DataAvailable=available)


async def value_of(device: Any, path: str) -> Any:
    return await (await device.get_child(path)).read_value()


async def test_a_client_that_knows_nothing_of_the_types_finds_scans_and_hears(shared: Shared) -> None:
    async with shared.serving(numbered()) as (port, url):
        assert port.host == "127.0.0.1"
        stranger = await asyncio.create_subprocess_exec(
            sys.executable, "-c", STRANGER, url, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        out, err = await asyncio.wait_for(stranger.communicate(), LONG_S)
        assert stranger.returncode == 0, err.decode()[-2000:]
        told: dict[str, Any] = json.loads(out)
    assert told == {
        "type": "3:OcrReaderDeviceType",
        "type_id": "ns=3;i=1002",
        "status": 0,
        "status_name": "SUCCESS",
        "started": 0,
        "code": "RAW:STRING",
        "data": "KX407251",
        "at": NOW.isoformat(),
        "quality": 99,  # of 0.9984: never rounded up
        "font": "gothic",
        "location": None,
        "x": 0,
        "width": 46000,
        "rotation": -2,
        # one event: the part that Scan read was for whoever asked for it
        "event": "KX407251",
        "device": "tactile-marks",
        "message": "ACCEPT KX407251 PART2",
        "event_type": "ns=3;i=1005",
        "source": "tactile-marks",
    }


async def test_scanning_shows_the_part_in_the_variables(shared: Shared) -> None:
    async with shared.serving(numbered()) as (port, url), asking(url) as (_, device):
        assert await value_of(device, "2:SoftwareRevision") == program_version()
        assert await value_of(device, "3:DeviceStatus") == 0
        results, status = await device.call_method("3:Scan", settings())
        assert (results[0].ScanData.String, status) == ("KX407251", 0)
        assert await value_of(device, "4:LastPartId") == "PART1"
        told = await device.call_method("4:TriggerPart", "tray-7")
        assert told == ["PART2", "KX407251", "ACCEPT", 0.9984, "fused"]
        named = await device.call_method("4:TriggerJob", "tray-8", "housing-left")
        assert (named[0], shared.jobs[-1]) == ("PART3", "housing-left")
        names = ("3:LastScanData", "3:LastScanTimestamp", "4:LastPartId", "4:LastConfidence")
        values = [await (await device.get_child(name)).read_data_value() for name in names]
        assert len({value.SourceTimestamp for value in values}) == 1
        assert values[1].Value.Value == values[1].SourceTimestamp == NOW + timedelta(seconds=3)
        # a part that came by another door
        await port.show(part(id="PART9", text="ZZ9"))
        assert await value_of(device, "3:LastScanData") == "ZZ9"


async def test_a_part_is_released_and_looked_up_in_plain_types(shared: Shared) -> None:
    async with shared.serving(numbered()) as (_, url), asking(url) as (_, device):
        touched = await device.call_method("4:TouchPart", "P17")
        assert touched == ["PART1", "KX407251", "ACCEPT", 0.9984, "fused"]
        answer = await device.call_method("4:PartResult", "P17")
        assert answer[1:3] == ["B77", "ACCEPT"]
        assert await value_of(device, "4:LastPartId") == "PART1"  # nothing was read
        with pytest.raises(ua.UaStatusCodeError, match="BadNotFound"):
            await device.call_method("4:PartResult", "nobody")
        assert "no part named" in await value_of(device, "3:DeviceInfo")


async def test_after_a_call_that_has_failed_no_decision_stands(shared: Shared) -> None:
    fails = False

    count = numbered()

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        if fails:
            raise Problem(422, "no picture")
        read: PartRecord = await count(name)
        return read

    names = ("3:LastScanData", "4:LastPartId", "4:LastDecision", "4:LastConfidence")
    async with shared.serving(trigger) as (_, url), asking(url) as (_, device):
        for failing in ("TriggerPart", "TriggerJob"):
            fails = False
            await device.call_method("4:TriggerPart", "P17")
            assert await value_of(device, "4:LastDecision") == "ACCEPT"
            fails = True
            with pytest.raises(ua.UaStatusCodeError, match="BadDeviceFailure"):
                await device.call_method(f"4:{failing}", *["P18", "left"][: 1 + (failing == "TriggerJob")])
            assert [await value_of(device, name) for name in names] == ["", "", "ERROR", 0.0]
        fails = False
        await device.call_method("4:TriggerPart", "P17")
        with pytest.raises(ua.UaStatusCodeError, match="BadInvalidArgument"):
            await device.call_method("4:TriggerPart", "a\x07b")
        assert await value_of(device, "4:LastDecision") == "ERROR"


async def test_triggers_and_reviews_are_events_of_a_running_service_but_scan_answers_by_itself(
    tmp_path: Path,
) -> None:
    def read(job: PartJob, *_: Any) -> ReadPart:
        if job.files.name == "P2":
            return ReadPart((reading(decision="review"),))
        if not job.earlier:
            return ReadPart((reading("KX4", source="vision", decision="review"),), plan=PLAN)
        (job.folder / RECORDING).write_bytes(b"felt")
        return ReadPart((reading(),))

    async def take(_: str, folder: Path, **__: object) -> CameraPictures:
        (photo := folder / "photo.png").write_bytes(b"picture")
        return CameraPictures([Upload(photo, photo.name, EvidenceKind.PHOTO)])

    events: asyncio.Queue[str] = asyncio.Queue()

    class Heard:
        def event_notification(self, event: Any) -> None:
            events.put_nowait(event.Message.Text)

    with inline_service(tmp_path, instead=read, opcua={"port": 0}, stage={"device": tmp_path}) as served:
        intake, ports = served[0].intake, served[0].ports
        intake.camera.take = take  # type: ignore[method-assign]
        (address,) = (one.address for one in ports.connections())
        async with asking(f"opc.tcp://{address}/tactile-marks") as (client, device):
            subscription = await client.create_subscription(20, Heard())
            await subscription.subscribe_events(device, client.get_node(ua.NodeId(1005, 3)))
            results, status = await device.call_method("3:Scan", settings())
            assert (results[0].ScanData.String, status) == ("KX407251", 0)
            (scanned,) = intake.store.parts()
            assert await value_of(device, "4:LastPartId") == scanned.id
            told = await device.call_method("4:TriggerPart", "P1")
            assert await asyncio.wait_for(events.get(), LONG_S) == f"ACCEPT KX407251 P1 {told[0]}"
            assert events.empty()
            web, scan = served[1], {"scan": ("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(50))}
            sent = await asyncio.to_thread(web.post, "/v1/parts", files=scan, data={"name": "P2"})
            part_id = sent.json()["id"]
            assert await asyncio.wait_for(events.get(), LONG_S) == f"REVIEW KX407251 P2 {part_id}"
            said = {"action": "correct", "text": "B77", "who": "Anna", "outside_format": True}
            await asyncio.to_thread(web.post, f"/v1/parts/{part_id}/review", json=said)
            assert await asyncio.wait_for(events.get(), LONG_S) == f"ACCEPT B77 P2 {part_id}"


async def test_one_scan_at_a_time_and_its_status(shared: Shared) -> None:
    go = asyncio.Event()

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        await go.wait()
        return part(name)

    async with shared.serving(trigger) as (_, url), asking(url) as (_, device), asking(url) as (_, other):
        scanning = asyncio.create_task(device.call_method("3:Scan", settings()))
        while await value_of(other, "3:DeviceStatus") != 3:
            await asyncio.sleep(0.01)
        for method, argument in (("3:Scan", settings()), ("3:ScanStart", settings()), ("4:TriggerPart", "")):
            with pytest.raises(ua.UaStatusCodeError, match="BadInvalidState"):
                await other.call_method(method, argument)
        with pytest.raises(ua.UaStatusCodeError, match="BadInvalidState"):
            await other.call_method("3:ScanStop")  # none was started
        go.set()
        assert (await asyncio.wait_for(scanning, LONG_S))[1] == 0
        assert await value_of(other, "3:DeviceStatus") == 0
        go.clear()
        assert await device.call_method("3:ScanStart", settings(0.0, 0, False)) == 0
        while await value_of(other, "3:DeviceStatus") != 2:
            await asyncio.sleep(0.01)
        await other.call_method("3:ScanStop")
        go.set()
        while await value_of(other, "3:DeviceStatus") != 0:
            await asyncio.sleep(0.01)


async def test_failures_come_as_a_status_and_words(shared: Shared) -> None:
    problem: Exception = Problem(422, "no picture;\nput one into the folder")

    async def trigger(*_: object, **__: object) -> PartRecord:
        raise problem

    async with shared.serving(trigger) as (_, url), asking(url) as (_, device):
        assert await device.call_method("3:Scan", settings()) == [[], 17]
        assert await value_of(device, "3:DeviceInfo") == "no picture; put one into the folder"
        assert await value_of(device, "3:DeviceStatus") == 0  # a client may try again
        problem = KeyError("secret")
        assert await device.call_method("3:Scan", settings()) == [[], 20]
        assert await value_of(device, "3:DeviceInfo") == "the service failed; its log says why"
        with pytest.raises(ua.UaStatusCodeError, match="BadDeviceFailure"):
            await device.call_method("4:TriggerPart", "")


async def test_a_scan_that_takes_longer_than_its_duration_goes_on_and_is_told_as_it_ends(
    shared: Shared,
) -> None:
    go = asyncio.Event()

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        await go.wait()
        return part(name)

    async with shared.serving(trigger) as (_, url), asking(url) as (_, device):
        assert await device.call_method("3:Scan", settings(50.0)) == [[], 17]
        assert await value_of(device, "3:DeviceStatus") == 3
        go.set()
        while await value_of(device, "3:LastScanData") != "KX407251":
            await asyncio.sleep(0.01)


async def test_nobody_may_write_or_be_the_administrator(shared: Shared) -> None:
    async with shared.serving() as (_, url):
        client = Client(url, timeout=LONG_S)
        client.set_user("admin")  # asyncua makes an administrator of that name unless told not to
        with pytest.raises(ua.UaStatusCodeError):
            await client.connect()
        async with asking(url) as (asker, device):
            variable = await device.get_child("3:LastScanData")
            with pytest.raises(ua.UaStatusCodeError):
                await variable.write_value("FAKED")
            with pytest.raises(ua.UaStatusCodeError):
                await asker.nodes.objects.add_object(4, "mine")


async def test_a_session_in_use_stays_and_a_stop_waits_for_the_reading_of_a_caller_that_goes() -> None:
    go, read = asyncio.Event(), []

    async def trigger(name: str, job: str = "", **_: object) -> PartRecord:
        await go.wait()
        read.append(name)
        return part(name)

    calls: Any = SimpleNamespace(trigger=trigger, release=trigger, look_up=trigger)
    port = OpcUaPort(OpcUaSettings(), calls, connections=1)
    await port.start()
    url = f"opc.tcp://127.0.0.1:{port.port}/tactile-marks"
    client = Client(url, timeout=LONG_S)
    await client.connect()
    device = await client.nodes.objects.get_child(DEVICE)
    calling = asyncio.create_task(device.call_method("4:TriggerPart", "P1"))
    await until(lambda: port._scanning is not None)
    with pytest.raises((ua.UaError, ConnectionError, TimeoutError)):
        async with Client(url, timeout=2.0) as other:
            await other.get_namespace_array()
    assert not calling.done()
    calling.cancel()
    await asyncio.gather(calling, return_exceptions=True)
    client.disconnect_socket()  # no goodbye: it would wait behind the scan
    stopping = asyncio.create_task(port.stop(grace_s=LONG_S))
    await asyncio.sleep(0.05)
    go.set()
    await asyncio.wait_for(stopping, LONG_S)
    assert read == ["P1"]


async def test_a_result_of_odd_values_can_be_sent(shared: Shared) -> None:
    async with shared.serving():
        odd = reading(confidence=float("nan"), rotation_deg=float("inf"), characters=())
        result = ocr_scan_result(part(reading=odd))
        assert (result.Quality, result.Position.Rotation) == (0, 0)
        far = replace(reading("A").characters[0], box_mm=(-1e9, 0.0, 1e9, 5.0))
        assert ocr_scan_result(part(reading=reading(characters=(far,)))).Position.SizeX == 2**31 - 1
        assert ocr_scan_result(part(reading=None)).Quality == 0


async def test_who_does_not_read_the_answers_is_let_go(
    shared: Shared, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("pipeline.service.inputs.opcua_server.WRITE_S", 0.1)
    transport = Mock()
    transport.get_extra_info.return_value = ("127.0.0.9", 1)
    connection = shared.port._server.bserver._make_protocol()
    connection.connection_made(transport)
    connection.pause_writing()
    transport.pause_reading.assert_called_once_with()  # or the answers would fill the memory
    connection.resume_writing()
    transport.resume_reading.assert_called_once_with()
    await asyncio.sleep(0.2)
    transport.abort.assert_not_called()
    connection.pause_writing()
    await until(lambda: transport.abort.called)
    connection.connection_lost(None)
    assert "it does not read its answers" in caplog.text


async def test_idle_sessions_of_one_address_keep_no_controller_out() -> None:
    calls: Any = SimpleNamespace(trigger=read_at_once, release=read_at_once, look_up=read_at_once)
    port = OpcUaPort(OpcUaSettings(), calls, connections=2)
    await port.start()
    url = f"opc.tcp://127.0.0.1:{port.port}/tactile-marks"
    idle = [Client(url, timeout=LONG_S) for _ in range(2)]
    for client in idle:
        await client.connect()
    async with asking(url) as (_, device):
        assert (await device.call_method("4:TriggerPart", "P1"))[1] == "KX407251"
    for client in idle:
        with contextlib.suppress(Exception):
            await asyncio.wait_for(client.disconnect(), LONG_S)
    await asyncio.wait_for(port.stop(grace_s=0.05), LONG_S)


async def test_a_channel_without_a_session_is_closed_after_a_few_bad_requests(
    shared: Shared, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        await asyncio.to_thread(send_bad_requests, shared.port.port)
    said = [record.getMessage() for record in caplog.records]
    assert sum("Error while processing message" in line for line in said) <= 3
    assert sum(map(len, said)) < 60_000
    assert "a connection from 127.0.0.1 was closed: it sends" in caplog.text


def send_bad_requests(port: int) -> None:
    """On a channel without a session, until the server closes it."""
    with socket.create_connection(("127.0.0.1", port), timeout=LONG_S) as caller:
        caller.sendall(hello(f"opc.tcp://127.0.0.1:{port}/tactile-marks"))
        caller.recv(100)
        caller.sendall(open_channel())
        channel = struct.unpack_from("<I", caller.recv(500), 8)[0]
        with contextlib.suppress(OSError):
            for k in range(2, 2000):
                caller.sendall(bad_request(channel, k))
            while caller.recv(65536):
                pass


def open_channel() -> bytes:
    policy = b"http://opcfoundation.org/UA/SecurityPolicy#None"
    head = struct.pack("<I", 0) + struct.pack("<I", len(policy)) + policy + struct.pack("<ii", -1, -1)
    request = b"\x01\x00\xbe\x01\0\0" + struct.pack("<qIIi", 0, 1, 0, -1) + struct.pack("<I", 0) + b"\0\0\0"
    asked = struct.pack("<III", 0, 0, 1) + struct.pack("<i", -1) + struct.pack("<I", 60000)
    return message(b"OPNF", head + struct.pack("<II", 1, 1) + request + asked)


def bad_request(channel: int, number: int) -> bytes:
    head = struct.pack("<IIII", channel, 1, number, number) + b"\x01\x00\xcd\x01\0\0"
    request = struct.pack("<qIIi", 0, number, 0, -1) + struct.pack("<I", 0) + b"\0\0\0" + b"\xff" * 8
    return message(b"MSGF", head + request)
