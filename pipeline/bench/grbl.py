"""GRBL 1.1 and its kin (grblHAL, FluidNC): character counting, status reports, feed hold and soft reset.

host  G53G1Z-31.000F300\\nM8\\n... --127 bytes in flight--> firmware
      <-- ok | error:N                                     one a line, in order
  ?   <-- <Run|MPos:1.000,2.000,-3.000|FS:500,0>           at any time
  !   feed hold;  0x18  soft reset --> Grbl 1.1h ['$' for help]
      <-- ALARM:N                                          locked until $X or $H

The coolant output (M8, M9) is the spare output that tells the converter of touch: GRBL sets it when the moves before it
have ended.
"""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Sequence

from pipeline.bench.controller import LOOK_S, Controller

_ROOM = 127
_STATUS = re.compile(r"<(\w+)(?::\d+)?\|(?:.*\|)?MPos:([-\d.]+),([-\d.]+),([-\d.]+)")
_ALARMS = {
    "1": "a limit switch was hit",
    "2": "a move would have left the soft limits",
    "3": "it was reset while it moved",
    "8": "homing could not leave a limit switch",
    "9": "homing found no limit switch",
}
_MOVING = ("Run", "Jog", "Home")
_BAD = ("Alarm", "Hold", "Door", "Check", "Sleep")


class Grbl(Controller):
    """A stage under GRBL."""

    absolute = "G53"
    settle = ("G4P0.01",)
    touching = ("M8",)
    not_touching = ("M9",)

    def dwell(self, seconds: float) -> str:
        """G4 in seconds."""
        return f"G4P{seconds:.3f}"

    def connect(self) -> str:
        """Wait until what it is at has ended, then reset it.

        Raises:
            StageError: silent, or no GRBL.
        """
        self.lost = True
        until = time.monotonic() + 2.0 * self.settings.answer_s
        while True:  # a dead host's last pass ends with its lift; a board that boots is silent at first
            state = self._state(wait_s=LOOK_S)
            if time.monotonic() > until:
                break
            if state is None or state in _MOVING:
                until = until if state is None else time.monotonic() + self.settings.answer_s
                continue
            break
        return self._reset()

    def home(self) -> None:
        """$H: GRBL lifts z first.

        Raises:
            StageError: it cannot.
        """
        if self.lost:
            self.connect()
        self.lost = True
        self._taken(["$H"], until=time.monotonic() + self.settings.home_s, silent_s=self.settings.home_s)
        self._taken(["G21G90G94"], until=self.waiting_until(0.0), silent_s=self.settings.answer_s)
        self.lost = False

    def place_mm(self) -> tuple[float, float, float]:
        """MPos of a status report."""
        self._state(wait_s=self.settings.answer_s)
        if self._mpos is None:
            raise self.failed("the stage does not say where it stands")
        return self._mpos

    def run(self, lines: Sequence[str], *, seconds: float) -> None:
        """Character counting; asks for the status where nothing is said."""
        self.port.quiet(for_s=0.0)
        self._taken(lines, until=self.waiting_until(seconds), silent_s=self.settings.answer_s)

    def stop(self) -> None:
        """Feed hold, soft reset, lift.

        Raises:
            StageError: it does not answer.
        """
        self.lost = True
        self.port.write(b"!")
        until = time.monotonic() + self.settings.answer_s
        # a reset before it stands would lose steps
        while time.monotonic() < until and self._state(wait_s=LOOK_S) in (None, *_MOVING):
            pass
        self._reset()
        if self._state(wait_s=self.settings.answer_s) == "Alarm":
            self._taken(["$X"], until=self.waiting_until(0.0), silent_s=self.settings.answer_s)
        self.lift()

    _mpos: tuple[float, float, float] | None = None

    def _reset(self) -> str:
        self.port.quiet(for_s=0.0)
        self.port.write(b"\x18")
        until = time.monotonic() + self.settings.answer_s
        while time.monotonic() < until:
            line = self.port.line(wait_s=LOOK_S)
            if line is not None and line.startswith("Grbl"):
                self.port.quiet(for_s=0.05)
                return line
        raise self.failed(
            "the stage's controller does not greet as GRBL does", "see firmware, port and baud of [stage]"
        )

    def _state(self, *, wait_s: float) -> str | None:
        """State of a fresh status report; None where none comes."""
        self._mpos = None
        self.port.write(b"?")
        until = time.monotonic() + wait_s
        while (left := until - time.monotonic()) > 0.0:
            line = self.port.line(wait_s=left)
            if line is not None and (found := _STATUS.match(line)):
                self._mpos = (float(found[2]), float(found[3]), float(found[4]))
                return found[1]
        return None

    def _taken(self, lines: Sequence[str], *, until: float, silent_s: float) -> None:
        waiting, flying = deque(f"{line}\n".encode() for line in lines), deque[int]()
        heard = time.monotonic()
        while waiting or flying:
            batch = b""
            while waiting and sum(flying) + len(waiting[0]) <= _ROOM:
                flying.append(len(waiting[0]))
                batch += waiting.popleft()
            if batch:
                self.port.write(batch)
            line, now = self.port.line(wait_s=LOOK_S), time.monotonic()
            if now > until:
                raise self.failed("the stage's moves have not ended in time")
            if line is None:
                if now - heard > silent_s:
                    raise self.failed(f"the stage's controller has said nothing for {now - heard:.0f} s")
                self.port.write(b"?")
                continue
            heard = now
            if line == "ok":
                if flying:
                    flying.popleft()
            else:
                self._checked(line)

    def _checked(self, line: str) -> None:
        """Take in what is no `ok`.

        Raises:
            StageError: it is bad news.
        """
        if line.startswith("error:"):
            raise self.failed(f"the stage's controller refuses a line ({line})")
        if line.startswith("ALARM:"):
            number = line.partition(":")[2]
            raise self.failed(f"the stage has an alarm: {_ALARMS.get(number, f'number {number}')}")
        if line.startswith("Grbl"):
            raise self.failed("the stage's controller was reset in the middle")
        if (found := _STATUS.match(line)) and found[1] in _BAD:
            raise self.failed(f"the stage stands still in the state {found[1]}")
