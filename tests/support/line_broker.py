"""A real mosquitto, a web server that is posted to, frames of OPC UA, and certificates: what a service talks to."""

from __future__ import annotations

import contextlib
import datetime as dt
import ipaddress
import json
import signal
import struct
import subprocess
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from tests.support.waiting import free_port, listens, program, wait_until

# ------------------------------------------------------------------------------------------------------- line broker


class Broker:
    """A mosquitto that can be killed and started again on its port."""

    def __init__(self, folder: Path, settings: str = "allow_anonymous true\n") -> None:
        self.port, self._folder, self._config = free_port(), folder, folder / "mosquitto.conf"
        self._config.write_text(
            f"listener {self.port} 127.0.0.1\npersistence false\nuser root\nlog_type all\n{settings}"
        )
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it listens."""
        with (self._folder / "broker.log").open("ab") as log:
            self._process = subprocess.Popen(
                [program("mosquitto"), "-c", str(self._config)], stdout=log, stderr=log
            )
        wait_until(lambda: listens(self.port), self._process, why="for the broker")

    def kill(self, how: signal.Signals = signal.SIGKILL) -> None:
        """Kill it, unless another signal is named."""
        if self._process is not None:
            self._process.send_signal(how)
            if how == signal.SIGKILL:
                self._process.wait()
                self._process = None

    @contextlib.contextmanager
    def limited(self, setting: str) -> Iterator[None]:
        """Run it with one more line in its settings until the block is left; it starts anew before and after."""
        kept = self._config.read_text()
        self._restart(f"{kept}{setting}\n")
        try:
            yield
        finally:
            self._restart(kept)

    def _restart(self, settings: str) -> None:
        self.kill()
        self._config.write_text(settings)
        self.start()

    @property
    def log(self) -> str:
        """What it has logged so far."""
        return (self._folder / "broker.log").read_text()


class GuardedBroker(Broker):
    """Asks for a password; the users marks and reader may do everything."""

    user, password, reader = "marks", "geheim", "reader"

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        passwords, self._acl = folder / "passwords", folder / "acl"
        for user, new in ((self.user, ("-c",)), (self.reader, ())):
            command = [program("mosquitto_passwd"), "-b", *new, str(passwords), user, self.password]
            subprocess.run(command, check=True, capture_output=True)
        self._write_rights()
        super().__init__(folder, f"allow_anonymous false\npassword_file {passwords}\nacl_file {self._acl}\n")
        self.url = f"mqtt://{self.user}:{self.password}@127.0.0.1:{self.port}"

    @contextlib.contextmanager
    def allowed(self, rights: str) -> Iterator[None]:
        """Let the user marks do no more than `rights` until the block is left, while the broker runs."""
        self._write_rights(rights)
        self.kill(signal.SIGHUP)
        try:
            yield
        finally:
            self._write_rights()
            self.kill(signal.SIGHUP)

    def listener(self) -> Listener:
        """One who may hear everything."""
        return Listener(self.port, user=self.reader, password=self.password)

    def _write_rights(self, rights: str = "topic readwrite #") -> None:
        self._acl.write_text(f"user {self.reader}\ntopic readwrite #\nuser {self.user}\n{rights}\n")


class Listener:
    """Subscribes to everything, by paho's own reconnecting client.

    With QoS 0: it then answers nothing, so what a broker sent before it was killed is read to the end, and a broker
    sends before it acknowledges. What is acknowledged while it listens is so what it gets.
    """

    def __init__(self, port: int, *, user: str = "", password: str = "") -> None:
        self.messages: list[tuple[str, bytes, bool]] = []
        self.subscribed = threading.Event()
        self._client = paho.Client(CallbackAPIVersion.VERSION2)
        self._client.reconnect_delay_set(1, 1)
        if user:
            self._client.username_pw_set(user, password)
        self._client.on_connect = lambda client, *_: client.subscribe("#", qos=0)
        self._client.on_subscribe = lambda *_: self.subscribed.set()
        self._client.on_disconnect = lambda *_: self.subscribed.clear()
        self._client.on_message = lambda _c, _d, m: self.messages.append((m.topic, m.payload, m.retain))
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        assert self.subscribed.wait(30.0)

    def close(self) -> None:
        """Stop listening."""
        self._client.disconnect()
        self._client.loop_stop()

    def results(self) -> list[dict[str, Any]]:
        """The results, in order."""
        return [json.loads(body) for topic, body, _ in self.messages if topic.endswith("/result")]

    def statuses(self, prefix: str = "tactile-marks") -> list[str]:
        """The values of the status, in order."""
        return [body.decode() for topic, body, _ in self.messages if topic == f"{prefix}/status"]


# ---------------------------------------------------------------------------------------------------------- web hook


@contextlib.contextmanager
def web_hook(take: Callable[[str, bytes], int]) -> Iterator[str]:
    """The address of a server that answers every post with the status that `take` gives for its path and body."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            status = take(self.path.strip("/"), self.rfile.read(int(self.headers["content-length"])))
            self.send_response(status)
            self.send_header("content-length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: object) -> None:
            """Say nothing: the sender was killed."""

    server = Server(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()


# ------------------------------------------------------------------------------------------------------ opcua frames


def message(kind: bytes, body: bytes) -> bytes:
    """A frame: its kind, its length, what it holds."""
    return kind + struct.pack("<I", 8 + len(body)) + body


def hello(url: str) -> bytes:
    """The first frame of a connection."""
    return message(b"HELF", struct.pack("<IIIIII", 0, 65536, 65536, 0, 0, len(url)) + url.encode())


# ------------------------------------------------------------------------------------------------------- self signed


def certificates(folder: Path, name: str) -> tuple[Path, Path]:
    """A certificate of its own authority for 127.0.0.1, and its key."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    who = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    now = dt.datetime.now(dt.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(who)
        .issuer_name(who)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - dt.timedelta(days=1))
        .not_valid_after(now + dt.timedelta(days=1))
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), critical=False
        )
        .sign(key, hashes.SHA256())
    )
    certificate, private = folder / f"{name}.crt", folder / f"{name}.key"
    certificate.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    private.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )
    return certificate, private
