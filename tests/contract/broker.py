"""A mosquitto of the test's own, and a client that listens to it."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from tests.contract.front_doors import wait_until
from tests.support.programs import program


def free_port() -> int:
    """A port of the loopback address that is free now."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


SERVICE_OPTIONS = ("--jobs", "1", "--format", "A9", "--font", "gothic", "--height-mm", "4", "--tokens", "off")
USER, PASSWORD = "marks", "geheim"
READER = "reader"


class Broker:
    """A broker that can be stopped and started on its port; `rights` are lines of its ACL for the user marks."""

    def __init__(self, folder: Path, *, rights: str = "topic readwrite #") -> None:
        folder.mkdir()
        self.port, self._folder, self._rights = free_port(), folder, rights
        self.url = f"mqtt://{USER}:{PASSWORD}@127.0.0.1:{self.port}"
        for user, new in ((USER, ("-c",)), (READER, ())):
            command = [program("mosquitto_passwd"), "-b", *new, str(folder / "passwords"), user, PASSWORD]
            subprocess.run(command, check=True, capture_output=True)
        self._write_rights(rights)
        (folder / "mosquitto.conf").write_text(
            f"listener {self.port} 127.0.0.1\nuser root\nallow_anonymous false\n"
            f"password_file {folder / 'passwords'}\nacl_file {folder / 'acl'}\n"
        )
        self._process: subprocess.Popen[bytes] | None = None
        self.start()

    def start(self) -> None:
        """Start it and wait until it listens."""
        command = [program("mosquitto"), "-c", str(self._folder / "mosquitto.conf")]
        with (self._folder / "log").open("ab") as log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log)
        wait_until(self._listens, self._process)

    def stop(self) -> None:
        """Kill it."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    @contextlib.contextmanager
    def allowed(self, rights: str) -> Iterator[None]:
        """Let the user marks do no more than `rights` until the block is left, while the broker runs."""
        self._change_rights(rights)
        try:
            yield
        finally:
            self._change_rights(self._rights)

    @contextlib.contextmanager
    def limited(self, setting: str) -> Iterator[None]:
        """Run it with one more line in its settings until the block is left; it starts anew before and after."""
        kept = (self._folder / "mosquitto.conf").read_text()
        self._restart(f"{kept}{setting}\n")
        try:
            yield
        finally:
            self._restart(kept)

    def _restart(self, settings: str) -> None:
        self.stop()
        (self._folder / "mosquitto.conf").write_text(settings)
        self.start()

    def _change_rights(self, rights: str) -> None:
        assert self._process is not None
        self._write_rights(rights)
        self._process.send_signal(signal.SIGHUP)

    def _write_rights(self, rights: str) -> None:
        (self._folder / "acl").write_text(f"user {READER}\ntopic readwrite #\nuser {USER}\n{rights}\n")

    def _listens(self) -> bool:
        with socket.socket() as one:
            one.settimeout(0.5)
            return one.connect_ex(("127.0.0.1", self.port)) == 0


class Listener:
    """Hears everything that a broker passes on."""

    def __init__(self, broker: Broker) -> None:
        self.messages: list[tuple[str, bytes]] = []
        subscribed = threading.Event()
        self._client = paho.Client(CallbackAPIVersion.VERSION2)
        self._client.username_pw_set(READER, PASSWORD)
        self._client.on_connect = lambda client, *_: client.subscribe("#", qos=1)
        self._client.on_subscribe = lambda *_: subscribed.set()
        self._client.on_message = lambda _c, _d, m: self.messages.append((m.topic, m.payload))
        self._client.reconnect_delay_set(1, 1)
        self._client.connect("127.0.0.1", broker.port)
        self._client.loop_start()
        assert subscribed.wait(30.0)

    def results(self) -> list[dict[str, Any]]:
        """The results, in order."""
        return [json.loads(payload) for topic, payload in self.messages if topic.endswith("/result")]

    def statuses(self) -> list[str]:
        """The values of the status, in order."""
        return [payload.decode() for topic, payload in self.messages if topic.endswith("/status")]

    def close(self) -> None:
        """Stop listening."""
        self._client.disconnect()
        self._client.loop_stop()
