"""Common base of emulated firmware: a pseudo-terminal, a planner, and moves that are run slice by slice.

Its thread reads the input, answers real-time commands at once, queues lines while there is room, and advances the
world's clock by one slice of the current move.
"""

from __future__ import annotations

import contextlib
import os
import re
import select
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from pipeline.bench.settings import StageSettings
from tests.support.emulator.world import AXES, SLICE_S, Place, Volts, World, ramp_to

WORD = re.compile(r"([A-Z])([-+]?[\d.]+)")
_PLANNER = 15
_IDLE_S = 0.002
_FULL_S = 1.0


class Terminal:
    """A pseudo-terminal whose other end a driver opens by `name`."""

    def __init__(self) -> None:
        import tty  # of Unix alone

        self._fd, self._other = os.openpty()
        tty.setraw(self._other)  # kept open: a driver that closes its end is no hang-up
        os.set_blocking(self._fd, False)
        self.name = os.ttyname(self._other)
        self.silent = self._unheard = False

    def read(self, *, wait_s: float) -> bytes:
        """Read the bytes received; empty if there are none."""
        ready, _, _ = select.select([self._fd], [], [], wait_s)
        return os.read(self._fd, 4096) if ready else b""

    def write(self, data: bytes) -> None:
        """Send data; if it is not read within a second, it is lost, as on a wire.

        All later data is lost as well until the other end reads again.
        """
        if self.silent:
            return
        until = time.monotonic() + (0.0 if self._unheard else _FULL_S)
        while data:
            try:
                data = data[os.write(self._fd, data) :]
                self._unheard = False
            except BlockingIOError:
                self._unheard = time.monotonic() >= until
                if self._unheard:
                    return
                select.select([], [self._fd], [], 0.05)

    def say(self, line: str) -> None:
        """Send a line."""
        self.write(f"{line}\r\n".encode())

    def close(self) -> None:
        """Close both ends."""
        for fd in (self._fd, self._other):
            with contextlib.suppress(OSError):
                os.close(fd)


class Device(ABC):
    """A board at a pseudo-terminal, at work in a thread of its own.

    Attributes:
        terminal: to be opened by a driver.
    """

    def __init__(self, name: str) -> None:
        self.terminal, self.ended = Terminal(), threading.Event()
        self._thread = threading.Thread(target=self.work, name=name, daemon=True)

    def start(self) -> None:
        """Switch it on."""
        self.boot()
        self._thread.start()

    def close(self) -> None:
        """Switch it off."""
        self.ended.set()
        self._thread.join(5.0)
        self.terminal.close()

    @abstractmethod
    def boot(self) -> None:
        """All forgotten; the greeting."""

    @abstractmethod
    def work(self) -> None:
        """Answer until it is switched off."""


@dataclass(frozen=True)
class Block:
    """A move, or something else that waits its turn.

    Attributes:
        to: machine coordinates that change.
        speed_mm_s: of the move.
        dwell_s: of a wait instead.
        done: called when it has ended.
    """

    to: Place
    speed_mm_s: float = 0.0
    dwell_s: float = 0.0
    done: Callable[[], None] | None = None


