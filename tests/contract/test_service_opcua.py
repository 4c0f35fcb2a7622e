"""The OPC UA server, by asyncua's client and by callers who never sign in."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import shutil
import socket
import struct
import subprocess
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from tests.contract.broker import SERVICE_OPTIONS, free_port
from tests.contract.front_doors import RunningService, environment, run_service

pytestmark = pytest.mark.anyio
SPACE = "urn:tactile-marks:reader"


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


@dataclass(frozen=True)
class Line:
    """A service whose OPC UA server asks for a password, and the files of its clients."""

    service: RunningService
    port: int
    keys: Path

    @property
    def url(self) -> str:
        return f"opc.tcp://127.0.0.1:{self.port}/tactile-marks"

    def logged(self, words: str) -> list[str]:
        lines = [json.loads(one) for one in self.service.log.splitlines() if one.startswith("{")]
        return [one["event"] for one in lines if words in one["event"]]

    @contextlib.asynccontextmanager
    async def client(self, password: str = "geheim") -> AsyncIterator[Client]:
        """A client that has signed in."""
        one = Client(self.url, timeout=100)
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
def line(tmp_path_factory: pytest.TempPathFactory, height_map: Path) -> Iterator[Line]:
    folder = tmp_path_factory.mktemp("opcua")
    make_certificate(folder, "server", "urn:tactile-marks:server")
    make_certificate(folder, "own", "urn:tests")
    (folder / "stage").mkdir()
    shutil.copy(height_map, folder / "stage" / "K7.npz")
    port = free_port()
    options = (
        "--opcua.port",
        str(port),
        "--stage.folder",
        str(folder / "stage"),
        "--camera.folder",
        str(folder / "camera"),
    )
    keys = ("--opcua.certificate", str(folder / "server.der"), "--opcua.key", str(folder / "server.pem"))
    (folder / "camera").mkdir()
    users = environment(TACTILE_MARKS_SERVICE_OPCUA_USERS='{"line-user": "geheim"}')
    with run_service(folder / "service", *SERVICE_OPTIONS, *options, *keys, env=users) as service:
        yield Line(service, port, folder)


@pytest.fixture(autouse=True)
def _quiet_client(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL, logger="asyncua")


def save_photo(folder: Path, name: str) -> None:
    import numpy as np
    from PIL import Image

    noise = np.random.default_rng(5).integers(90, 160, (300, 400), dtype=np.uint8)
    Image.fromarray(noise).save(folder / f"{name}.png")


async def test_the_same_session_is_answered_while_a_method_runs(line: Line) -> None:
    save_photo(line.keys / "camera", "P1")
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
    scan = {"scan": ("K7.npz", height_map.read_bytes())}
    answer = await asyncio.to_thread(httpx.post, f"{line.service.url}/v1/parts", files=scan, timeout=120.0)
    assert answer.json()["text"] == "K7"
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
    plain = Client(line.url, timeout=100)
    plain.set_user("line-user")
    plain.set_password("geheim")
    with pytest.raises(ua.UaError):  # a password never travels in the clear
        async with plain:
            pass


async def test_silent_callers_keep_nobody_out(line: Line) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(100):
            stack.enter_context(socket.create_connection(("127.0.0.1", line.port), timeout=10.0))
        async with line.client() as client:
            assert await client.get_namespace_index(SPACE)


def hello(url: str) -> bytes:
    body = struct.pack("<IIIIII", 0, 65536, 65536, 0, 0, len(url)) + url.encode()
    return b"HELF" + struct.pack("<I", 8 + len(body)) + body


def message(kind: bytes, body: bytes) -> bytes:
    return kind + struct.pack("<I", 8 + len(body)) + body


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
        for sent in nonsense(line.url):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", line.port)) as caller:
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
