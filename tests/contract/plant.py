"""A plant around a service: parts on a stage, a camera's folder, receivers of results, a broker, OPC UA clients."""

from __future__ import annotations

import contextlib
import html
import json
import os
import re
import subprocess
import threading
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from asyncua import Client
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from tests.contract.front_doors import RunningService, environment, run_service, synth, truth_of
from tests.support.line_broker import GuardedBroker, web_hook
from tests.support.waiting import free_port

FORMAT = "A99"


@dataclass
class Receiver:
    """A web server that results are posted to.

    Attributes:
        bodies: the JSON of every post, in the order of arrival.
        status: its answer to the next posts.
    """

    bodies: list[dict[str, object]] = field(default_factory=list)
    status: int = 204

    def take(self, _: str, body: bytes) -> int:
        """The status to answer with."""
        if self.status < 300:
            self.bodies.append(json.loads(body))
        return self.status

    def of(self, part_id: str) -> list[dict[str, object]]:
        """The posts about one part."""
        return [body for body in self.bodies if body.get("id") == part_id]


@dataclass(frozen=True)
class Plant:
    """A service behind a proxy's prefix with every door open, and all that stands around it.

    Attributes:
        service: the running service.
        tcp_port: of its triggers.
        opcua_port: of its OPC UA server, which asks for a password.
        keys: folder of the certificates and keys of that server and of its clients.
        parts: folder of the stage and the camera: `clean.npz`, `clean.png`, `filthy.png`, `filthy.npz`, which has been
            washed.
        watched: folder that the service watches.
        receiver: where its webhook goes.
        broker: where its MQTT results go.
        truth: text of the part by name.
    """

    service: RunningService
    tcp_port: int
    opcua_port: int
    keys: Path
    parts: Path
    watched: Path
    receiver: Receiver
    broker: GuardedBroker
    truth: dict[str, str]

    def client(self) -> httpx.Client:
        """A client of the service."""
        return httpx.Client(base_url=self.url, timeout=120.0)

    def photo(self, name: str) -> dict[str, tuple[str, bytes]]:
        """A photograph as a form sends it."""
        return {"photo": (f"{name}.png", (self.parts / f"{name}.png").read_bytes())}

    def scan(self, name: str) -> dict[str, tuple[str, bytes]]:
        """A height map as a form sends it."""
        return {"scan": (f"{name}.npz", (self.parts / f"{name}.npz").read_bytes())}

    @contextlib.contextmanager
    def camera_saving(self, name: str) -> Iterator[None]:
        """A camera that saves its picture of a part anew, every half second until the block is left."""
        path, ended = self.parts / f"{name}.png", threading.Event()

        def save() -> None:
            while not ended.wait(0.5):
                os.utime(path)

        saving = threading.Thread(target=save)
        saving.start()
        try:
            yield
        finally:
            ended.set()
            saving.join()

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

    def send_part(self) -> dict[str, Any]:
        """Send the scan of the clean part; the answer."""
        answer = httpx.post(f"{self.url}/v1/parts", files=self.scan("clean"), timeout=120.0)
        assert answer.status_code == 201, answer.text
        part: dict[str, Any] = answer.json()
        return part

    @contextlib.asynccontextmanager
    async def opcua_client(self, password: str = "geheim") -> AsyncIterator[Client]:
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


@contextlib.contextmanager
def run_plant(folder: Path) -> Iterator[Plant]:
    """Make two parts and run a service with every door open."""
    parts, watched, keys = (folder / name for name in ("parts", "watched", "keys"))
    for made in (parts, watched, keys):
        made.mkdir()
    truth = {}
    for name, kinds, *how in (
        ("clean", (".npz", ".png"), "--seed", "21"),
        ("filthy", (".png",), "--seed", "24", "--dirt", "0.9"),
        ("filthy", (".npz",), "--seed", "24", "--no-photo"),
    ):
        stamped = synth(folder / f"{name}{kinds[0]}", FORMAT, "--height-mm", "4", *how)
        truth[name] = truth_of(stamped)["part-000"]
        for kind in kinds:
            (stamped / f"part-000{kind}").rename(parts / f"{name}{kind}")
    make_certificate(keys, "server", "urn:tactile-marks:server")
    make_certificate(keys, "own", "urn:tests")
    port, opcua_port, broker = free_port(), free_port(), GuardedBroker(folder)
    users = environment(TACTILE_MARKS_SERVICE_OPCUA_USERS='{"line-user": "geheim"}')
    broker.start()
    with contextlib.ExitStack() as stack:
        stack.callback(broker.kill)
        receiver = Receiver()
        hook = stack.enter_context(web_hook(receiver.take))
        options = (
            f"--jobs 1 --format {FORMAT} --font gothic --height-mm 4 --tokens off --root-path /marks"
            f" --tcp.port {port} --webhook.url {hook}/results --mqtt.url {broker.url}"
            f" --watch.folder {watched} --stage.device {parts} --camera.device {parts}"
            " --device-timeout-s 4 --mqtt.triggers"
            f" --opcua.port {opcua_port} --opcua.certificate {keys}/server.der --opcua.key {keys}/server.pem"
        )
        service = stack.enter_context(run_service(folder / "service", *options.split(), env=users))
        yield Plant(service, port, opcua_port, keys, parts, watched, receiver, broker, truth)
