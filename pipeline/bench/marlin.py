"""Marlin 2: numbered lines with a checksum, `busy` while it works, and lines that it wants again.

host  N7 G1X10.000F3000*81 --> firmware
      <-- ok                                    one a line, in order
      <-- echo:busy: processing                 every 2 s, while a line waits for moves
      <-- Error:checksum mismatch, Last Line: 6
          Resend: 7
          ok                                    (belongs to the Resend)
  M114 <-- X:10.00 Y:0.00 Z:5.00 E:0.00 Count X:800 Y:0 Z:2000
  M410 quick stop;  M112 --> Error:Printer halted. kill() called!

The fan output (M106, M107) is the spare output that tells the converter of touch. Quick stop and M112 are heard at once
only by a firmware with EMERGENCY_PARSER.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from functools import reduce
from operator import xor

from pipeline.bench.controller import LOOK_S, Controller, Dialect, Sender
from whisker_array.scan.stage_error import StageError

# sets the count of lines; the line numbered 0
_COUNT_ANEW = "M110N0"


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
        """Wait for a board that boots, begin numbering, ask for its name.

        Raises:
            StageError: silent, or no Marlin.
        """
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
        """Number the lines on from the last."""
        first = 0 if lines[0] == _COUNT_ANEW else self._number + 1
        self._number = first + len(lines) - 1
        bodies = [f"N{number} {line}" for number, line in enumerate(lines, start=first)]
        return Sender([f"{body}*{reduce(xor, body.encode())}\n".encode() for body in bodies], first=first)

    def ask_place(self) -> None:
        """Send M114.

        Raises:
            StageError: as in `run`.
        """
        self.run(["M400", "M114"], seconds=0.0)

    def take_in(self, answer: str) -> None:
        """Take in its name, too.

        Raises:
            StageError: it ends the run.
        """
        super().take_in(answer)
        if answer.startswith("FIRMWARE_NAME:"):
            self._name = answer.removeprefix("FIRMWARE_NAME:").partition(" SOURCE")[0]

    def stop(self) -> None:
        """Quick stop, lift; where it is deaf to that, M112, which leaves the tips where they are.

        Raises:
            StageError: it was halted, or does not answer.
        """
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
