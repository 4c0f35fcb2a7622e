"""Controller of a G-code stage, common to all firmwares, whose dialects are data (`firmwares`).

Before homing only upward moves are made. The lines that lower, drag and lift the tips are sent in one write, in case
the host dies in between. After a reset, an alarm, an error or a timeout it is `lost`: stopped, lifted, and not homed.
"""

from __future__ import annotations

import math
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from pipeline.bench.moves import Moves, Ramp
from pipeline.bench.serial_port import SerialPort
from pipeline.bench.settings import StageSettings
from whisker_array.scan.stage_error import StageError

# seconds without an answer before a controller is asked for its state
LOOK_S = 0.25
_TURN_DEG_S = 60.0
_PLACE_TOLERANCE_MM = 0.05
_HOME_HINT = "check that nothing is in the way, then: tactile-marks bench home BENCH.toml"


@dataclass(frozen=True)
class Dialect:
    """G-code and answers of a firmware."""

    name: str
    absolute: str
    settle: tuple[str, ...]  # lines that are acknowledged when all moves have ended
    touching: tuple[str, ...]  # lines that set the spare output, at rest
    not_touching: tuple[str, ...]  # lines that clear it
    dwell: str  # line that waits for `s` seconds (`ms` milliseconds)
    home: tuple[str, ...]  # lines that find the ends of all axes, each sent when the one before is done
    lifts_to_home: bool
    place: re.Pattern[str]  # of an answer, with machine x, y, z in its groups
    # patterns of answers that end a run, with the message; the first that matches counts
    bad: tuple[tuple[str, str], ...]


class Sender:
    """Send lines to a firmware, which acknowledges each with `ok`, in order, as far as it has room. After it has
    requested a line again, they are sent one at a time."""

    def __init__(
        self,
        lines: Sequence[bytes],
        *,
        first: int = 0,
        room_bytes: float = math.inf,
        query: bytes = b"",
        most_resends: int = 24,
    ) -> None:
        """`query` are bytes that ask the firmware for its state, sent if it does not answer."""
        self._lines, self._first, self._room_bytes, self._query = lines, first, room_bytes, query
        self._sent = self._acknowledged = self._refused = 0
        self._again, self._resends_left, self.wait_s = False, most_resends, LOOK_S

    @property
    def done(self) -> bool:
        return self._acknowledged == len(self._lines)

    def due(self, *, silent: bool) -> bytes:
        """Return the bytes to write now; `silent`: whether the last wait ended without an answer."""
        begin = self._sent
        if self._again:
            # the lines after the damaged one have been refused as well by now
            self._sent += silent and self._acknowledged == begin
        while not self._again and self._sent < len(self._lines):
            if sum(map(len, self._lines[self._acknowledged : self._sent + 1])) > self._room_bytes:
                break
            self._sent += 1
        return (self._query if silent else b"") + b"".join(self._lines[begin : self._sent])

    def acknowledges(self, answer: str) -> bool:
        """Whether an answer is an acknowledgement or a resend request. Raises ValueError: that line is gone."""
        if answer.startswith("ok"):
            # each refused line has an `ok` of its own
            self._acknowledged += not self._refused and self._acknowledged < self._sent
            self._refused -= bool(self._refused)
        elif asks := re.match(r"(?:Resend|rs)\D*(\d+)", answer):
            self._sent, self._again, self.wait_s = int(asks[1]) - self._first, True, 0.1
            self._refused, self._resends_left = self._refused + 1, self._resends_left - 1
            if self._resends_left < 0 or not self._acknowledged <= self._sent <= len(self._lines):
                raise ValueError(f"requests line {asks[1]} again")
        else:
            return False
        return True


