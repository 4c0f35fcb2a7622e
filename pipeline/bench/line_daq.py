"""A microcontroller as a converter, by lines over a serial port (docs/pages/reference/daq-line-protocol.md).

host                daq
id              --> tactile-daq 1 8 16 10.0 NAME       version, channels, bits, volts to either side, name
rate 2000       --> ok 2000.00                         the rate that it can keep
start           --> ok
                --> 0 1 -12 7 ... 31 4AF2              number, sync, counts, CRC-16 of what stands before it
stop            --> ok 5123                            samples sent
"""

from __future__ import annotations

import binascii
import threading
import time
from collections import deque

import numpy as np

from pipeline.bench.daq import Record
from pipeline.bench.serial_port import SerialPort
from pipeline.bench.settings import DaqSettings
from whisker_array.scan.stage_error import StageError

_HELLO = "tactile-daq"
_VERSION = 1
_RATE_TOLERANCE = 1e-3
_CABLE_HINT = "see cable, baud and rate_hz of [daq]"


class LineDaq:
    """The converter; a thread of its own takes what comes while the stage moves."""

    def __init__(self, settings: DaqSettings) -> None:
        """Open it.

        Raises:
            StageError: it does not answer, or cannot keep the rate.
        """
        self._settings = settings
        self._port = SerialPort(settings.port, baud=settings.baud, what="converter")
        self._lines: deque[str] = deque()
        self._trouble: StageError | None = None
        self._come = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._pump, name="converter", daemon=True)
        self._thread.start()
        try:
            self._port.write(b"stop\n")  # a dead host's may still run
            # a board that boots when its port is opened says hello by itself, or answers late
            hello = self._hello()
            version, channels, bits, self._range_v = (
                int(hello[1]),
                int(hello[2]),
                int(hello[3]),
                float(hello[4]),
            )
            self.whiskers, self._full, self._name = channels, 2 ** (bits - 1), " ".join(hello[5:])
            if version != _VERSION:
                raise StageError(
                    f"the converter speaks version {version}, not {_VERSION}", "update its sketch"
                )
            rate = float(self._asked(f"rate {settings.rate_hz:g}").removeprefix("ok"))
            if abs(rate - settings.rate_hz) > _RATE_TOLERANCE * settings.rate_hz:
                raise StageError(
                    f"the converter samples at {rate:g} Hz, not at {settings.rate_hz:g} Hz",
                    f"set rate_hz = {rate:g} in [daq]",
                )
        except (ValueError, IndexError) as error:
            self.close()
            raise StageError("the converter does not speak the line protocol", _CABLE_HINT) from error
        except BaseException:
            self.close()
            raise

    def describe(self) -> str:
        """Its name and size."""
        return f"{self._name}, {self.whiskers} channels, {2 * self._full} counts over +-{self._range_v:g} V"

    def start(self) -> None:
        """Begin.

        Raises:
            StageError: it does not answer.
        """
        self._asked("start")

    def stop(self) -> Record:
        """End, with every sample checked and none missing.

        Raises:
            StageError: it was reset, is silent, or samples are lost or spoilt.
        """
        self._port.write(b"stop\n")
        lines, was_reset, until = [], False, time.monotonic() + self._settings.answer_s
        while not (line := self._next(until)).startswith("ok"):
            was_reset = was_reset or line.startswith(_HELLO)
            lines.append(line)
            until = time.monotonic() + self._settings.answer_s
        if was_reset:
            raise StageError("the converter was reset in the middle", "see to its power, then scan again")
        good = [body for one in lines if _whole(one, body := one[:-5])]
        sent = int(line.split()[1])
        if len(good) != sent:
            raise StageError(
                f"{sent - len(good)} of {sent} samples are missing: lost on the way, or left out", _CABLE_HINT
            )
        table = np.array([one.split() for one in good], dtype=np.int64).reshape(len(good), self.whiskers + 2)
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
        """Let the port go."""
        self._closed = True
        self._thread.join(2.0)
        self._port.close()

    def _hello(self) -> list[str]:
        until = time.monotonic() + self._settings.answer_s
        while time.monotonic() < until:
            self._port.write(b"id\n")
            asked = time.monotonic() + 0.5
            try:
                while not (line := self._next(asked)).startswith(_HELLO):
                    pass
            except StageError:
                if self._trouble is not None:
                    raise
                continue
            time.sleep(0.05)
            with self._come:
                self._lines.clear()
            return line.split()
        raise StageError("the converter does not answer", _CABLE_HINT)

    def _asked(self, question: str) -> str:
        """Its answer to a question.

        Raises:
            StageError: silence, or a refusal.
        """
        self._port.write(f"{question}\n".encode())
        until = time.monotonic() + self._settings.answer_s
        while True:
            line = self._next(until)
            if line.startswith("error"):
                raise StageError(f"the converter refuses {question!r} ({line})", "see [daq] of the bench")
            if line.startswith("ok"):
                return line

    def _next(self, until: float) -> str:
        with self._come:
            while not self._lines:
                if self._trouble is not None:
                    raise self._trouble
                if not self._come.wait(max(0.0, until - time.monotonic())) and not self._lines:
                    raise StageError("the converter does not answer", _CABLE_HINT)
            return self._lines.popleft()

    def _pump(self) -> None:
        while not self._closed:
            try:
                line = self._port.line(wait_s=0.05)
            except StageError as error:
                with self._come:
                    self._trouble = error
                    self._come.notify_all()
                return
            if line is not None:
                with self._come:
                    self._lines.append(line)
                    self._come.notify_all()


def _whole(line: str, body: str) -> bool:
    """Whether a sample's line has come as it was sent."""
    return f"{crc16(body):04X}" == line[-4:]


def crc16(text: str) -> int:
    """CRC-16/XMODEM."""
    return binascii.crc_hqx(text.encode("latin-1"), 0)
