"""From an open recording to a Scan: every name, shape, size and number is checked before it is used.

The layout is that of `whisker_array.scan.recording`.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.surface.maps import TraceDirection
from whisker_array.scan.calibration import Calibration, apply_calibration
from whisker_array.scan.checked import SEE_LAYOUT, CheckedFile, text_attribute
from whisker_array.scan.felt_sweep import Sweep
from whisker_array.scan.log_file import GROUP, read_log
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import SensorMemory
from whisker_array.scan.session import gathered
from whisker_array.scan.stagger import as_laid
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.defaults import NOMINAL_FRICTION
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch

FORMAT = "tactile-marks-scan"
FORMAT_VERSION = 1
VOLT = "V"
UNIT_N_MM = {"N*mm": 1.0, "mN*m": 1.0, "N*m": 1000.0}
_LARGEST_TABLE = 10_000_000
_DIRECTIONS = tuple(int(d) for d in TraceDirection)


Rows = NDArray[np.intp]


class Recorded(CheckedFile):
    """One pass through one open file."""

    def __init__(self, path: Path, file: h5py.File, raw: bool) -> None:
        super().__init__(path, file)
        self.raw = raw
        self._offset_mm: tuple[float, ...] = ()

    def scan(self) -> Scan:
        """The whole file as a Scan.

        Raises:
            FileError: anything not according to the layout.
        """
        self._check_format()
        units = text_attribute(self.file.attrs, "units", "N*mm")
        if units not in (*UNIT_N_MM, VOLT):
            raise self.fail(f"units are {units!r}", f"use one of {', '.join([*UNIT_N_MM, VOLT])}")
        signal = self.dataset("scan/signal", (None, None))
        n_rows, n_channels = signal.shape
        direction = self.numbers("passes/direction_deg", (None,), most=_LARGEST_TABLE)
        if not np.isin(direction, _DIRECTIONS).all():
            raise self.fail("/passes/direction_deg holds other values than 0, 90, 180 and 270")
        lines = self.numbers("passes/line_mm", (direction.size, None), most=_LARGEST_TABLE)
        columns = self._columns(n_channels, lines.shape[1])
        calibration = None if self.raw else self._calibration(lines.shape[1], volt=units == VOLT)
        kind, touches = self._kinds(lines.shape[1])
        self._offset_mm = self._offsets(lines.shape[1])
        pushed = self._pushed(direction.size)
        rate = self.attribute(self.file.attrs, "sampling_rate_hz")
        rows = self._rows(n_rows, direction.size)
        moment, flags = self._moments(signal, columns, UNIT_N_MM.get(units, 1.0))
        if calibration is not None and units == VOLT:
            moment = apply_calibration(moment.T, calibration).T
            # the signal is in N mm now; how the gauges creep is still to be known of it
            calibration = None if calibration.memory is None else calibration.applied()
        ways, log = list(zip(direction.tolist(), pushed.tolist(), strict=True)), None
        if GROUP in self.file:
            members = [(way, np.array([k])) for k, way in enumerate(ways)]
        else:
            members = [
                (way, np.flatnonzero((direction == way[0]) & (pushed == way[1])))
                for way in dict.fromkeys(ways)
            ]
        sweeps = tuple(
            self._sweep(TraceDirection(int(d)), p, of, lines, rows, moment, flags) for (d, p), of in members
        )
        if GROUP in self.file:
            log, sweeps = read_log(self, sweeps), self._gathered(sweeps)
        pitch = self.attribute(self.file.attrs, "line_pitch_mm", line_pitch_of(sweeps))
        try:
            return Scan(
                sweeps=sweeps,
                touch=touches[0],
                line_pitch_mm=pitch,
                sample_rate_hz=rate,
                calibration=calibration,
                part_id=text_attribute(self.file.attrs, "part_id", ""),
                start_time=text_attribute(self.file.attrs, "start_time", ""),
                fidelity=text_attribute(self.file.attrs, "fidelity", "measured"),
                notes=tuple(str(n) for n in np.atleast_1d(self.file.attrs.get("notes", ()))),
                others=touches[1:],
                kind=kind,
                log=log,
            )
        except MarksError as error:
            raise self.fail(error.what, error.hint or SEE_LAYOUT) from error

    def _gathered(self, sweeps: tuple[Sweep, ...]) -> tuple[Sweep, ...]:
        try:
            return gathered(sweeps)
        except ValueError as error:
            raise self.fail(str(error), "give all passes of a direction one step_mm") from error

    def _check_format(self) -> None:
        if text_attribute(self.file.attrs, "format", "") != FORMAT:
            raise self.fail(f"is not a scan (its attribute `format` is not {FORMAT!r})")
        version = self.attribute(self.file.attrs, "format_version")
        if version > FORMAT_VERSION:
            raise self.fail(f"is of the newer format version {version:g}", "update tactile-marks to read it")
        if version != FORMAT_VERSION:
            raise self.fail(f"format_version is {version:g}", f"it must be {FORMAT_VERSION}")

    def _columns(self, n_channels: int, n_whiskers: int) -> NDArray[np.intp]:
        """Column of each whisker."""
        if "channels/whisker" in self.file:
            whisker = self.numbers("channels/whisker", (n_channels,)).astype(int)
        else:
            whisker = np.arange(n_channels)
        columns = np.argsort(whisker, kind="stable")[np.sum(whisker < 0) :]
        if not np.array_equal(whisker[columns], np.arange(n_whiskers)):
            raise self.fail(
                f"/scan/signal has {n_channels} channels of whiskers {whisker.tolist()[:20]}, "
                f"and /passes/line_mm {n_whiskers} whiskers",
                "number them 0, 1, 2, ... in /channels/whisker; -1 marks a channel that is not a whisker",
            )
        return columns

    def _calibration(self, n_whiskers: int, *, volt: bool) -> Calibration | None:
        if "calibration/gain" not in self.file:
            if volt:
                raise self.fail(
                    "is in volts without a calibration", "run `tactile-marks calibrate` on it first"
                )
            return None
        gain = self.numbers("calibration/gain", (n_whiskers,))
        offset = self.numbers("calibration/offset_v" if volt else "calibration/offset_n_mm", (n_whiskers,))
        try:
            from_land = bool(self.file["calibration"].attrs.get("from_land", False))
            memory = self._memory(n_whiskers) if "calibration/memory" in self.file else None
            return Calibration(gain=gain, offset_n_mm=offset, from_land=from_land, memory=memory)
        except MarksError as error:
            raise self.fail(f"calibration cannot be used: {error.what}", "calibrate it again") from error

    def _memory(self, n_whiskers: int) -> SensorMemory:
        """How the gauges creep and lag."""
        at = "calibration/memory"
        return SensorMemory(
            creep=self.numbers(f"{at}/creep", (n_whiskers, None), most=_LARGEST_TABLE),
            relax_s=self.numbers(f"{at}/relax_s", (None,), most=_LARGEST_TABLE),
            play_weight=self.numbers(f"{at}/play_weight", (n_whiskers, None), most=_LARGEST_TABLE),
            play_n_mm=self.numbers(f"{at}/play_n_mm", (None,), most=_LARGEST_TABLE),
            largest_n_mm=self.attribute(self.file[at].attrs, "largest_n_mm"),
        )

    def _kinds(self, n_whiskers: int) -> tuple[tuple[int, ...], tuple[Touch, ...]]:
        """Kind of each whisker, and the touch of each kind."""
        if "whisker/kind" not in self.file:
            return (), (self._touch("whisker"),)
        kind = self.integers("whisker/kind", n_whiskers)
        if kind.min() < 0 or not np.array_equal(np.unique(kind), np.arange(kind.max() + 1)):
            raise self.fail("/whisker/kind does not number the kinds of whisker 0, 1, 2, ...")
        names = ["whisker", *(f"whisker_{i}" for i in range(1, int(kind.max()) + 1))]
        return tuple(int(k) for k in kind), tuple(self._touch(name) for name in names)

    def _offsets(self, n_whiskers: int) -> tuple[float, ...]:
        """How far behind whisker 0 each stands; empty where the file does not say."""
        if "whisker/offset_mm" not in self.file:
            return ()
        offset = self.numbers("whisker/offset_mm", (n_whiskers,))
        if offset[0] != 0.0 or offset.min() < 0.0:
            raise self.fail(
                f"/whisker/offset_mm is {offset[0]:g} mm for whisker 0, and {offset.min():g} mm at least",
                "count offsets from whisker 0, which is to stand in the foremost row",
            )
        return tuple(float(v) for v in offset)

    def _pushed(self, n_passes: int) -> NDArray[np.bool_]:
        if "passes/pushed" not in self.file:
            return np.zeros(n_passes, dtype=np.bool_)
        return np.asarray(self.integers("passes/pushed", n_passes) != 0)

    def _touch(self, group: str) -> Touch:
        compliance = self.numbers(f"{group}/compliance_mm_per_n", (3, 3))
        arm = self.numbers(f"{group}/moment_arm_mm", (3,))
        attributes = self.file[group].attrs
        try:
            return Touch(
                tip=TipModel(compliance_mm_per_n=compliance, moment_arm_mm=arm),
                preload_mm=self.attribute(attributes, "preload_mm"),
                tip_radius_mm=self.attribute(attributes, "tip_radius_mm", 0.0),
                friction=self.attribute(attributes, "friction", NOMINAL_FRICTION),
                whisker=text_attribute(attributes, "description", ""),
            )
        except WhiskerError as error:
            raise self.fail(f"its whisker is not possible: {error.what}", error.hint or SEE_LAYOUT) from error

    def _rows(self, n_rows: int, n_passes: int) -> list[tuple[Rows, Rows]]:
        """For each pass its rows in the air and its touching rows, in time order."""
        number = self.integers("stage/pass", n_rows)
        if number.max() >= n_passes:
            raise self.fail(
                f"/stage/pass names pass {number.max()}, /passes has {n_passes} (0 to {n_passes - 1})"
            )
        phase = (
            self.integers("stage/phase", n_rows) if "stage/phase" in self.file else np.ones(n_rows, np.uint8)
        )
        order = np.argsort(number, kind="stable")
        ends = np.searchsorted(number[order], np.arange(n_passes + 1))
        passes = [order[a:b] for a, b in pairwise(ends)]
        return [(rows[phase[rows] == 0], rows[phase[rows] == 1]) for rows in passes]

    def _moments(
        self, signal: h5py.Dataset, columns: Rows, unit_n_mm: float
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """(rows, whiskers) moment and flags; a moment that is not finite is 0 and flagged."""
        scale = self.attribute(self.file.attrs, "scale_factor", 1.0) * unit_n_mm
        shift = self.attribute(self.file.attrs, "add_offset", 0.0) * unit_n_mm
        moment = signal[()].astype(np.float32, copy=False)[:, columns]
        if scale != 1.0 or shift != 0.0:
            moment = (moment * np.float64(scale) + shift).astype(np.float32)
        flags = np.zeros(moment.shape, np.uint8)
        if "scan/flags" in self.file:
            flags = self.dataset("scan/flags", signal.shape)[()].astype(np.uint8)[:, columns]
        bad = ~np.isfinite(moment)
        moment[bad] = 0.0
        flags[bad] |= np.uint8(SampleFlag.OUT_OF_RANGE)
        return moment, flags

    def _sweep(
        self,
        direction: TraceDirection,
        pushed: bool,
        members: Rows,
        lines: NDArray[np.float64],
        rows: list[tuple[Rows, Rows]],
        moment: NDArray[np.float32],
        flags: NDArray[np.uint8],
    ) -> Sweep:
        """All passes in one direction."""
        counts = sorted({rows[p][1].size for p in members})
        if len(counts) > 1 or counts[0] < 2:
            raise self.fail(
                f"passes in direction {int(direction)} deg have {counts[0]} to {counts[-1]} touching samples",
                "give all passes of a direction the same number, at least 2",
            )
        touching = np.stack([rows[p][1] for p in members])
        n_air = min(rows[p][0].size for p in members)
        air = np.stack([rows[p][0][:n_air] for p in members])
        start, step = self._along(direction, members, touching)
        behind = np.asarray(self._offset_mm or (0.0,) * lines.shape[1]) / step
        whole = np.rint(behind)
        behind = np.where(np.abs(behind - whole) <= 1e-3 * np.maximum(1.0, whole), whole, behind)
        n_samples = counts[0] - int(np.ceil(behind.max(initial=0.0)))
        if n_samples < 2:
            raise self.fail(
                f"passes in direction {int(direction)} deg are shorter than the rows' offsets",
                "the array runs on until its last row has felt the part; see /whisker/offset_mm",
            )
        n_lead = 0
        if "passes/n_lead" in self.file:
            n_lead = int(self.numbers("passes/n_lead", (len(rows),))[members].min())
            if not 0 <= 2 * n_lead < n_samples:
                raise self.fail(
                    f"/passes/n_lead is {n_lead} of {n_samples} samples", "it counts those before the marks"
                )
        plan = SweepPlan(
            direction=direction,
            line_mm=lines[members],
            start_mm=start,
            step_mm=step,
            n_samples=n_samples,
            n_lead=n_lead,
            pushed=pushed,
            offset_mm=tuple(float(v) for v in whole * step) if whole.any() else (),
        )
        return Sweep(
            plan=plan,
            moment_n_mm=np.ascontiguousarray(as_laid(moment[touching].transpose(0, 2, 1), behind)),
            flags=np.ascontiguousarray(as_laid(flags[touching].transpose(0, 2, 1), behind)),
            air_n_mm=np.ascontiguousarray(moment[air].transpose(0, 2, 1)),
        )

    def _along(self, direction: TraceDirection, members: Rows, touching: Rows) -> tuple[float, float]:
        """Start and step along the trace, as stated for the passes or else by the stage's positions."""
        n_passes = int(self.file["passes/direction_deg"].shape[0])
        if "passes/start_mm" in self.file and "passes/step_mm" in self.file:
            starts = self.numbers("passes/start_mm", (n_passes,))[members]
            steps = self.numbers("passes/step_mm", (n_passes,))[members]
            step = float(steps[0]) if np.ptp(steps) == 0.0 else float(steps.mean())
            uneven = float(np.abs(steps - step).max()) * touching.shape[1]
        elif "stage/position_mm" in self.file:
            position = self.numbers("stage/position_mm", (self.file["stage/pass"].shape[0], 2))
            along = position[touching, 0 if direction.along_x else 1]
            sign = -1.0 if direction.backward else 1.0
            step = sign * float((along[:, -1] - along[:, 0]).mean()) / (along.shape[1] - 1)
            even = along[:, :1] + sign * step * np.arange(along.shape[1])
            starts, uneven = along[:, 0], float(np.abs(along - even).max())
        else:
            raise self.fail("has neither /passes/start_mm and step_mm nor /stage/position_mm")
        if not step > 0.0:
            raise self.fail(
                f"the samples of direction {int(direction)} deg are {step} mm apart",
                "positions grow in directions 0 and 90 and fall in 180 and 270; step_mm is positive",
            )
        start = float(starts[0]) if np.ptp(starts) == 0.0 else float(starts.mean())
        if max(uneven, float(np.abs(starts - start).max())) > step:
            raise self.fail(
                f"the samples of direction {int(direction)} deg do not lie evenly, and alike in all passes",
                "take them at even steps from one start, or resample them so",
            )
        return start, step


def line_pitch_of(sweeps: tuple[Sweep, ...]) -> float:
    """Distance of neighbouring lines of the first sweep."""
    gaps = np.diff(np.unique(np.round(sweeps[0].plan.line_mm, 6)))
    return float(np.median(gaps)) if gaps.size else sweeps[0].plan.step_mm
