"""A real mosquitto, and whoever listens to it."""

from __future__ import annotations

import json
import signal
import subprocess
import threading
from pathlib import Path

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from tests.support.line_fakes import free_port, until_now


class Broker:
    """A mosquitto of the test's own, that can be killed and started again on its port."""

    def __init__(self, folder: Path, program: str, settings: str = "") -> None:
        self.port = free_port()
        self._program, self._folder = program, folder
        self._config = folder / "mosquitto.conf"
        self._config.write_text(
            f"listener {self.port} 127.0.0.1\npersistence false\nuser root\nlog_type all\n"
            + (settings or "allow_anonymous true\n")
        )
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        with (self._folder / "broker.log").open("ab") as log:
            self._process = subprocess.Popen([self._program, "-c", str(self._config)], stdout=log, stderr=log)
        until_now(self._listens, why="for the broker")

    def _listens(self) -> bool:
        import socket

        assert self._process is not None
        assert self._process.poll() is None, (self._folder / "broker.log").read_text()
        with socket.socket() as one:
            one.settimeout(0.5)
            return one.connect_ex(("127.0.0.1", self.port)) == 0

    def kill(self, how: int = signal.SIGKILL) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            if how == signal.SIGKILL:
                self._process.wait()
                self._process = None

    @property
    def log(self) -> str:
        return (self._folder / "broker.log").read_text()


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
        assert self.subscribed.wait(10.0)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def results(self) -> list[dict[str, object]]:
        return [json.loads(body) for topic, body, _ in self.messages if topic.endswith("/result")]

    def statuses(self, prefix: str = "tactile-marks") -> list[str]:
        return [body.decode() for topic, body, _ in self.messages if topic == f"{prefix}/status"]
