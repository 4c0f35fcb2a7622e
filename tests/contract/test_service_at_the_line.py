"""A service as a line has it: behind a proxy's prefix, with a TCP port, an MQTT broker and an OPC UA server."""

from __future__ import annotations

import asyncio
import contextlib
import html
import json
import logging
import re
import shutil
import socket
import struct
import subprocess
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

import httpx
import numpy as np
import pytest
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from PIL import Image

from tests.contract.front_doors import RunningService, environment, run_service, status_of
from tests.support.line_broker import GuardedBroker, Listener
from tests.support.opcua_frames import hello, message
from tests.support.waiting import free_port, wait_until

pytestmark = pytest.mark.anyio
PAGES = ("/", "/review", "/parts", "/dashboard", "/jobs", "/shadow", "/docs", "/nothing/here")
SPACE = "urn:tactile-marks:reader"


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture(autouse=True)
def _quiet_client(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL, logger="asyncua")


@dataclass(frozen=True)
class Line:
    """The service, its ports, and the files of its OPC UA clients."""

    service: RunningService
    tcp_port: int
    opcua_port: int
    keys: Path

    @property
    def url(self) -> str:
        return self.service.url

    @property
    def opcua_url(self) -> str:
        return f"opc.tcp://127.0.0.1:{self.opcua_port}/tactile-marks"

    def logged(self, words: str) -> list[str]:
        """The events that hold these words."""
        lines = [json.loads(one) for one in self.service.log.splitlines() if one.startswith("{")]
        return [one["event"] for one in lines if words in one["event"]]

    def get(self, path: str) -> httpx.Response:
        return httpx.get(f"{self.url}{path}", timeout=120.0)

    def ready(self) -> dict[str, str]:
        answer = self.get("/readyz")
        assert answer.status_code == 200
        told: dict[str, str] = answer.json()
        return told

    def in_outbox(self) -> float:
        """Results that wait for any target."""
        (value,) = re.findall(r"^tactile_marks_outbox (\S+)$", self.get("/metrics").text, re.MULTILINE)
        return float(value)

    def connection(self, key: str) -> str:
        """What the dashboard's card says of a connection."""
        (row,) = re.findall(
            rf'<tr data-connection="{key}">(.*?)</tr>', self.get("/dashboard").text, re.DOTALL
        )
        return html.unescape(re.sub(r"<[^>]+>", " ", row))

    def send_part(self, height_map: Path) -> dict[str, Any]:
        scan = {"scan": ("K7.npz", height_map.read_bytes())}
        answer = httpx.post(f"{self.url}/v1/parts", files=scan, timeout=120.0)
        assert answer.status_code == 201, answer.text
        part: dict[str, Any] = answer.json()
        return part

    @contextlib.asynccontextmanager
    async def client(self, password: str = "geheim") -> AsyncIterator[Client]:
        """A client of OPC UA that has signed in."""
        one = Client(self.opcua_url, timeout=100)
        one.application_uri = "urn:tests"
        server, own = str(self.keys / "server.der"), (str(self.keys / "own.der"), str(self.keys / "own.pem"))
        await one.set_security(SecurityPolicyBasic256Sha256, *own, server_certificate=server)
        one.set_user("line-user")
        one.set_password(password)
        async with one:
            yield one


