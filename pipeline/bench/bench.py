"""Open a bench, and scan the part on it pass by pass or over a whole region.

* Positions of samples come from the converter's own clock: the stage sets an output while it drags the tips, and its
  acceleration is known. The host's clock is not involved.
* However the block ends, the tips are lifted last: at rest, or after an emergency stop if a pass was interrupted.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Self

import numpy as np

from glyphs.surface.maps import TraceDirection
from pipeline.bench.controller import Controller
from pipeline.bench.firmwares import Grbl, Marlin
from pipeline.bench.line_daq import LineDaq
from pipeline.bench.moves import Moves, check_limits, comb_turn_deg, first_is_last, moves_of
from pipeline.bench.ni_daq import NiDaq
from pipeline.bench.sampling import Record, beyond, samples
from pipeline.bench.settings import BenchSettings
from recognition.active.active_reader import scan_of
from whisker_array.scan.calibration import Calibration, calibrate_lead_in
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import Fitting, StageSession
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.array import LINES_PER_HEIGHT, PIECE_LINES, default_plan
from whisker_array.whisker.passes import Pass

_CONTROLLERS: dict[str, type[Controller]] = {"grbl": Grbl, "marlin": Marlin}


class Bench:
    """Stage and converter, open."""

    def __init__(self, settings: BenchSettings) -> None:
        """Open both ports; nothing moves. Raises MissingExtraError: a library is not installed. StageError: a port
        cannot be opened, or its device does not answer or has another number of channels than the comb has whiskers."""
        self.settings = settings
        self._in_pass = False
        whiskers = settings.comb.n_whiskers
        with contextlib.ExitStack() as until_connected:
            self.daq = LineDaq(settings.daq) if settings.daq.kind == "line" else NiDaq(settings.daq)
            until_connected.callback(self.daq.close)
            if self.daq.whiskers != whiskers:
                what = f"the converter has {self.daq.whiskers} channels for {whiskers} whiskers"
                raise StageError(what, "see [comb] and [daq] of the bench")
            self.stage = _CONTROLLERS[settings.stage.firmware](settings.stage)
            until_connected.callback(self.stage.close)
            self.greeting = self.stage.connect()
            until_connected.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def home(self) -> None:
        self.stage.home()
        check_limits(self.stage.place_mm(), self.settings.stage)
        self.stage.lift()

    def session(self, part_id: str = "") -> BenchSession:
        """Open a session for the part under the whiskers, in the plate's frame; home if needed. Raises StageError."""
        if self.stage.lost:
            self.home()
        return BenchSession(self, self.settings.fitting(part_id))

    def run(self, moves: Moves) -> Record:
        """Run one pass; the tips end lifted. Raises StageError: it failed; the stage is stopped and lifted."""
        self.stage.travel(moves)
        self.daq.start()
        self._in_pass = True
        try:
            self.stage.touch(moves)
            self._in_pass = False
        except StageError:
            self._stop()
            with contextlib.suppress(StageError):
                self.daq.stop()
            raise
        return self.daq.stop()

    def close(self) -> None:
        try:
            if self._in_pass:  # ended by an interrupt
                self._stop()
            elif not self.stage.lost:
                with contextlib.suppress(StageError):
                    self.stage.lift()
        finally:
            self.stage.close()
            self.daq.close()

    def _stop(self) -> None:
        self._in_pass = False
        with contextlib.suppress(StageError):  # the first error is the one to report
            self.stage.stop()

    def calibrate(self, order: Pass) -> Calibration:
        """Measure gains in V per N mm, independent of `volt_per_n_mm`, and offsets in V, in a pass over bare land.
        Raises SensorError: there are too few samples, or a whisker does not touch the land."""
        touch = self.settings.fitting().touch
        moves = moves_of(order, self.settings, preload_mm=touch.preload_mm)
        air, land, _ = samples(self.run(moves), order, moves)
        by_whisker = np.argsort(moves.whisker)
        return calibrate_lead_in(
            air[by_whisker], land[by_whisker], expected_land_moment_n_mm=touch.land_moment_n_mm()
        )


class BenchSession:
    """A `StageSession` over a bench; if gains are known, samples are corrected for them."""

    def __init__(self, bench: Bench, fitting: Fitting) -> None:
        self._bench: Bench | None = bench
        n = fitting.array.n_whiskers
        known = Calibration(np.ones(n), np.zeros(n)) if bench.settings.daq.gains_known else None
        self.fitting: Fitting = replace(fitting, calibration=known)

    def feel(self, order: Pass) -> Sweep:
        """Run one pass. Samples are stored by line, whichever whisker ran on it. Raises StageError: the pass failed."""
        if self._bench is None:
            raise StageError("the part is no longer on the stage", "open a new session for every part")
        settings = self._bench.settings
        moves = moves_of(order, settings, preload_mm=self.fitting.touch.preload_mm)
        air, felt, clipped = samples(self._bench.run(moves), order, moves)
        gain = np.asarray(settings.gains_v_per_n_mm)[list(moves.whisker)][:, None]
        outside = beyond(order, settings.plate.field_mm)
        flags = clipped * np.uint8(SampleFlag.OUT_OF_RANGE) | outside * np.uint8(SampleFlag.OUTSIDE)
        # also subtract the offset: when the comb has turned, another whisker runs on the line
        zero = air.mean(axis=1, keepdims=True) if air.size else 0.0
        return Sweep(
            plan=order.sweep_plan(),
            moment_n_mm=((felt - zero) / gain).astype(np.float32)[None],
            flags=flags[None],
            air_n_mm=((air - zero) / gain).astype(np.float32)[None],
        )

    def close(self) -> None:
        if self._bench is not None and not self._bench.stage.lost:
            with contextlib.suppress(StageError):
                self._bench.stage.lift()
        self._bench = None


def raster_passes(
    fitting: Fitting,
    region_mm: tuple[float, float, float, float],
    directions: Iterable[TraceDirection],
    *,
    each_whisker: bool = False,
) -> tuple[Pass, ...]:
    """Plan the passes of the default raster over (x0, y0, x1, y1), with the mounted comb. With `each_whisker` every
    whisker crosses the whole region, there and back; lines are then in the order of the whiskers."""
    usual = default_plan(
        region_mm, character_height_mm=fitting.height_mm, directions=tuple(directions), speed_mm_s=fitting.speed_mm_s,
        two_way=each_whisker,
        lines_per_height=PIECE_LINES if each_whisker else LINES_PER_HEIGHT,
    )  # fmt: skip
    between = math.ceil(fitting.array.pitch_mm / usual.line_pitch_mm - 1e-9)
    plan = replace(usual, array=fitting.array, line_pitch_mm=fitting.array.pitch_mm / between)
    if not each_whisker:
        return plan.passes()
    return tuple(
        replace(order, line_mm=order.line_mm[::-1]) if first_is_last(comb_turn_deg(order)) else order
        for order in replace(plan, each_whisker=True).passes()
    )


def feel_all(
    session: StageSession,
    passes: Sequence[Pass],
    *,
    on_pass: Callable[[int, Pass], None] = lambda k, order: None,
) -> Scan:
    """Run passes in order; `on_pass` is called after each with its number from 1. Raises StageError: one failed."""
    began, felt = datetime.now(UTC).isoformat(timespec="seconds"), []
    for k, order in enumerate(passes, start=1):
        felt.append(session.feel(order))
        on_pass(k, order)
    return replace(scan_of(session.fitting, felt), start_time=began)
