"""Settings of a bench, read from bench.toml; lengths in mm, positions in the machine's own coordinates."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.common.parsed import Finite, Strict, read_toml
from pipeline.formats.whisker_file import read_whisker_file
from whisker_array.scan.session import Fitting
from whisker_array.whisker.array import WhiskerArray
from whisker_array.whisker.touch import Touch, default_touch

Positive = Annotated[float, Field(gt=0.0, le=1e6, allow_inf_nan=False)]
Span = tuple[Finite, Finite]


class StageSettings(Strict):
    """The stage and its controller.

    Attributes:
        port: serial port, or socket://HOST:PORT.
        origin_mm: machine x, y at which the turning axis (the middle of the comb, without one) is over the plate's
            (0, 0), its upper left corner.
        flip_x, flip_y: the machine's axis runs against the plate's, whose y points down.
        flip_turn: the turning axis turns against the direction from the plate's x to its y.
        turn_axis: letter of the axis that turns the comb; without one only passes along +x are possible.
        tip_mm: offset from the turning axis to the middle tip, along the trace and across, at 0 degrees.
        land_z_mm: machine z at which unloaded tips just reach the land; greater z is higher.
        lift_mm: height above the land at which the tips travel.
        travel_mm: least and greatest x, y, z of all moves.
        acceleration_mm_s2: of x and y, as set in the firmware.
        rapid_mm_s, lower_mm_s: speed of moves without touch, and of the move down to the land.
        answer_s: longest wait for an answer of the controller; `home_s` for homing.
    """

    firmware: Literal["grbl", "marlin"]
    port: str = Field(min_length=1)
    baud: int = Field(default=115_200, gt=0)
    origin_mm: Span
    flip_x: bool = False
    flip_y: bool = True
    flip_turn: bool = False
    turn_axis: Literal["", "A", "B", "C"] = ""
    tip_mm: Span = (0.0, 0.0)
    land_z_mm: Finite
    lift_mm: Positive = 5.0
    travel_mm: tuple[Span, Span, Span]
    most_preload_mm: Positive = 2.0
    acceleration_mm_s2: Positive = 500.0
    rapid_mm_s: Positive = 50.0
    lower_mm_s: Positive = 5.0
    answer_s: Positive = 5.0
    home_s: Positive = 60.0

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
    """The converter.

    Attributes:
        kind: "line": a microcontroller with the line protocol, on a port; "nidaqmx": a card of NI.
        channels: channels of "nidaqmx", such as Dev1/ai0:7.
        sync_channel: analogue input of "nidaqmx" that is wired to the stage's spare output.
        rate_hz: samples a second.
        range_v: range to either side, V.
        volt_per_n_mm: one number, or one for each whisker, as `bench calibrate` prints them.
        gains_known: the numbers are from `bench calibrate`, not from a data sheet.
        answer_s: longest wait for an answer.
    """

    kind: Literal["line", "nidaqmx"]
    port: str = ""
    baud: int = Field(default=2_000_000, gt=0)
    channels: str = ""
    sync_channel: str = ""
    rate_hz: Positive = 2000.0
    range_v: Positive = 10.0
    volt_per_n_mm: Finite | tuple[Finite, ...] = 1.0
    gains_known: bool = False
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

    def touch(self) -> Touch:
        """The mounted whiskers. Raises FileError: the whisker's file cannot be used."""
        if self.comb.whisker is not None:
            return read_whisker_file(self.comb.whisker).touch
        return default_touch(self.comb.character_height_mm)

    def fitting(self, part_id: str = "") -> Fitting:
        """The mounted comb and its field in the plate's frame; the session supplies the gains."""
        return Fitting(
            touch=self.touch(),
            array=WhiskerArray(self.comb.n_whiskers, self.comb.pitch_mm),
            height_mm=self.comb.character_height_mm,
            field_mm=self.plate.field_mm,
            part_id=part_id,
        )

    def run_up_mm(self, speed_mm_s: float) -> float:
        """Distance within which the stage reaches a speed."""
        return 1.05 * speed_mm_s**2 / (2.0 * self.stage.acceleration_mm_s2) + math.ulp(1.0)


def read_bench(path: Path) -> BenchSettings:
    """Read bench.toml; a whisker's file is named relative to it. Raises FileError: no such TOML, or invalid keys."""
    settings = read_toml(path, BenchSettings)
    if settings.comb.whisker is None:
        return settings
    comb = settings.comb.model_copy(update={"whisker": path.resolve().parent / settings.comb.whisker})
    return settings.model_copy(update={"comb": comb})
