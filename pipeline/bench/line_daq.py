"""A microcontroller as converter, with text lines over a serial port (docs/pages/reference/daq-line-protocol.md).

host                daq
id              --> tactile-daq 1 8 16 10.0 NAME       version, channels, bits, volts to either side, name
rate 2000       --> ok 2000.00                         the rate that it can keep
start           --> ok
                --> 0 1 -12 7 ... 31 4AF2              number, sync, counts, CRC-16 of the line before it
stop            --> ok 5123                            samples sent
"""

from __future__ import annotations

import binascii
import contextlib
import queue
import threading
import time

import numpy as np

from pipeline.bench.sampling import Record
from pipeline.bench.serial_port import SerialPort
from pipeline.bench.settings import DaqSettings
from whisker_array.scan.stage_error import StageError

_HELLO = "tactile-daq"
_VERSION = 1
_RATE_TOLERANCE = 1e-3
_CABLE_HINT = "see cable, baud and rate_hz of [daq]"


class LineDaq:
    """The converter; its own thread reads lines while the stage moves."""

    def __init__(self, settings: DaqSettings) -> None:
        """Open it. Raises StageError: it does not answer, or cannot keep the rate."""
        self._settings = settings
        self._port = SerialPort(settings.port, baud=settings.baud, what="converter")
        self._lines: queue.SimpleQueue[str | StageError] = queue.SimpleQueue()
        self._closed = False
        self._thread = threading.Thread(target=self._pump, name="converter", daemon=True)
        self._thread.start()
        try:
            self._port.write(b"stop\n")  # the sampling of a dead host may still run
            # a board that boots when its port is opened sends its greeting unasked, or answers late
            _, version, channels, bits, volts, *name = self._hello()
            self.whiskers, self._full = int(channels), 2 ** (int(bits) - 1)
            self._range_v, self._name = float(volts), " ".join(name)
            if int(version) != _VERSION:
                raise StageError(
                    f"the converter speaks version {version}, not {_VERSION}", "update its sketch"
                )
            rate = float(self._ask(f"rate {settings.rate_hz:g}").removeprefix("ok"))
            if abs(rate - settings.rate_hz) > _RATE_TOLERANCE * settings.rate_hz:
                raise StageError(
                    f"the converter samples at {rate:g} Hz, not at {settings.rate_hz:g} Hz",
                    f"set rate_hz = {rate:g} in [daq]",
                )
        except ValueError as error:
            self.close()
            raise StageError("the converter does not speak the line protocol", _CABLE_HINT) from error
        except BaseException:
            self.close()
            raise

    def describe(self) -> str:
        return f"{self._name}, {self.whiskers} channels, {2 * self._full} counts over +-{self._range_v:g} V"

    def start(self) -> None:
        self._ask("start")

    def stop(self) -> Record:
        """Stop. Raises StageError: it was reset, does not answer, or samples are lost or damaged."""
        self._port.write(b"stop\n")
        lines = []
        while not (line := self._next(self._settings.answer_s)).startswith("ok"):
            lines.append(line)
        if any(line.startswith(_HELLO) for line in lines):
            raise StageError("the converter was reset in the middle", "check its power, then scan again")
        good = [text[:-5].split() for text in lines if f"{crc16(text[:-5]):04X}" == text[-4:]]
        sent = int(line.split()[1])
        if len(good) != sent:
            raise StageError(
                f"{sent - len(good)} of {sent} samples are missing: lost on the way, or left out", _CABLE_HINT
            )
        table = np.array(good, dtype=np.int64).reshape(len(good), self.whiskers + 2)
        if (table[:, 0] != np.arange(len(good))).any():
            raise StageError("the converter left samples out: it is too slow", "lower rate_hz of [daq]")
        counts = table[:, 2:]
        return Record(
            volts=counts * (self._range_v / self._full),
            sync=table[:, 1] != 0,
            rate_hz=self._settings.rate_hz,
            clipped=(counts <= -self._full) | (counts >= self._full - 1),
        )

    def close(self) -> None:
        self._closed = True
        self._thread.join(2.0)
        self._port.close()

    def _hello(self) -> list[str]:
        until = time.monotonic() + self._settings.answer_s
        while time.monotonic() < until:
            self._port.write(b"id\n")
            retry_s = time.monotonic() + 0.5
            with contextlib.suppress(queue.Empty):
                while not (line := self._take(retry_s - time.monotonic())).startswith(_HELLO):
                    pass
                time.sleep(0.05)
                while not self._lines.empty():  # answers to earlier questions
                    self._take(0.0)
                return line.split()
        raise StageError("the converter does not answer", _CABLE_HINT)

    def _ask(self, question: str) -> str:
        self._port.write(f"{question}\n".encode())
        until = time.monotonic() + self._settings.answer_s
        while not (line := self._next(until - time.monotonic())).startswith("ok"):
            if line.startswith("error"):
                raise StageError(f"the converter refuses {question!r} ({line})", "see [daq] of the bench")
        return line

    def _next(self, wait_s: float) -> str:
        try:
            return self._take(wait_s)
        except queue.Empty as error:
            raise StageError("the converter does not answer", _CABLE_HINT) from error

    def _take(self, wait_s: float) -> str:
        line = self._lines.get(timeout=max(0.0, wait_s))
        if isinstance(line, StageError):
            self._lines.put(line)  # the next caller gets the error, too
            raise line
        return line

    def _pump(self) -> None:
        try:
            while not self._closed:
                line = self._port.line(wait_s=0.05)
                if line is not None:
                    self._lines.put(line)
        except StageError as error:
            self._lines.put(error)


def crc16(text: str) -> int:
    """CRC-16/XMODEM."""
    return binascii.crc_hqx(text.encode("latin-1"), 0)