class Firmware(Device):
    """An emulated controller.

    Attributes:
        world: that it moves in.
        holding: a feed hold.
        taken: lines taken in so far.
    """

    dwell_unit_s = 1.0
    """Unit of G4."""

    def __init__(self, world: World, stage: StageSettings) -> None:
        super().__init__("emulated controller")
        self.world, self.stage = world, stage
        self._acceleration = stage.acceleration_mm_s2
        self.planner: deque[Block] = deque()
        self._moving: tuple[Block, float, float, Volts, Place] | None = None
        self.received = b""
        self.holding, self.taken = False, 0
        self.relative, self.feed_mm_s = False, 10.0
        self._reset_asked = threading.Event()

    def reset_button(self) -> None:
        """Somebody presses reset, or the supply drops; may be called by any thread."""
        self._reset_asked.set()

    @property
    def busy(self) -> bool:
        """Whether it moves, or is about to."""
        return self._moving is not None or bool(self.planner)

    @abstractmethod
    def at_once(self, data: bytes) -> bytes:
        """Answer what is answered at once; the rest is lines."""

    @abstractmethod
    def take_line(self) -> bool:
        """Take in one line, if there is one and room for it."""

    def forget(self) -> None:
        """Moves and lines."""
        self.planner.clear()
        self._moving, self.received, self.holding = None, b"", False
        self.world.touching = self.relative = False

    def first_line(self) -> str | None:
        """The next line that has come whole; it stays."""
        head, end, _ = self.received.partition(b"\n")
        return head.decode("latin-1").strip() if end else None

    def drop_line(self) -> None:
        """Done with it."""
        self.taken += 1
        self.received = self.received.partition(b"\n")[2]

    @property
    def full(self) -> bool:
        """No room for a move more."""
        return len(self.planner) >= _PLANNER

    def ok(self) -> None:
        """Acknowledge a line."""
        self.terminal.say("ok")

    def home(self) -> None:
        """Plan the way to the ends of all axes, z first; acknowledged at its end."""
        (x, _), (y, _), (_, z) = self.stage.travel_mm
        self.planner.append(Block({"Z": z}, 25.0))
        self.planner.append(Block({"X": x, "Y": y, "A": 0.0}, 25.0, done=self.ok))

    def obey(self, codes: Collection[str], values: dict[str, float]) -> None:
        """Do what both dialects share: modes, the spare output, waits, moves; and acknowledge."""
        if "G90" in codes or "G91" in codes:
            self.relative = "G91" in codes
        if output := {"M8", "M9", "M106", "M107"}.intersection(codes):
            self.world.touching = bool(output & {"M8", "M106"})
        if "G4" in codes:
            self.planner.append(Block({}, dwell_s=self.dwell_unit_s * values["P"], done=self.ok))
            return
        if "G0" in codes or "G1" in codes:
            at = dict(self.world.place_mm)
            for block in ([self._moving[0]] if self._moving else []) + list(self.planner):
                at |= block.to
            self.feed_mm_s = values.get("F", 60.0 * self.feed_mm_s) / 60.0
            to = {k: values[k] + (at[k] if self.relative else 0.0) for k in AXES if k in values}
            spans = dict(zip("XYZ", self.stage.travel_mm, strict=True))
            within = {k: min(max(v, spans[k][0]), spans[k][1]) if k in spans else v for k, v in to.items()}
            if any(abs(within[k] - v) > 1e-6 for k, v in to.items()) and self.refuses_beyond():
                return
            self.planner.append(Block(within, self.feed_mm_s))
        self.ok()

    def refuses_beyond(self) -> bool:
        """Whether a move beyond the travel is refused; else it ends there, and nothing is said of it."""
        return False

    def work(self) -> None:
        while not self.ended.is_set():
            if self._reset_asked.is_set():
                self._reset_asked.clear()
                self.boot()
            idle = self._moving is None and not self.planner and b"\n" not in self.received
            come = self.at_once(self.terminal.read(wait_s=_IDLE_S if idle or self.holding else 0.0))
            self.received += come  # what stood there before may be forgotten meanwhile
            while self.take_line():
                pass
            if not self.holding:
                self._go_on()

    def _go_on(self) -> None:
        """One slice of the move at hand."""
        if self._moving is None:
            if not self.planner:
                return
            block, at = self.planner.popleft(), dict(self.world.place_mm)
            ramp = ramp_to(
                at, block.to, speed_mm_s=max(block.speed_mm_s, 1e-3), acceleration_mm_s2=self._acceleration
            )
            felt = self.world.felt_along(block.to) if block.to else self.world.standing()
            self._moving = (block, 0.0, block.dwell_s or ramp.duration_s, felt, at)
            self._ramp = ramp
        block, run_s, total_s, felt, at = self._moving
        slice_s = min(SLICE_S, total_s - run_s)
        if slice_s > 0.0:
            end = run_s + slice_s
            share = (
                float(self._ramp.at_mm(np.array([end]))[0]) / self._ramp.distance_mm
                if self._ramp.distance_mm
                else 1.0
            )
            self.world.place_mm |= {k: at[k] + share * (v - at[k]) for k, v in block.to.items()}
            ramp = self._ramp
            self._moving = (block, end, total_s, felt, at)
            self.world.pass_time(slice_s, lambda since: felt(ramp.at_mm(run_s + since)))
        if self._moving is not None and self._moving[1] >= total_s - 1e-12:
            self.world.place_mm |= block.to
            self._moving = None
            if block.done is not None:
                block.done()
