"""Lines over a serial port, each within its time; whatever goes wrong with the port is a `StageError`."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

from glyphs.errors import MissingExtraError
from whisker_array.scan.stage_error import StageError

_LOOK_S = 0.02
_WRITE_S = 5.0


class SerialPort:
    """A port that is open."""

    def __init__(self, name: str, *, baud: int, what: str) -> None:
        """Open it, for nobody else.

        Args:
            name: of the port, or socket://HOST:PORT.
            baud: of a serial port.
            what: hangs on it, for messages.

        Raises:
            MissingExtraError: pyserial is not installed.
            StageError: it cannot be opened.
        """
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
                "see that it is connected, that no other program has it, and that you may use it",
            ) from error
        self._lines: deque[str] = deque()
        self._rest = b""

    def write(self, data: bytes) -> None:
        """Send all of it at once.

        Raises:
            StageError: it is gone.
        """
        try:
            self._port.write(data)
            self._port.flush()
        except (OSError, TypeError) as error:  # pyserial's own of a port that is closed meanwhile
            raise self._gone(error) from error

    def line(self, *, wait_s: float) -> str | None:
        """The next line without its end; None where none has come in that time.

        Raises:
            StageError: it is gone.
        """
        until = time.monotonic() + wait_s
        while not self._lines:
            try:
                data = self._port.read(max(1, self._port.in_waiting))
            except (OSError, TypeError) as error:
                raise self._gone(error) from error
            *lines, self._rest = (self._rest + data).split(b"\n")
            self._lines.extend(text for one in lines if (text := one.decode("latin-1").strip()))
            if not self._lines and time.monotonic() >= until:
                return None
        return self._lines.popleft()

    def quiet(self, *, for_s: float = 0.1) -> list[str]:
        """What still comes until nothing has come for so long: late answers to earlier questions."""
        late = []
        while (line := self.line(wait_s=for_s)) is not None:
            late.append(line)
        return late

    def close(self) -> None:
        """Let it go; closing again does nothing."""
        self._port.close()

    def _gone(self, error: Exception) -> StageError:
        return StageError(f"the {self._what} at {self._name} is gone ({error})", "see to its cable and power")