class Controller(ABC):
    """A stage's controller; if `lost`, its position is unknown, and it needs homing."""

    dialect: ClassVar[Dialect]

    def __init__(self, settings: StageSettings) -> None:
        """Open the port; nothing is sent yet. Raises StageError: it cannot be opened."""
        self.settings, self.lost = settings, True
        self.port = SerialPort(settings.port, baud=settings.baud, what="stage's controller")
        self._place: tuple[float, float, float] | None = None

    @abstractmethod
    def connect(self) -> str:
        """Wait until the moves have ended, and return the greeting. Raises StageError: another firmware, or none."""

    @abstractmethod
    def sender(self, lines: Sequence[str]) -> Sender:
        """Make the sender of these lines."""

    @abstractmethod
    def ask_place(self) -> None:
        """Ask for the position, and process the answer."""

    @abstractmethod
    def stop(self) -> None:
        """End all moves now, then lift; it needs homing afterwards. Raises StageError: it could not be lifted."""

    def home(self) -> None:
        if self.lost:
            self.connect()
        if not self.dialect.lifts_to_home:
            self.lift()
        self.lost = True
        for line in self.dialect.home:
            self.exchange([line], seconds=0.5 * self.settings.home_s, silent_s=self.settings.home_s)
        self.lost = False

    def place_mm(self) -> tuple[float, float, float]:
        """Machine x, y, z at rest. Raises StageError: it does not report its position."""
        self._place = None
        self.ask_place()
        if self._place is None:
            raise self.failed("the stage does not report its position")
        return self._place

    def run(self, lines: Sequence[str], *, seconds: float) -> None:
        """Send lines, and wait until all are acknowledged, after their moves. Raises StageError."""
        self.port.quiet(for_s=0.0)
        self.exchange(lines, seconds=seconds, silent_s=self.settings.answer_s)

    def exchange(self, lines: Sequence[str], *, seconds: float, silent_s: float) -> None:
        sender, silent = self.sender(lines), False
        heard = time.monotonic()
        until = heard + 2.0 * seconds + self.settings.answer_s
        while not sender.done:
            if due := sender.due(silent=silent):
                self.port.write(due)
            answer, now = self.port.line(wait_s=sender.wait_s), time.monotonic()
            if now > until:
                raise self.failed("the stage's moves have not ended in time")
            silent = answer is None
            if answer is None:
                if now - heard > silent_s:
                    raise self.failed(f"the stage's controller has not answered for {now - heard:.0f} s")
                continue
            heard = now
            try:
                if not sender.acknowledges(answer):
                    self.take_in(answer)
            except ValueError as error:
                raise self.failed(f"the stage's controller {error}") from error

    def take_in(self, answer: str) -> None:
        """Process an answer that is not an acknowledgement. Raises StageError: it ends the run."""
        for pattern, message in self.dialect.bad:
            if matched := re.match(pattern, answer):
                raise self.failed(message.format(matched[0], *matched.groups()))
        if matched := self.dialect.place.match(answer):
            x, y, z = matched.groups()[-3:]
            self._place = (float(x), float(y), float(z))

    def travel(self, moves: Moves) -> None:
        s = self.settings
        self._check_place_known()
        lines = [self._move(s.rapid_mm_s, Z=moves.lift_z_mm)]
        if s.turn_axis:
            lines.append(self._move(_TURN_DEG_S, **{s.turn_axis: moves.turn_deg}))
        lines.append(self._move(s.rapid_mm_s, X=moves.begin_mm[0], Y=moves.begin_mm[1]))
        width = math.hypot(*(high - low for low, high in s.travel_mm))
        seconds = 2.0 * width / s.rapid_mm_s + 360.0 / _TURN_DEG_S
        self.run([*lines, *self.dialect.settle], seconds=seconds)

    def touch(self, moves: Moves) -> None:
        """Make one pass from its start: wait for the air samples, lower, drag, lift."""
        s, dialect = self.settings, self.dialect
        self._check_place_known()
        if moves.air_s > 0.0:
            dwell = dialect.dwell.format(s=moves.air_s, ms=1000.0 * moves.air_s)
            self.run([*dialect.touching, dwell, *dialect.not_touching], seconds=moves.air_s)
        end = (*moves.end_mm, moves.lift_z_mm)
        lines = [
            self._move(s.lower_mm_s, Z=moves.touch_z_mm),
            *dialect.touching,
            self._move(moves.speed_mm_s, X=end[0], Y=end[1]),
            *dialect.not_touching,
            self._move(s.rapid_mm_s, Z=moves.lift_z_mm),
            *dialect.settle,
        ]
        drop = Ramp(moves.lift_z_mm - moves.touch_z_mm, s.lower_mm_s, s.acceleration_mm_s2)
        self.run(lines, seconds=2.0 * drop.duration_s + moves.ramp.duration_s)
        stands = self.place_mm()
        if math.dist(stands, end) > _PLACE_TOLERANCE_MM:
            actual, wanted = (f"({', '.join(f'{v:.2f}' for v in place)}) mm" for place in (stands, end))
            raise self.failed(f"the stage is at {actual} and not at {wanted}")

    def lift(self) -> None:
        """Lift at rest to the travel height, or as far up if the position is unknown. Raises StageError."""
        s = self.settings
        if self.lost:
            up = ["G91", f"G1Z{s.lift_mm:.3f}F{60.0 * s.rapid_mm_s:.0f}", "G90"]
        else:
            up = [self._move(s.rapid_mm_s, Z=s.land_z_mm + s.lift_mm)]
        self.run([*up, *self.dialect.settle], seconds=s.lift_mm / s.rapid_mm_s + s.answer_s)

    def close(self) -> None:
        self.port.close()

    def failed(self, what: str, hint: str = _HOME_HINT) -> StageError:
        self.lost = True
        return StageError(what, hint)

    def unknown(self) -> StageError:
        return self.failed(
            f"the stage's controller does not answer like {self.dialect.name}",
            "see firmware, port and baud of [stage]",
        )

    def _move(self, speed: float, **axes: float) -> str:
        places = "".join(f"{letter}{value:.3f}" for letter, value in axes.items())
        return f"{self.dialect.absolute}G1{places}F{60.0 * speed:.0f}"

    def _check_place_known(self) -> None:
        if self.lost:
            raise StageError("the stage does not know its position", _HOME_HINT)
