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
from collections.abc import Sequence

from pipeline.bench.controller import LOOK_S, Controller, Dialect, Sender

# that may be in flight
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
            (r"<(Alarm|Hold|Door|Check|Sleep)\b", "the stage stands still in the state {1}"),
        ),
    )

    def connect(self) -> str:
        """Wait until its moves have ended, then reset it.

        Raises:
            StageError: silent, or no GRBL.
        """
        self.lost = True
        until = time.monotonic() + 2.0 * self.settings.answer_s
        # a dead host's last pass ends with its lift; a board that boots is silent at first
        while (state := self._state(wait_s=LOOK_S)) in (None, *_MOVING) and time.monotonic() <= until:
            if state is not None:
                until = time.monotonic() + self.settings.answer_s
        return self._reset()

    def sender(self, lines: Sequence[str]) -> Sender:
        """Count the characters in flight."""
        return Sender([f"{line}\n".encode() for line in lines], room_bytes=_ROOM_BYTES, query=b"?")

    def ask_place(self) -> None:
        """Ask for a status report."""
        self._state(wait_s=self.settings.answer_s)

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
        """State of a fresh status report; None where none comes."""
        self._place = None
        self.port.write(b"?")
        found = self.port.answer(self.dialect.place, wait_s=wait_s)
        if found is None:
            return None
        self._place = (float(found[2]), float(found[3]), float(found[4]))
        return found[1]
