"""GRBL 1.1 and Marlin as a driver meets them: what they acknowledge, when they wait, what locks them."""

from __future__ import annotations

import re
import time
from functools import reduce
from operator import xor

from pipeline.bench.settings import StageSettings
from tests.support.emulator.firmware import WORD, Firmware
from tests.support.emulator.world import AXES, World

# -------------------------------------------------------------------------------------------------------------- grbl

_RECEIVES = 128
_AT_ONCE = b"?!~\x18"


class EmulatedGrbl(Firmware):
    """A board with GRBL, homing and soft limits switched on ($20, $22).

    Attributes:
        state: as it reports.
    """

    state = "Alarm"

    def boot(self) -> None:
        """Locked until it is homed."""
        self.forget()
        self.state = "Alarm"
        self._greet()

    def _greet(self) -> None:
        self.terminal.write(b"\r\n")
        self.terminal.say("Grbl 1.1h ['$' for help]")
        if self.state == "Alarm":
            self.terminal.say("[MSG:'$H'|'$X' to unlock]")

    def at_once(self, data: bytes) -> bytes:
        """? ! ~ and soft reset; what does not fit into its buffer is lost."""
        lines = bytearray()
        for value in data:
            if value not in _AT_ONCE:
                if value != 0x0D and len(self.received) + len(lines) < _RECEIVES:
                    lines.append(value)
            elif value == ord("?"):
                self._report()
            elif value == ord("!"):
                self.holding = self.busy
            elif value == ord("~"):
                self.holding = False
            else:
                if self.busy and not self.holding:  # steps are lost
                    self.state = "Alarm"
                    self.terminal.say("ALARM:3")
                lines.clear()
                self.forget()
                self._greet()
        return bytes(lines)

    def _report(self) -> None:
        place = ",".join(f"{self.world.place_mm[k]:.3f}" for k in AXES)
        doing = "Hold:0" if self.holding else "Run" if self.busy else self.state
        self.terminal.say(f"<{doing}|MPos:{place}|FS:0,0|WCO:0.000,0.000,0.000,0.000>")

    def take_line(self) -> bool:
        """One line; those that wait for moves to end stay until they have."""
        line = self.first_line()
        if line is None or self.full:
            return False
        waits = line.startswith(("$", "M8", "M9", "G4"))
        if waits and self.busy:
            return False
        self.drop_line()
        if line.startswith("$"):
            self._dollar(line)
        elif not line:
            self.ok()
        elif self.state == "Alarm":
            self.terminal.say("error:9")
        else:
            self._block(line)
        return True

    def _dollar(self, line: str) -> None:
        if line not in ("$X", "$H"):
            self.terminal.say("error:3")
            return
        self.state = "Idle"
        if line == "$H":
            self.home()
        else:
            self.terminal.say("[MSG:Caution: Unlocked]")
            self.ok()

    def _block(self, line: str) -> None:
        words = WORD.findall(line)
        codes = {f"{k}{float(v):g}" for k, v in words if k in "GM"}
        if not words or "".join(k + v for k, v in words) != line:
            self.terminal.say("error:1")
        elif codes - {"G0", "G1", "G4", "G21", "G53", "G90", "G91", "G94", "M8", "M9"}:
            self.terminal.say("error:20")
        else:
            self.obey(codes, {k: float(v) for k, v in words if k not in "GM"})

    def refuses_beyond(self) -> bool:
        """Soft limits."""
        self.forget()
        self.state = "Alarm"
        self.terminal.say("ALARM:2")
        self.terminal.say("[MSG:Reset to continue]")
        return True


# ------------------------------------------------------------------------------------------------------------ marlin

_BUSY_S = 2.0
_SHARED = ("G0", "G1", "G4", "G21", "G90", "G91", "M106", "M107", "M110", "M400")
_NUMBERED = re.compile(r"N(\d+) ?(.*)\*(\d+)$")
_NAME = "FIRMWARE_NAME:Marlin 2.1.2 SOURCE_CODE_URL:github.com/MarlinFirmware/Marlin PROTOCOL_VERSION:1.0"


class EmulatedMarlin(Firmware):
    """A board with Marlin and EMERGENCY_PARSER, z homing upwards.

    Attributes:
        spoil: the next so many lines come in with a wrong checksum.
        halted: after M112.
    """

    dwell_unit_s = 1e-3

    def __init__(self, world: World, stage: StageSettings) -> None:
        super().__init__(world, stage)
        self._last, self.spoil, self.halted = 0, 0, False
        self._busy_at = time.monotonic()

    def boot(self) -> None:
        """As after the reset button."""
        self.forget()
        self._last, self.halted = 0, False
        self.terminal.say("start")
        self.terminal.say("echo:Marlin 2.1.2")

    def at_once(self, data: bytes) -> bytes:
        """M410 and M112 are heard in the stream; says `busy` while a line waits."""
        if self.busy and b"\n" in self.received and time.monotonic() - self._busy_at > _BUSY_S:
            self._busy_at = time.monotonic()
            self.terminal.say("echo:busy: processing")
        if self.halted:
            return b""
        if b"M112" in data:
            self.forget()
            self.halted = True
            self.terminal.say("Error:Printer halted. kill() called!")
            return b""
        if b"M410" in data:
            self.planner.clear()
            self._moving = None  # lines that it has taken in go on after it
            data = data.replace(b"M410\n", b"")
        return data

    def take_line(self) -> bool:
        """One line; those that wait for moves to end stay until they have."""
        line = self.first_line()
        if line is None or self.full:
            return False
        found = _NUMBERED.match(line)
        body = found[2] if found else line
        if self.busy and body.startswith(("M400", "G4", "G28", "M114")):
            return False
        self.drop_line()
        if found is None:
            self._asks_again("No Line Number with checksum") if "*" in line else self._do(line)
            return True
        number, checked = int(found[1]), line.rpartition("*")[0]
        right = reduce(xor, checked.encode("latin-1"), 0) == int(found[3])
        if self.spoil:
            self.spoil, right = self.spoil - 1, False
        if not right:
            self._asks_again("checksum mismatch")
        elif number != self._last + 1 and not body.startswith("M110"):
            self._asks_again("Line Number is not Last Line Number+1")
        else:
            self._last = number
            self._do(body)
        return True

    def _asks_again(self, why: str) -> None:
        self.terminal.say(f"Error:{why}, Last Line: {self._last}")
        self.terminal.say(f"Resend: {self._last + 1}")
        self.terminal.say("ok")

    def _do(self, line: str) -> None:
        words = WORD.findall(line)
        code, values = "".join(words[0]) if words else "", {k: float(v) for k, v in words[1:]}
        if code == "G28":
            self.home()
            return
        at = self.world.place_mm
        if code == "M115":
            self.terminal.say(_NAME)
        elif code == "M114":
            self.terminal.say(f"X:{at['X']:.2f} Y:{at['Y']:.2f} Z:{at['Z']:.2f} E:0.00 Count X:0 Y:0 Z:0")
        elif code not in _SHARED:
            self.terminal.say(f'echo:Unknown command: "{line}"')
        self.obey((code,), values)
