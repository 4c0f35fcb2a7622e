"""A controller of a stage that takes G-code: what every firmware has in common.

* Nothing moves before homing but up.
* The tips are lowered, dragged and lifted by lines that travel in one write: a host that dies in between has already
  told the firmware to lift.
* After a reset, an alarm, an error or a silence the controller is `lost`: it is stopped, lifted as far as it lets, and
  wants homing.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence

from pipeline.bench.moves import Moves
from pipeline.bench.ramp import Ramp
from pipeline.bench.serial_port import SerialPort
from pipeline.bench.settings import StageSettings
from whisker_array.scan.stage_error import StageError

TURN_DEG_S = 60.0
PLACE_TOLERANCE_MM = 0.05
LOOK_S = 0.25
"""Of silence, before a controller is asked how it does."""
_MM_MIN = 60.0
_HOME_HINT = "see that nothing stands in the way, then: tactile-marks bench home BENCH.toml"


class Controller(ABC):
    """A stage's controller.

    Attributes:
        lost: where it stands is not known; only homing helps.
    """

    absolute = ""
    """Before a move in machine coordinates."""
    settle: tuple[str, ...] = ()
    """Answered when all moves have ended."""
    touching: tuple[str, ...] = ()
    """Sets the spare output, at rest."""
    not_touching: tuple[str, ...] = ()

    def __init__(self, settings: StageSettings) -> None:
        """Open the port; nothing is asked yet.

        Raises:
            StageError: it cannot be opened.
        """
        self.settings, self.lost = settings, True
        self.port = SerialPort(settings.port, baud=settings.baud, what="stage's controller")

    @abstractmethod
    def connect(self) -> str:
        """Bring controller and host to terms, with whatever it was at before ended.

        Returns:
            What it says it is.

        Raises:
            StageError: it does not answer as this firmware does.
        """

    @abstractmethod
    def home(self) -> None:
        """Lift, and find the ends of all axes.

        Raises:
            StageError: it cannot.
        """

    @abstractmethod
    def place_mm(self) -> tuple[float, float, float]:
        """Machine x, y, z at rest.

        Raises:
            StageError: it does not say.
        """

    @abstractmethod
    def run(self, lines: Sequence[str], *, seconds: float) -> None:
        """Have lines taken; a line that waits for the end of moves is answered then.

        Args:
            lines: without their ends; they travel together as far as the firmware has room.
            seconds: that their moves take.

        Raises:
            StageError: an error, an alarm, a reset, a silence, or moves that take too long.
        """

    @abstractmethod
    def stop(self) -> None:
        """Emergency: end all moves now, then lift; it wants homing afterwards.

        Raises:
            StageError: it could not be lifted.
        """

    @abstractmethod
    def dwell(self, seconds: float) -> str:
        """The line that waits."""

    def travel(self, moves: Moves) -> None:
        """Lift, turn, and stand lifted where a pass begins.

        Raises:
            StageError: as `run`.
        """
        s = self.settings
        self._ready()
        lines = [self.move(Z=moves.lift_z_mm, speed=s.rapid_mm_s)]
        if s.turn_axis:
            lines.append(self.move(speed=TURN_DEG_S, **{s.turn_axis: moves.turn_deg}))
        x, y = moves.begin_mm
        lines.append(self.move(X=x, Y=y, speed=s.rapid_mm_s))
        width = math.hypot(*(high - low for low, high in s.travel_mm))
        self.run([*lines, *self.settle], seconds=2.0 * width / s.rapid_mm_s + 360.0 / TURN_DEG_S)

    def touch(self, moves: Moves) -> None:
        """From where a pass begins: wait for the air samples, lower, drag, lift.

        Raises:
            StageError: as `run`, or it does not stand where it should afterwards.
        """
        s = self.settings
        self._ready()
        if moves.air_s > 0.0:
            self.run([*self.touching, self.dwell(moves.air_s), *self.not_touching], seconds=moves.air_s)
        x, y = moves.end_mm
        drop = Ramp(moves.lift_z_mm - moves.touch_z_mm, s.lower_mm_s, s.acceleration_mm_s2)
        self.run(
            [
                self.move(Z=moves.touch_z_mm, speed=s.lower_mm_s),
                *self.touching,
                self.move(X=x, Y=y, speed=moves.speed_mm_s),
                *self.not_touching,
                self.move(Z=moves.lift_z_mm, speed=s.rapid_mm_s),
                *self.settle,
            ],
            seconds=2.0 * drop.duration_s + moves.ramp.duration_s,
        )
        stands = self.place_mm()
        if math.dist(stands, (x, y, moves.lift_z_mm)) > PLACE_TOLERANCE_MM:
            self.lost = True
            raise StageError(
                f"the stage stands at {_spoken(stands)} mm and not at {_spoken((x, y, moves.lift_z_mm))} mm",
                _HOME_HINT,
            )

    def lift(self) -> None:
        """Lift at rest: to where the tips are carried, or up by as much where it is not known where they are.

        Raises:
            StageError: it cannot.
        """
        s = self.settings
        seconds = s.lift_mm / s.rapid_mm_s + s.answer_s
        if self.lost:
            up = f"G1Z{s.lift_mm:.3f}F{_MM_MIN * s.rapid_mm_s:.0f}"
            self.run(["G91", up, "G90", *self.settle], seconds=seconds)
        else:
            self.run(
                [self.move(Z=s.land_z_mm + s.lift_mm, speed=s.rapid_mm_s), *self.settle], seconds=seconds
            )

    def close(self) -> None:
        """Let the port go."""
        self.port.close()

    def move(self, *, speed: float, **axes: float) -> str:
        """A straight move in machine coordinates; speed in mm/s, or degrees a second."""
        places = "".join(f"{letter}{value:.3f}" for letter, value in axes.items())
        return f"{self.absolute}G1{places}F{_MM_MIN * speed:.0f}"

    def failed(self, what: str, hint: str = _HOME_HINT) -> StageError:
        """What ends a run: from now on the controller is lost."""
        self.lost = True
        return StageError(what, hint)

    def waiting_until(self, seconds: float) -> float:
        """When moves of so long should have ended at the latest."""
        return time.monotonic() + 2.0 * seconds + self.settings.answer_s

    def _ready(self) -> None:
        if self.lost:
            raise StageError("the stage does not know where it stands", _HOME_HINT)


def _spoken(place_mm: Sequence[float]) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in place_mm) + ")"