def make_certificate(folder: Path, name: str, uri: str) -> None:
    key, pem = folder / f"{name}.pem", folder / f"{name}.crt"
    kind = ("-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={name}")
    names = ("-addext", f"subjectAltName=URI:{uri},DNS:localhost,IP:127.0.0.1")
    made = ("-keyout", str(key), "-out", str(pem))
    subprocess.run(["openssl", "req", *kind, *names, *made], check=True, capture_output=True)
    der = ("-outform", "der", "-out", str(folder / f"{name}.der"))
    subprocess.run(["openssl", "x509", "-in", str(pem), *der], check=True, capture_output=True)


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GuardedBroker]:
    made = GuardedBroker(tmp_path_factory.mktemp("line"))
    made.start()
    yield made
    made.kill()


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory, broker: GuardedBroker, height_map: Path) -> Iterator[Line]:
    """The results go to the broker, and the OPC UA server asks for a password."""
    folder, tcp_port, opcua_port = tmp_path_factory.mktemp("opcua"), free_port(), free_port()
    make_certificate(folder, "server", "urn:tactile-marks:server")
    make_certificate(folder, "own", "urn:tests")
    for name in ("stage", "camera"):
        (folder / name).mkdir()
    shutil.copy(height_map, folder / "stage" / "K7.npz")
    options = (
        f"--jobs 1 --format A9 --font gothic --height-mm 4 --tokens off --root-path /marks --tcp.port {tcp_port}"
        f" --mqtt.url {broker.url} --opcua.port {opcua_port} --stage.folder {folder}/stage"
        f" --camera.folder {folder}/camera --opcua.certificate {folder}/server.der --opcua.key {folder}/server.pem"
    )
    users = environment(TACTILE_MARKS_SERVICE_OPCUA_USERS='{"line-user": "geheim"}')
    with run_service(folder / "service", *options.split(), env=users) as service:
        yield Line(service, tcp_port, opcua_port, folder)


@pytest.fixture
def listener(broker: GuardedBroker) -> Iterator[Listener]:
    with contextlib.closing(Listener(broker.port, user=broker.reader, password=broker.password)) as one:
        yield one


@pytest.mark.parametrize("path", PAGES)
def test_every_link_of_a_page_holds_under_the_prefix_of_a_proxy(line: Line, path: str) -> None:
    answer = httpx.get(
        f"{line.url}{path}", headers={"Accept": "text/html"}, follow_redirects=True, timeout=120.0
    )
    links = set(re.findall(r'\b(?:href|src|action|data-[a-z]+)="([^"#]+)"', answer.text))
    addresses = {html.unescape(one) for one in links if one.startswith((".", "/"))}
    assert addresses
    assert not [one for one in addresses if one.startswith("/")]
    for one in addresses:
        there = urljoin(str(answer.url), one)
        assert there.startswith(line.url)
        assert status_of(there) in (200, 303, 405), there


def test_redirects_hold_under_the_prefix_of_a_proxy(line: Line) -> None:
    for path in ("/", "/review/next"):
        location = httpx.get(f"{line.url}{path}").headers["location"]
        assert urljoin(f"https://plant.example/marks{path}", location) == "https://plant.example/marks/review"


def test_a_prefix_may_be_passed_on_or_taken_off_and_stands_in_links(line: Line, height_map: Path) -> None:
    assert status_of(f"{line.url}/healthz") == status_of(f"{line.url}/marks/healthz") == 200
    assert status_of(f"{line.url}/markshealthz") == 404
    here = line.send_part(height_map)["links"]["self"]
    assert here.startswith("/marks/v1/parts/")
    assert status_of(f"{line.url}{here}") == 200
    assert httpx.get(f"{line.url}/openapi.json").json()["servers"] == [{"url": "/marks"}]


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/metrics", "/v1/jobs", "/parts"])
def test_head_is_answered_as_get_without_a_body(line: Line, path: str) -> None:
    answer = httpx.head(f"{line.url}{path}")
    assert (answer.status_code, answer.content) == (200, b"")
    assert int(answer.headers["content-length"]) > 0


@pytest.mark.parametrize("encoded", ["filename*=utf-8''%D1%84.png", "filename*0=fo; filename*1=to.png"])
def test_a_file_that_is_named_in_the_extended_form_alone_is_read(
    line: Line, tmp_path: Path, encoded: str
) -> None:
    noise = np.random.default_rng(5).integers(90, 160, (30, 60), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "photo.png")
    head = f'Content-Disposition: form-data; name="photo"; {encoded}\r\nContent-Type: image/png\r\n\r\n'
    body = b"--XyZ\r\n" + head.encode() + (tmp_path / "photo.png").read_bytes() + b"\r\n--XyZ--\r\n"
    kind = {"Content-Type": "multipart/form-data; boundary=XyZ"}
    answer = httpx.post(f"{line.url}/v1/parts", content=body, headers=kind, timeout=120.0)
    assert answer.status_code == 201, answer.text


