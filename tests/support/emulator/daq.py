"""A microcontroller with the line protocol, sampling an emulated world by that world's clock."""

from __future__ import annotations

import math

import numpy as np

from pipeline.bench.line_daq import crc16
from tests.support.emulator.firmware import Device
from tests.support.emulator.world import Volts, World

_BITS = 16


class EmulatedDaq(Device):
    """The converter.

    Attributes:
        lose: the next so many samples are lost on the way.
    """

    def __init__(
        self, world: World, *, whiskers: int, noise_v: float = 0.0, range_v: float = 10.0, seed: int = 0
    ) -> None:
        super().__init__("emulated converter")
        self.lose = 0
        self._world, self._whiskers, self._noise_v = world, whiskers, noise_v
        self._range_v, self._rng = range_v, np.random.default_rng(seed)
        self._rate_hz, self._sent, self._begun_s, self._on = 1000.0, 0, 0.0, False
        world.sampler = self._sample

    def reset_button(self) -> None:
        """It forgets what it was at."""
        with self._world.lock:
            self._on = False
            self.boot()

    def boot(self) -> None:
        """What it is, in a line."""
        self.terminal.say(f"tactile-daq 1 {self._whiskers} {_BITS} {self._range_v:g} emulated")

    def _sample(self, begin_s: float, end_s: float, touching: bool, volts: Volts) -> None:
        if not self._on:
            return
        first, last = (math.ceil((t - self._begun_s) * self._rate_hz - 1e-9) for t in (begin_s, end_s))
        if last <= first:
            return
        times = self._begun_s + np.arange(first, last) / self._rate_hz - begin_s
        rows = volts(times)
        full = 2 ** (_BITS - 1)
        counts = np.rint(
            (rows + self._noise_v * self._rng.standard_normal(rows.shape)) * (full / self._range_v)
        )
        lines = []
        for row in np.clip(counts, -full, full - 1).astype(int).tolist():
            body = f"{self._sent} {int(touching)} {' '.join(map(str, row))}"
            self._sent += 1
            if self.lose:
                self.lose -= 1
            else:
                lines.append(f"{body} {crc16(body):04X}\n")
        self.terminal.write("".join(lines).encode())

    def work(self) -> None:
        received = b""
        while not self.ended.is_set():
            *lines, received = (received + self.terminal.read(wait_s=0.05)).split(b"\n")
            for line in lines:
                with self._world.lock:
                    self._answer(line.decode("latin-1").strip())

    def _answer(self, line: str) -> None:
        word, _, value = line.partition(" ")
        if word == "id":
            self.boot()
        elif word == "rate":
            self._rate_hz = float(value)
            self.terminal.say(f"ok {self._rate_hz:.2f}")
        elif word == "start":
            self._sent, self._begun_s, self._on = 0, self._world.now_s, True
            self.terminal.say("ok")
        elif word == "stop":
            self._on = False
            self.terminal.say(f"ok {self._sent}")
        else:
            self.terminal.say(f"error no such command: {word}")
