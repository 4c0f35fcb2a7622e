"""Convert a pass on the plate to moves of the machine within its limits.

::

    machine y                       plate (0, 0) ---> x                 a pass along 0 degrees, from above
        ^                            |                                  run-up |lead| felt |lead| run-out
        |      origin_mm = machine   v y                                 o---->|====|======|====|---->o
        +---> x        x, y here                                         down                         up

The comb turns with the trace: at 0 and 270 degrees its first whisker has the least coordinate across, at 90 and 180 the
greatest; `Moves.whisker` has the whisker of each line.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.settings import BenchSettings, StageSettings
from whisker_array.scan.stage_error import StageError
from whisker_array.whisker.passes import Pass

_COMB_TOLERANCE_MM = 0.01
_AXES = "XYZ"


@dataclass(frozen=True)
class Ramp:
    """A move from rest to rest.

    ::

        speed |    ______________
              |   /              \\          all of it within distance_mm
              |__/                \\____
    """

    distance_mm: float
    speed_mm_s: float
    acceleration_mm_s2: float

    @property
    def peak_mm_s(self) -> float:
        return min(self.speed_mm_s, math.sqrt(self.distance_mm * self.acceleration_mm_s2))

    @property
    def duration_s(self) -> float:
        peak = self.peak_mm_s
        return self.distance_mm / peak + peak / self.acceleration_mm_s2 if peak > 0.0 else 0.0

    def at_mm(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance after each time, from 0 to the whole."""
        peak, total = self.peak_mm_s, self.duration_s
        if total == 0.0:
            return np.zeros_like(time_s)
        t = np.clip(time_s, 0.0, total)
        up = peak / self.acceleration_mm_s2
        early = 0.5 * self.acceleration_mm_s2 * np.minimum(t, up) ** 2
        late = 0.5 * self.acceleration_mm_s2 * np.maximum(t - (total - up), 0.0) ** 2
        return np.asarray(early + peak * np.maximum(t - up, 0.0) - late)


@dataclass(frozen=True)
class Moves:
    """Machine moves of one pass."""

    begin_mm: tuple[float, float]  # machine x, y of the start of the move that touches
    end_mm: tuple[float, float]  # and of its end
    touch_z_mm: float  # machine z
    lift_z_mm: float
    turn_deg: float
    ramp: Ramp  # of the speed of the move that touches
    first_mm: float  # distance from the start of that move to the first sample of the pass
    whisker: tuple[int, ...]  # the one that runs on each line of the pass
    speed_mm_s: float  # while touching
    air_s: float  # time lifted, for the air samples


def comb_turn_deg(order: Pass) -> int:
    """Turn of the comb for a pass, degrees."""
    return (int(order.direction) + (180 if order.pushed else 0)) % 360


def first_is_last(turn_deg: int) -> bool:
    """Whether the first whisker of a turned comb has the greatest coordinate across the trace."""
    return turn_deg in (90, 180)


def moves_of(order: Pass, bench: BenchSettings, *, preload_mm: float) -> Moves:
    """Compute the machine moves of a pass in the plate's frame; `preload_mm` is for one without a preload.
    Raises StageError: this comb or stage cannot run the pass, or it exceeds a limit."""
    stage = bench.stage
    turn = comb_turn_deg(order)
    if turn and not stage.turn_axis:
        raise StageError(
            f"a pass along {int(order.direction)} degrees needs a comb that turns, and the stage has no turn_axis",
            "scan with --directions 0",
        )
    preload = order.preload_mm if order.preload_mm is not None else preload_mm
    if preload > stage.most_preload_mm:
        raise StageError(
            f"a preload of {preload:.2f} mm is over the limit of {stage.most_preload_mm:.2f} mm",
            "see most_preload_mm of [stage]",
        )
    whisker, across = _comb(order, bench, turn)
    # run the pass slower if the converter is too slow for it
    speed = min(order.speed_mm_s, bench.daq.rate_hz * order.sample_pitch_mm)
    up = bench.run_up_mm(speed) + order.sample_pitch_mm
    sign = -1.0 if order.direction.backward else 1.0
    felt = (order.n_samples - 1) * order.sample_pitch_mm + order.stagger_mm
    ends = (order.start_mm - sign * up, order.start_mm + sign * (felt + up))
    tips = [(e, across) if order.direction.along_x else (across, e) for e in ends]
    begin, end = (_machine(tip, stage, turn) for tip in tips)
    moves = Moves(
        begin_mm=begin,
        end_mm=end,
        touch_z_mm=stage.land_z_mm - preload,
        lift_z_mm=stage.land_z_mm + stage.lift_mm,
        turn_deg=float(-turn if stage.flip_turn else turn),
        ramp=Ramp(felt + 2.0 * up, speed, stage.acceleration_mm_s2),
        first_mm=up,
        whisker=whisker,
        speed_mm_s=speed,
        air_s=(order.air_samples + 4) / (speed / order.sample_pitch_mm) if order.air_samples else 0.0,
    )
    for x, y in (begin, end):
        check_limits((x, y, moves.touch_z_mm), stage)
        check_limits((x, y, moves.lift_z_mm), stage)
    return moves


def _comb(order: Pass, bench: BenchSettings, turn: int) -> tuple[tuple[int, ...], float]:
    n, pitch = bench.comb.n_whiskers, bench.comb.pitch_mm
    lines = np.asarray(order.line_mm)
    middle = float(lines.mean())
    way = -1.0 if first_is_last(turn) else 1.0
    stands = middle + way * pitch * (np.arange(n) - 0.5 * (n - 1))
    if lines.size == n:
        whisker = np.abs(lines[:, None] - stands).argmin(axis=1)
        if (
            np.abs(lines - stands[whisker]).max() < _COMB_TOLERANCE_MM
            and np.unique(whisker).size == n
            and not any(order.offset_mm)
        ):
            return tuple(int(w) for w in whisker), middle
    raise StageError(
        f"the pass needs another comb than {n} whiskers {pitch:g} mm apart", "plan it for this comb"
    )


def _machine(tip_mm: tuple[float, float], stage: StageSettings, turn: int) -> tuple[float, float]:
    """Machine x, y of the turning axis at which the middle tip is over a point of the plate."""
    offset = complex(*stage.tip_mm) * cmath.rect(1.0, math.radians(turn))
    x, y = tip_mm[0] - offset.real, tip_mm[1] - offset.imag
    origin = stage.origin_mm
    return (origin[0] + (-x if stage.flip_x else x), origin[1] + (-y if stage.flip_y else y))


def check_limits(place_mm: Sequence[float], stage: StageSettings) -> None:
    """Refuse a position beyond the stage's travel (StageError)."""
    for name, value, (low, high) in zip(_AXES, place_mm, stage.travel_mm, strict=True):
        if not low <= value <= high:
            raise StageError(
                f"{name} {value:.2f} mm lies beyond the stage's travel, {low:g} to {high:g} mm",
                "scan a smaller region, or see origin_mm and travel_mm of [stage]",
            )