def test_lines_of_fixed_length_that_are_filled_up_with_nul_are_answered(line: Line) -> None:
    with socket.create_connection(("127.0.0.1", line.tcp_port), timeout=120.0) as caller:
        answers = caller.makefile("rb")
        for sent in (b"PING\r\n" + bytes(10), b"PING\r\n" + bytes(10), b"PING\0\0\0\r\n", b"\0\0PING\n\0"):
            caller.sendall(sent)
            assert answers.readline() == b"PONG\r\n", sent
        caller.sendall(b"PI\0NG\r\n")
        assert answers.readline().startswith(b"ERROR;")


def test_a_result_that_the_broker_refuses_waits_is_shown_and_comes_once_it_may(
    line: Line, broker: GuardedBroker, listener: Listener, height_map: Path
) -> None:
    wait_until(lambda: line.ready()["mqtt"] == "works")
    wait_until(lambda: line.in_outbox() == 0.0)  # results of parts before this one have gone
    with broker.allowed("topic write tactile-marks/status"):
        refused = line.send_part(height_map)["id"]
        wait_until(lambda: line.ready()["mqtt"].startswith("refuses 1 result"))
        assert line.ready()["status"] == "degraded"
        assert line.in_outbox() == 1.0
        assert "refuses 1 result" in line.connection("mqtt")
        assert "Not authorized" in httpx.get(f"{line.url}/dashboard").text
        assert len(line.logged("mqtt does not take the result")) == 1
        assert refused not in [one["id"] for one in listener.results()]
    wait_until(lambda: [one["id"] for one in listener.results()].count(refused) == 1)
    wait_until(lambda: line.ready()["mqtt"] == "works")


def test_a_broker_that_is_down_is_shown_and_logged_once(
    line: Line, broker: GuardedBroker, height_map: Path
) -> None:
    wait_until(lambda: line.ready()["mqtt"] == "works")
    before = len(line.logged("mqtt is away"))
    broker.kill()
    waiting = line.send_part(height_map)["id"]
    wait_until(lambda: "cannot be reached since" in line.ready()["mqtt"])
    wait_until(lambda: "1 results wait" in line.ready()["mqtt"])
    assert "cannot be reached" in line.connection("mqtt")
    broker.start()
    with contextlib.closing(Listener(broker.port, user=broker.reader, password=broker.password)) as listener:
        wait_until(lambda: waiting in [one["id"] for one in listener.results()])
    wait_until(lambda: (line.ready()["status"], line.ready()["mqtt"]) == ("ready", "works"))
    assert len(line.logged("mqtt is away")) == before + 1


@pytest.mark.parametrize("limit", ["message_size_limit 500", "max_packet_size 500"])
def test_a_result_that_is_too_large_for_the_broker_waits(
    line: Line, broker: GuardedBroker, height_map: Path, limit: str
) -> None:
    wait_until(lambda: (line.ready()["mqtt"], line.in_outbox()) == ("works", 0.0))
    before = len(line.logged("mqtt does not take the result"))
    with broker.limited(limit):
        line.send_part(height_map)
        wait_until(lambda: line.ready()["mqtt"].startswith("refuses 1 result"))
        assert "1 results wait" in line.ready()["mqtt"]
        assert len(line.logged("mqtt does not take the result")) == before + 1
    wait_until(lambda: (line.ready()["mqtt"], line.in_outbox()) == ("works", 0.0))


# ------------------------------------------------------------------------------------------- OPC UA


