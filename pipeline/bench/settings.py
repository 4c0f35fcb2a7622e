"""Settings of a bench, read from bench.toml; lengths in mm, positions in the machine's own coordinates."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.common.parsed import Finite, Strict, read_toml
from pipeline.formats.whisker_file import read_whisker_file
from whisker_array.scan.session import Fitting
from whisker_array.whisker.array import usual_speed_mm_s
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.touch import default_touch

Positive = Annotated[float, Field(gt=0.0, le=1e6, allow_inf_nan=False)]
Span = tuple[Finite, Finite]


class StageSettings(Strict):
    """The stage and its controller."""

    firmware: Literal["grbl", "marlin"]
    port: str = Field(min_length=1)  # serial port, or socket://HOST:PORT
    baud: int = Field(default=115_200, gt=0)
    # machine x, y at which the turning axis (or the middle of the comb) is over the plate's upper left corner (0, 0)
    origin_mm: Span
    flip_x: bool = False  # the machine's axis runs against the plate's
    flip_y: bool = True  # likewise; the plate's y points down
    flip_turn: bool = False  # the turning axis turns against the direction from the plate's x to its y
    turn_axis: Literal["", "A", "B", "C"] = ""  # turns the comb; without one all passes run along +x
    tip_mm: Span = (0.0, 0.0)  # turning axis to middle tip, along the trace and across, at 0 degrees
    land_z_mm: Finite  # machine z at which unloaded tips just reach the land; greater z is higher
    lift_mm: Positive = 5.0  # height above the land at which the tips travel
    travel_mm: tuple[Span, Span, Span]  # least and greatest x, y, z of all moves
    most_preload_mm: Positive = 2.0
    acceleration_mm_s2: Positive = 500.0  # of x and y, as set in the firmware
    rapid_mm_s: Positive = 50.0  # of moves without touch
    lower_mm_s: Positive = 5.0  # of the move down to the land
    answer_s: Positive = 5.0  # longest wait for an answer of the controller
    home_s: Positive = 60.0  # the same for homing

    @model_validator(mode="after")
    def _heights(self) -> StageSettings:
        low, high = self.travel_mm[2]
        if not low < self.land_z_mm - self.most_preload_mm < self.land_z_mm + self.lift_mm <= high:
            raise ValueError(
                "land_z_mm - most_preload_mm and land_z_mm + lift_mm must lie within travel_mm's z"
            )
        return self


class CombSettings(Strict):
    """The whiskers, in a row; `whisker` is a file of `design --out` (default: the default whisker for the height)."""

    n_whiskers: int = Field(default=8, ge=1, le=256)
    pitch_mm: Positive
    character_height_mm: Positive
    whisker: Path | None = None


class PlateSettings(Strict):
    """The field on the plate, from its corner, and the point where a camera's axis meets the plate."""

    field_mm: tuple[Finite, Finite, Finite, Finite]
    camera_mm: Span | None = None

    @model_validator(mode="after")
    def _not_empty(self) -> PlateSettings:
        x0, y0, x1, y1 = self.field_mm
        if not (x1 > x0 and y1 > y0):
            raise ValueError("field_mm is (x0, y0, x1, y1) with x1 > x0 and y1 > y0")
        return self


class DaqSettings(Strict):
    """The converter."""

    kind: Literal["line", "nidaqmx"]  # a microcontroller with the line protocol, on a port, or a card of NI
    port: str = ""
    baud: int = Field(default=2_000_000, gt=0)
    channels: str = ""  # of "nidaqmx", such as Dev1/ai0:7
    sync_channel: str = ""  # analogue input of "nidaqmx" that is wired to the stage's spare output
    rate_hz: Positive = 2000.0
    range_v: Positive = 10.0  # to either side
    volt_per_n_mm: Finite | tuple[Finite, ...] = 1.0  # one, or one a whisker; as `bench calibrate` prints it
    gains_known: bool = False  # the numbers are from `bench calibrate`, not from a data sheet
    answer_s: Positive = 3.0

    @model_validator(mode="after")
    def _check_wiring(self) -> DaqSettings:
        if self.kind == "line" and not self.port:
            raise ValueError('a "line" converter needs its port')
        if self.kind == "nidaqmx" and not (self.channels and self.sync_channel):
            raise ValueError('a "nidaqmx" converter needs channels and sync_channel')
        volts = self.volt_per_n_mm if isinstance(self.volt_per_n_mm, tuple) else (self.volt_per_n_mm,)
        if not volts or not all(v != 0.0 for v in volts):
            raise ValueError("volt_per_n_mm cannot be 0")
        return self


class BenchSettings(Strict):
    """The whole bench."""

    stage: StageSettings
    comb: CombSettings
    plate: PlateSettings
    daq: DaqSettings

    @model_validator(mode="after")
    def _gain_each(self) -> BenchSettings:
        gains = self.daq.volt_per_n_mm
        if isinstance(gains, tuple) and len(gains) != self.comb.n_whiskers:
            raise ValueError(f"{len(gains)} gains in volt_per_n_mm for {self.comb.n_whiskers} whiskers")
        return self

    @property
    def gains_v_per_n_mm(self) -> tuple[float, ...]:
        gains = self.daq.volt_per_n_mm
        return gains if isinstance(gains, tuple) else (gains,) * self.comb.n_whiskers

    def fitting(self, part_id: str = "") -> Fitting:
        """The mounted comb, its speed, and its field in the plate's frame, without gains. Raises FileError."""
        height, path = self.comb.character_height_mm, self.comb.whisker
        built = None if path is None else read_whisker_file(path)
        return Fitting(
            touch=default_touch(height) if built is None else built.touch,
            array=WhiskerArray(self.comb.n_whiskers, self.comb.pitch_mm),
            height_mm=height,
            field_mm=self.plate.field_mm,
            part_id=part_id,
            speed_mm_s=usual_speed_mm_s(height) if built is None else built.speed_mm_s,
        )

    def run_up_mm(self, speed_mm_s: float) -> float:
        return 1.05 * speed_mm_s**2 / (2.0 * self.stage.acceleration_mm_s2) + math.ulp(1.0)


def read_bench(path: Path) -> BenchSettings:
    """Read bench.toml; a whisker's file is named relative to it. Raises FileError: no such TOML, or invalid keys."""
    settings = read_toml(path, BenchSettings)
    if settings.comb.whisker is None:
        return settings
    comb = settings.comb.model_copy(update={"whisker": path.resolve().parent / settings.comb.whisker})
    return settings.model_copy(update={"comb": comb})
