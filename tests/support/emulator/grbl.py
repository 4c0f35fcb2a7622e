"""GRBL 1.1 as a driver meets it: what it acknowledges, when it waits, what locks it."""

from __future__ import annotations

from tests.support.emulator.firmware import WORD, Firmware
from tests.support.emulator.world import AXES

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