async def test_the_same_session_is_answered_while_a_method_runs(line: Line) -> None:
    noise = np.random.default_rng(5).integers(90, 160, (300, 400), dtype=np.uint8)
    Image.fromarray(noise).save(line.keys / "camera" / "P1.png")
    async with line.client() as client:
        space = await client.get_namespace_index(SPACE)
        reader = client.get_node(ua.NodeId("reader", space))
        autoid = await client.get_namespace_index("http://opcfoundation.org/UA/AutoID/")
        status = await reader.get_child([f"{autoid}:DeviceStatus"])
        called = asyncio.create_task(reader.call_method(f"{space}:TriggerPart", "P1"))
        seen = []
        while not called.done():
            seen.append(await status.read_value())
            await asyncio.sleep(0.02)
        assert 3 in seen  # busy
        part_id, _, decision, _, _ = await called
        assert len(part_id) == 26
        assert decision in ("REJECT", "REVIEW", "TOUCH")


async def test_a_part_that_came_over_http_is_shown(line: Line, height_map: Path) -> None:
    part = await asyncio.to_thread(line.send_part, height_map)
    assert part["text"] == "K7"
    async with line.client() as client:
        space = await client.get_namespace_index(SPACE)
        reader = client.get_node(ua.NodeId("reader", space))
        autoid = await client.get_namespace_index("http://opcfoundation.org/UA/AutoID/")
        shown = await (await reader.get_child([f"{autoid}:LastScanData"])).read_value()
        assert getattr(shown, "String", shown) == "K7"


async def test_wrong_passwords_are_logged_and_delay_the_next(line: Line) -> None:
    before = len(line.logged("sign-in denied"))
    clock = asyncio.get_running_loop()
    begin = clock.time()
    for n in range(4):
        with pytest.raises(ua.UaStatusCodeError):
            async with line.client(f"wrong-{n}"):
                pass
    assert clock.time() - begin > 0.25 + 0.5 + 1.0
    assert len(line.logged("sign-in denied to 'line-user' from 127.0.0.1")) > before
    assert "geheim" not in line.service.log
    async with line.client() as client:  # and the right one is let in
        assert await client.get_namespace_index(SPACE)
    plain = Client(line.opcua_url, timeout=100)
    plain.set_user("line-user")
    plain.set_password("geheim")
    with pytest.raises(ua.UaError):  # a password never travels in the clear
        async with plain:
            pass


async def test_silent_callers_keep_nobody_out(line: Line) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(100):
            stack.enter_context(socket.create_connection(("127.0.0.1", line.opcua_port), timeout=10.0))
        async with line.client() as client:
            assert await client.get_namespace_index(SPACE)


def nonsense(url: str) -> Iterator[bytes]:
    """Beginnings of what no client sends."""
    yield b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
    yield bytes(range(3, 60))
    yield hello(url) + message(b"MSGF", bytes(24)) * 50
    yield hello(url) + message(b"OPNF", b"\xff" * 40) * 50
    yield b"MSGF" + struct.pack("<I", 0xFFFFFFFF) + bytes(100)


async def test_nonsense_is_let_go_and_leaves_few_lines(line: Line) -> None:
    before = len(line.service.log)
    for _ in range(20):
        for sent in nonsense(line.opcua_url):
            with (
                contextlib.suppress(OSError),
                socket.create_connection(("127.0.0.1", line.opcua_port)) as caller,
            ):
                caller.settimeout(10.0)
                caller.sendall(sent)
                if sent.startswith(b"MSGF"):
                    continue  # it waits for more, and is closed by the time for signing in
                while caller.recv(4096):
                    pass
    async with line.client() as client:
        assert await client.get_namespace_index(SPACE)
    grown = line.service.log[before:]
    assert len(grown) < 20_000
    assert "Traceback" not in grown
    assert "OPC UA: a connection from 127.0.0.1 was closed: it does not speak OPC UA" in grown
