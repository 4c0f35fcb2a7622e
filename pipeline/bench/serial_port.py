"""Lines over a serial port, with timeouts; every failure of the port raises a `StageError`."""

from __future__ import annotations

import re
import time
from collections import deque
from typing import Any

from glyphs.errors import MissingExtraError
from whisker_array.scan.stage_error import StageError

_LOOK_S = 0.02
_WRITE_S = 5.0


class SerialPort:
    """An open port."""

    def __init__(self, name: str, *, baud: int, what: str) -> None:
        """Open the port, or socket://HOST:PORT, exclusively. Raises MissingExtraError (pyserial), StageError."""
        try:
            import serial
        except ModuleNotFoundError as error:
            raise MissingExtraError("a bench on a serial port", "pyserial", "serial") from error
        self._name, self._what = name, what
        alone = {} if "://" in name else {"exclusive": True}
        try:
            self._port: Any = serial.serial_for_url(
                name, baudrate=baud, timeout=_LOOK_S, write_timeout=_WRITE_S, **alone
            )
        except (OSError, ValueError) as error:  # a SerialException is an OSError
            raise StageError(
                f"the {what} cannot be opened at {name} ({getattr(error, 'strerror', None) or error})",
                "check that it is connected, that no other program uses it, and that you have permission",
            ) from error
        self._lines: deque[str] = deque()
        self._rest = b""

    def write(self, data: bytes) -> None:
        """Send all data at once. Raises StageError: the port is gone."""
        try:
            self._port.write(data)
            self._port.flush()
        except (OSError, TypeError) as error:  # pyserial raises TypeError if the port is closed meanwhile
            raise self._gone(error) from error

    def line(self, *, wait_s: float) -> str | None:
        """Return the next line without its line end; None on timeout. Raises StageError: the port is gone."""
        until = time.monotonic() + wait_s
        while not self._lines:
            try:
                data = self._port.read(max(1, self._port.in_waiting))
            except (OSError, TypeError) as error:
                raise self._gone(error) from error
            *lines, self._rest = (self._rest + data).split(b"\n")
            self._lines.extend(text for raw in lines if (text := raw.decode("latin-1").strip()))
            if not self._lines and time.monotonic() >= until:
                return None
        return self._lines.popleft()

    def answer(self, wanted: re.Pattern[str], *, wait_s: float) -> re.Match[str] | None:
        """Read lines until one matches, and return the match; None on timeout. Raises StageError: the port is gone."""
        until = time.monotonic() + wait_s
        while (left := until - time.monotonic()) > 0.0:
            line = self.line(wait_s=left)
            if line is not None and (matched := wanted.match(line)):
                return matched
        return None

    def quiet(self, *, for_s: float = 0.1) -> None:
        """Drop lines until none comes for `for_s` seconds: late answers to earlier questions."""
        while self.line(wait_s=for_s) is not None:
            pass

    def close(self) -> None:
        self._port.close()

    def _gone(self, error: Exception) -> StageError:
        return StageError(f"the {self._what} at {self._name} is gone ({error})", "check its cable and power")
