"""GRBL 1.1 as a driver meets it: what it acknowledges, when it waits, what locks it."""

from __future__ import annotations

from pipeline.bench.emulator.firmware import WORD, Block, Firmware
from pipeline.bench.emulator.world import AXES, World
from pipeline.bench.settings import StageSettings

_RECEIVES = 128
_AT_ONCE = b"?!~\x18"


class EmulatedGrbl(Firmware):
    """A board with GRBL, homing and soft limits switched on ($20, $22).

    Attributes:
        state: as it reports.
    """

    def __init__(self, world: World, stage: StageSettings) -> None:
        super().__init__(world, acceleration_mm_s2=stage.acceleration_mm_s2)
        self._stage, self.state = stage, "Alarm"

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
            self.terminal.say("ok")
        elif self.state == "Alarm":
            self.terminal.say("error:9")
        else:
            self._block(line)
        return True

    def _dollar(self, line: str) -> None:
        if line == "$X":
            self.state = "Idle"
            self.terminal.say("[MSG:Caution: Unlocked]")
            self.terminal.say("ok")
        elif line == "$H":
            self.state = "Idle"
            (x, _), (y, _), (_, z) = self._stage.travel_mm
            self.planner.append(Block({"Z": z}, 25.0))  # z first, as it is built
            homed = lambda: self.terminal.say("ok")  # noqa: E731  (a name for what happens at the end)
            self.planner.append(Block({"X": x, "Y": y, "A": 0.0}, 25.0, done=homed))
        else:
            self.terminal.say("error:3")

    def _block(self, line: str) -> None:
        words = WORD.findall(line)
        codes = {f"{k}{float(v):g}" for k, v in words if k in "GM"}
        values = {k: float(v) for k, v in words if k not in "GM"}
        if not words or "".join(k + v for k, v in words) != line:
            self.terminal.say("error:1")
            return
        if unknown := codes - {"G0", "G1", "G4", "G21", "G53", "G90", "G91", "G94", "M8", "M9"}:
            self.terminal.say(f"error:20  {unknown.pop()}".split("  ")[0])
            return
        if codes & {"G90", "G91"}:
            self.relative = "G91" in codes
        if codes & {"M8", "M9"}:
            self.world.touching = "M8" in codes
        if "G4" in codes:
            self.planner.append(Block({}, dwell_s=values["P"], done=lambda: self.terminal.say("ok")))
            return
        if codes & {"G0", "G1"}:
            to = self.target(values)
            spans = dict(zip("XYZ", self._stage.travel_mm, strict=True))
            if any(not low - 1e-6 <= to.get(k, low) <= high + 1e-6 for k, (low, high) in spans.items()):
                self.forget()
                self.state = "Alarm"
                self.terminal.say("ALARM:2")
                self.terminal.say("[MSG:Reset to continue]")
                return
            self.planner.append(Block(to, self.feed_mm_s))
        self.terminal.say("ok")
