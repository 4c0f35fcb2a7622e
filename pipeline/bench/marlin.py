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

from pipeline.bench.controller import LOOK_S, Controller
from whisker_array.scan.stage_error import StageError

_PLACE = re.compile(r"X:([-\d.]+) Y:([-\d.]+) Z:([-\d.]+)")
_RESEND = re.compile(r"(?:Resend|rs)\D*(\d+)")
_HARMLESS = ("Error:checksum", "Error:Line Number", "Error:No Checksum", "Error:No Line")
_MOST_RESENDS = 24
_SETTLED_S = 0.1


class Marlin(Controller):
    """A stage under Marlin."""

    settle = ("M400",)
    touching = ("M400", "M106S255")
    not_touching = ("M400", "M107")

    _number = 0
    _place: tuple[float, float, float] | None = None
    _name = ""

    def dwell(self, seconds: float) -> str:
        """G4 in milliseconds."""
        return f"G4P{1000.0 * seconds:.0f}"

    def connect(self) -> str:
        """Wait for a board that boots, begin numbering, ask for its name.

        Raises:
            StageError: silent, or no Marlin.
        """
        self.lost = True
        until = time.monotonic() + 2.0 * self.settings.answer_s
        while time.monotonic() < until:
            self.port.quiet(for_s=LOOK_S)
            self._number, self._name = 0, ""
            try:
                self._taken(["M110N0", "M115", "M400"], until=until, silent_s=2.0 * LOOK_S)
            except StageError:
                continue
            if self._name:
                return self._name
            break
        raise self.failed(
            "the stage's controller does not answer as Marlin does", "see firmware, port and baud of [stage]"
        )

    def home(self) -> None:
        """Up a little, then G28; z must home upwards.

        Raises:
            StageError: it cannot.
        """
        if self.lost:
            self.connect()
        self.lift()
        until = time.monotonic() + self.settings.home_s
        self._taken(["G21", "G90", "G28", "M400"], until=until, silent_s=self.settings.home_s)
        self.lost = False

    def place_mm(self) -> tuple[float, float, float]:
        """What M114 says."""
        self._place = None
        self.run(["M400", "M114"], seconds=0.0)
        if self._place is None:
            raise self.failed("the stage does not say where it stands")
        return self._place

    def run(self, lines: Sequence[str], *, seconds: float) -> None:
        """All lines in one write, and those again that it wants again."""
        self.port.quiet(for_s=0.0)
        self._taken(lines, until=self.waiting_until(seconds), silent_s=self.settings.answer_s)

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

    def _taken(self, lines: Sequence[str], *, until: float, silent_s: float) -> None:
        first = self._number + 1
        numbered = [self._numbered(line, first + k) for k, line in enumerate(lines)]
        self._number = first + len(lines) - 1
        if lines and lines[0] == "M110N0":  # numbering begins with it
            numbered = [
                _checked("N0 M110N0"),
                *(self._numbered(line, k) for k, line in enumerate(lines[1:], start=1)),
            ]
            first, self._number = 0, len(lines) - 1
        sent = len(numbered)
        self.port.write(b"".join(numbered))
        done, resends, to_ignore, heard = 0, 0, 0, time.monotonic()
        while done < len(numbered):
            line, now = self.port.line(wait_s=_SETTLED_S if resends else LOOK_S), time.monotonic()
            if now > until:
                raise self.failed("the stage's moves have not ended in time")
            if line is None:
                if now - heard > silent_s:
                    raise self.failed(f"the stage's controller has said nothing for {now - heard:.0f} s")
                # after a resend one at a time, once those behind the spoilt line have been refused as well
                if done == sent:
                    self.port.write(numbered[sent])
                    sent += 1
                continue
            heard = now
            if line.startswith("ok"):
                done, to_ignore = (done, to_ignore - 1) if to_ignore else (done + 1, 0)
            elif found := _RESEND.match(line):
                resends, to_ignore = resends + 1, to_ignore + 1
                sent = int(found[1]) - first
                if resends > _MOST_RESENDS or not done <= sent <= len(numbered):
                    raise self.failed(f"the stage's controller wants line {found[1]} again")
            else:
                self._heard(line)

    def _heard(self, line: str) -> None:
        """Take in what is no acknowledgement.

        Raises:
            StageError: it is bad news.
        """
        if line == "start":
            raise self.failed("the stage's controller was reset in the middle")
        if line.startswith("Error:") and not line.startswith(_HARMLESS):
            raise self.failed(f"the stage's controller reports: {line.removeprefix('Error:')}")
        if found := _PLACE.match(line):
            self._place = (float(found[1]), float(found[2]), float(found[3]))
        if line.startswith("FIRMWARE_NAME:"):
            self._name = line.removeprefix("FIRMWARE_NAME:").partition(" SOURCE")[0]

    def _numbered(self, line: str, number: int) -> bytes:
        return _checked(f"N{number} {line}")


def _checked(line: str) -> bytes:
    return f"{line}*{reduce(xor, line.encode())}\n".encode()
