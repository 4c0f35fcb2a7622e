"""A plant around a service: parts on a stage, a camera's folder, and a receiver of results."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx

from tests.contract.front_doors import RunningService, run_service, synth, truth_of
from tests.support.waiting import free_port

FORMAT = "A99"
READING = ("--format", FORMAT, "--font", "gothic", "--height-mm", "4", "--jobs", "1", "--tokens", "off")


@dataclass
class Receiver:
    """A web server that results are posted to.

    Attributes:
        url: its address.
        bodies: the JSON of every post, in the order of arrival.
        status: its answer to the next posts.
    """

    url: str = ""
    bodies: list[dict[str, object]] = field(default_factory=list)
    status: int = 204

    def of(self, part_id: str) -> list[dict[str, object]]:
        """The posts about one part."""
        return [body for body in self.bodies if body.get("id") == part_id]


@contextlib.contextmanager
def receive() -> Iterator[Receiver]:
    """Receive posts on a free port until the block is left."""
    receiver = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            if receiver.status < 300:
                receiver.bodies.append(json.loads(body))
            self.send_response(receiver.status)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    receiver.url = f"http://127.0.0.1:{server.server_address[1]}/results"
    try:
        yield receiver
    finally:
        server.shutdown()
        server.server_close()


@dataclass(frozen=True)
class Plant:
    """A service with all that stands around it.

    Attributes:
        service: the running service; its TCP port is `tcp_port`.
        parts: folder of `clean.npz`, `clean.png`, `filthy.npz`, `filthy.png`: the stage's and the camera's.
        watched: folder that the service watches.
        receiver: where its webhook goes.
        truth: text of the part by name.
    """

    service: RunningService
    tcp_port: int
    parts: Path
    watched: Path
    receiver: Receiver
    truth: dict[str, str]

    def client(self) -> httpx.Client:
        """A client of the service."""
        return httpx.Client(base_url=self.service.url, timeout=60.0)

    def photo(self, name: str) -> dict[str, tuple[str, bytes]]:
        """A photograph as a form sends it."""
        return {"photo": (f"{name}.png", (self.parts / f"{name}.png").read_bytes())}

    def scan(self, name: str) -> dict[str, tuple[str, bytes]]:
        """A height map as a form sends it."""
        return {"scan": (f"{name}.npz", (self.parts / f"{name}.npz").read_bytes())}


@contextlib.contextmanager
def run_plant(folder: Path) -> Iterator[Plant]:
    """Make two parts and run a service with every door open."""
    parts, watched = folder / "parts", folder / "watched"
    parts.mkdir(parents=True)
    watched.mkdir()
    truth = {}
    for name, dirt, seed in (("clean", "0", "21"), ("filthy", "0.9", "24")):
        made = synth(folder / name, FORMAT, "--height-mm", "4", "--seed", seed, "--dirt", dirt)
        truth[name] = truth_of(made)["part-000"]
        for suffix in (".npz", ".png"):
            (made / f"part-000{suffix}").rename(parts / f"{name}{suffix}")
    port = free_port()
    with receive() as receiver:
        doors = ("--tcp.port", str(port), "--webhook.url", receiver.url, "--watch.folder", str(watched))
        doors += ("--watch.every-s", "0.2", "--stage.folder", str(parts), "--camera.folder", str(parts))
        with run_service(folder / "service", *READING, *doors) as service:
            yield Plant(service, port, parts, watched, receiver, truth)
