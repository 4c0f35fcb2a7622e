"""Simulated world of an emulated bench: its clock, the stage's position, the plate and the moments on the whiskers.

The clock advances only while the stage works, so that results do not depend on the load of this machine; `pace` real
seconds pass for one simulated second.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap, TraceDirection
from pipeline.bench.moves import Ramp
from pipeline.bench.settings import BenchSettings
from recognition.see.levelling import level
from whisker_array.scan.mounting import Mounted
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAMPLES_PER_LINE_PITCH
from whisker_array.whisker.passes import SweepPlan

AXES = "XYZA"
SLICE_S = 0.02
Place = dict[str, float]
Volts = Callable[[NDArray[np.float64]], NDArray[np.float64]]
_BEYOND_HEIGHTS = 2.0


@dataclass(frozen=True, eq=False)
class Amplifier:
    """Amplifiers of all whiskers, from moment to volts.

    Attributes:
        gain_v_per_n_mm: (whiskers,) true gains.
        offset_v: (whiskers,) output without a moment.
    """

    gain_v_per_n_mm: NDArray[np.float64]
    offset_v: NDArray[np.float64]


class World:
    """Stage and plate.

    Attributes:
        place_mm: machine coordinates; A in degrees.
        touching: the stage's spare output.
        now_s: simulated time, s.
        amplifier: amplifiers of the whiskers.
        pace: real seconds per simulated second; 0: as fast as possible.
        lock: held while the clock advances.
        sampler: called with every time slice: begin, end, volts at times since the begin.
        watch: called after every slice, to inject faults; must not raise.
        touched: whether tips are on the plate.
    """

    def __init__(
        self, part: HeightMap, bench: BenchSettings, amplifier: Amplifier, *, pace: float = 0.0
    ) -> None:
        """Put the part on the plate.

        Raises:
            MapError: a map that cannot be felt.
        """
        self._bench, self.amplifier, self.pace = bench, amplifier, pace
        self._touch = bench.fitting().touch
        self._step_mm = bench.comb.character_height_mm / (LINES_PER_HEIGHT * SAMPLES_PER_LINE_PITCH)
        self._part = Mounted(
            on_plate(level(part), bench),
            touches=(self._touch,),
            sample_pitch_mm=self._step_mm,
            beyond_mm=_BEYOND_HEIGHTS * bench.comb.character_height_mm + bench.run_up_mm(50.0),
            friction=self._touch.friction,
        )
        low = [span[0] for span in bench.stage.travel_mm]
        self.place_mm: Place = dict(
            zip(AXES, (low[0], low[1], bench.stage.land_z_mm + 1.0, 0.0), strict=True)
        )
        self.touching, self.now_s, self.lock = False, 0.0, threading.RLock()
        self.sampler: Callable[[float, float, bool, Volts], None] | None = None
        self.watch: Callable[[World], None] | None = None

    @property
    def touched(self) -> bool:
        """Whether tips are on the plate."""
        return self.place_mm["Z"] < self._bench.stage.land_z_mm

    def felt_along(self, to: Place) -> Volts:
        """Whisker signals on a move to a place: a function of distances run (n,) that returns volts (n, whiskers)."""
        begin, x, y = dict(self.place_mm), to.get("X"), to.get("Y")
        start, end = (
            self._plate(begin),
            self._plate({**begin, **{k: v for k, v in (("X", x), ("Y", y)) if v is not None}}),
        )
        preload = self._bench.stage.land_z_mm - begin["Z"]
        length = math.dist(start, end)
        if preload <= 0.0 or length < self._step_mm or to.get("Z", begin["Z"]) != begin["Z"]:
            return lambda run_mm: self._volts(np.full((run_mm.size, self._n), self._still(preload)))
        moment = self._dragged(start, end, preload, length)
        grid = self._step_mm * np.arange(moment.shape[1])
        return lambda run_mm: self._volts(np.column_stack([np.interp(run_mm, grid, m) for m in moment]))

    def standing(self) -> Volts:
        """Whisker signals at rest, as the same kind of function."""
        still = self._still(self._bench.stage.land_z_mm - self.place_mm["Z"])
        return lambda run_mm: self._volts(np.full((run_mm.size, self._n), still))

    def pass_time(self, seconds: float, volts: Volts) -> None:
        """Advance the clock by one slice."""
        with self.lock:
            if self.sampler is not None:
                self.sampler(self.now_s, self.now_s + seconds, self.touching, volts)
            self.now_s += seconds
        if self.pace:
            time.sleep(self.pace * seconds)
        if self.watch is not None:
            self.watch(self)

    @property
    def _n(self) -> int:
        return self._bench.comb.n_whiskers

    def _still(self, preload_mm: float) -> float:
        return self._touch.land_moment_n_mm() * max(0.0, preload_mm) / self._touch.preload_mm

    def _volts(self, moment: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(moment * self.amplifier.gain_v_per_n_mm + self.amplifier.offset_v)

    def _plate(self, place: Place) -> tuple[float, float]:
        """Plate x, y of the middle tip."""
        stage = self._bench.stage
        x = (place["X"] - stage.origin_mm[0]) * (-1.0 if stage.flip_x else 1.0)
        y = (place["Y"] - stage.origin_mm[1]) * (-1.0 if stage.flip_y else 1.0)
        turned = complex(*stage.tip_mm) * np.exp(1j * math.radians(self._turn(place)))
        return x + float(turned.real), y + float(turned.imag)

    def _turn(self, place: Place) -> float:
        return -place["A"] if self._bench.stage.flip_turn else place["A"]

    def _dragged(
        self, start: tuple[float, float], end: tuple[float, float], preload_mm: float, length_mm: float
    ) -> NDArray[np.float64]:
        """(whiskers, steps) moments along a straight drag."""
        way = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
        direction = TraceDirection(round(way / 90.0) * 90 % 360)
        turn = self._turn(self.place_mm)
        across = complex(0.0, 1.0) * np.exp(1j * math.radians(turn))
        stands = self._bench.comb.pitch_mm * (np.arange(self._n) - 0.5 * (self._n - 1))
        tips = complex(*start) + across * stands
        lines, along = (tips.imag, start[0]) if direction.along_x else (tips.real, start[1])
        plan = SweepPlan(
            direction=direction,
            line_mm=np.asarray(lines)[None],
            start_mm=along,
            step_mm=self._step_mm,
            n_samples=math.ceil(length_mm / self._step_mm) + 1,
            n_lead=0,
            pushed=round(turn - int(direction)) % 360 == 180,
        )
        felt = self._part.feel(plan, air_samples=0, sample_rate_hz=1.0, preload_mm=preload_mm)
        return np.asarray(np.nan_to_num(felt.moment_n_mm[0].astype(np.float64)))


def on_plate(part: HeightMap, bench: BenchSettings) -> HeightMap:
    """A part in the middle of a plate as large as the bench's field, its rim gone on; a larger one stays as it is."""
    _, _, width, height = bench.plate.field_mm
    rows, cols = part.shape
    lacking = [max(0, math.ceil(size / part.pitch_mm) + 1 - n) for size, n in ((height, rows), (width, cols))]
    around = [(one // 2, one - one // 2) for one in lacking]
    return HeightMap(np.pad(part.z_mm, around, mode="edge"), part.pitch_mm)


def ramp_to(place: Place, to: Place, *, speed_mm_s: float, acceleration_mm_s2: float) -> Ramp:
    """A straight move from one place to another."""
    return Ramp(math.sqrt(sum((v - place[k]) ** 2 for k, v in to.items())), speed_mm_s, acceleration_mm_s2)
