"""Firmwares: GRBL 1.1, grblHAL, FluidNC, and Marlin 2.

GRBL: character counting (127 bytes in flight), status reports, feed hold and soft reset::

    host  G53G1Z-31.000F300\\nM8\\n... -->
          <-- ok | error:N                                     one per line, in order
      ?   <-- <Run|MPos:1.000,2.000,-3.000|FS:500,0>           at any time
      !   feed hold;  0x18  soft reset --> Grbl 1.1h ['$' for help]
          <-- ALARM:N                                          locked until $X or $H

Marlin: numbered lines with a checksum, `busy` while it works, and resend requests::

    host  N7 G1X10.000F3000*81 -->
          <-- ok                                    one per line, in order; echo:busy: processing every 2 s
          <-- Error:checksum mismatch, Last Line: 6 / Resend: 7 / ok     the ok belongs to the Resend
      M114 <-- X:10.00 Y:0.00 Z:5.00 E:0.00 Count X:800 Y:0 Z:2000
      M410 quick stop;  M112 --> Error:Printer halted. kill() called!

The coolant output of GRBL (M8, M9) and the fan output of Marlin (M106, M107) are the spare output that signals touch to
the converter; GRBL sets it when the moves before it have ended. Only a Marlin with EMERGENCY_PARSER obeys quick stop
and M112 at once.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from functools import reduce
from operator import xor

from pipeline.bench.controller import LOOK_S, Controller, Dialect, Sender
from whisker_array.scan.stage_error import StageError

# bytes that may be in flight
_ROOM_BYTES = 127
_ALARMS = {
    "1": "a limit switch was hit",
    "2": "a move would have left the soft limits",
    "3": "it was reset while it moved",
    "8": "homing could not leave a limit switch",
    "9": "homing found no limit switch",
    r"(\d+)": "number {1}",
}
_MOVING = ("Run", "Jog", "Home")
_GREETING = re.compile("Grbl.*")
# restarts the line numbers, as line 0
_COUNT_ANEW = "M110N0"


class Grbl(Controller):
    """A stage under GRBL."""

    dialect = Dialect(
        name="GRBL",
        absolute="G53",
        settle=("G4P0.01",),
        touching=("M8",),
        not_touching=("M9",),
        dwell="G4P{s:.3f}",
        home=("$H", "G21G90G94"),
        lifts_to_home=True,
        place=re.compile(r"<(\w+)(?::\d+)?\|(?:.*\|)?MPos:([-\d.]+),([-\d.]+),([-\d.]+)"),
        bad=(
            ("error:.*", "the stage's controller refuses a line ({0})"),
            *((f"ALARM:{number}$", f"the stage has an alarm: {what}") for number, what in _ALARMS.items()),
            ("Grbl", "the stage's controller was reset in the middle"),
            (r"<(Alarm|Hold|Door|Check|Sleep)\b", "the stage is stopped in the state {1}"),
        ),
    )

    def connect(self) -> str:
        self.lost = True
        until = time.monotonic() + 2.0 * self.settings.answer_s
        # the last pass of a dead host ends with its lift; a booting board does not answer at first
        while (state := self._state(wait_s=LOOK_S)) in (None, *_MOVING) and time.monotonic() <= until:
            if state is not None:
                until = time.monotonic() + self.settings.answer_s
        return self._reset()

    def sender(self, lines: Sequence[str]) -> Sender:
        return Sender([f"{line}\n".encode() for line in lines], room_bytes=_ROOM_BYTES, query=b"?")

    def ask_place(self) -> None:
        self._state(wait_s=self.settings.answer_s)

    def stop(self) -> None:
        self.lost = True
        self.port.write(b"!")
        until = time.monotonic() + self.settings.answer_s
        # a reset before the axes stop would lose steps
        while time.monotonic() < until and self._state(wait_s=LOOK_S) in (None, *_MOVING):
            pass
        self._reset()
        if self._state(wait_s=self.settings.answer_s) == "Alarm":
            self.exchange(["$X"], seconds=0.0, silent_s=self.settings.answer_s)
        self.lift()

    def _reset(self) -> str:
        self.port.quiet(for_s=0.0)
        self.port.write(b"\x18")
        greeting = self.port.answer(_GREETING, wait_s=self.settings.answer_s)
        if greeting is None:
            raise self.unknown()
        self.port.quiet(for_s=0.05)
        return greeting[0]

    def _state(self, *, wait_s: float) -> str | None:
        self._place = None
        self.port.write(b"?")
        answer = self.port.answer(self.dialect.place, wait_s=wait_s)
        if answer is None:
            return None
        self._place = (float(answer[2]), float(answer[3]), float(answer[4]))
        return answer[1]


class Marlin(Controller):
    """A stage under Marlin; its z must home upwards."""

    dialect = Dialect(
        name="Marlin",
        absolute="",
        settle=("M400",),
        touching=("M400", "M106S255"),
        not_touching=("M400", "M107"),
        dwell="G4P{ms:.0f}",
        home=("G21", "G90", "G28", "M400"),
        lifts_to_home=False,
        place=re.compile(r"X:([-\d.]+) Y:([-\d.]+) Z:([-\d.]+)"),
        bad=(
            ("start$", "the stage's controller was reset in the middle"),
            (
                "Error:(?!checksum|Line Number|No Checksum|No Line)(.*)",
                "the stage's controller reports: {1}",
            ),
        ),
    )
    _number = 0
    _name = ""

    def connect(self) -> str:
        """Wait for the board to boot, start numbering, and ask for its name. Raises StageError: no Marlin answers."""
        self.lost = True
        until = time.monotonic() + 2.0 * self.settings.answer_s
        while (left := until - time.monotonic()) > 0.0:
            self.port.quiet(for_s=LOOK_S)
            self._name = ""
            try:
                self.exchange([_COUNT_ANEW, "M115", "M400"], seconds=0.5 * left, silent_s=2.0 * LOOK_S)
            except StageError:
                continue
            if self._name:
                return self._name
            break
        raise self.unknown()

    def sender(self, lines: Sequence[str]) -> Sender:
        first = 0 if lines[0] == _COUNT_ANEW else self._number + 1
        self._number = first + len(lines) - 1
        bodies = [f"N{number} {line}" for number, line in enumerate(lines, start=first)]
        return Sender([f"{body}*{reduce(xor, body.encode())}\n".encode() for body in bodies], first=first)

    def ask_place(self) -> None:
        self.run(["M400", "M114"], seconds=0.0)

    def take_in(self, answer: str) -> None:
        super().take_in(answer)
        if answer.startswith("FIRMWARE_NAME:"):
            self._name = answer.removeprefix("FIRMWARE_NAME:").partition(" SOURCE")[0]

    def stop(self) -> None:
        """Quick stop and lift; without an answer M112, which leaves the tips where they are. Raises StageError."""
        self.lost = True
        self.port.write(b"M410\n")
        try:
            self.connect()
            self.lift()
        except StageError:
            self.port.write(b"M112\n")
            raise self.failed(
                "the stage does not stop as it should, and was halted (M112); the tips may be down",
                "switch it off, lift the comb by hand, and home it",
            ) from None
