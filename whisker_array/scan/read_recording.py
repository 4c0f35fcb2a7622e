"""Read an open recording (`whisker_array.scan.recording`) as a Scan; everything is checked before use."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from whisker_array.arrays import Floats
from whisker_array.scan.calibration import Calibration, apply_calibration
from whisker_array.scan.checked_file import CheckedFile
from whisker_array.scan.pass_log_file import GROUP, read_log
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import gather_sweeps
from whisker_array.scan.stagger import to_places
from whisker_array.scan.sweep import Sweep, fill_air
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.defaults import NOMINAL_FRICTION
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch

FORMAT = "tactile-marks-scan"
FORMAT_VERSION = 1
VOLT = "V"
UNIT_N_MM = {"N*mm": 1.0, "mN*m": 1.0, "N*m": 1000.0}
OVERLOAD = 1e29
"""Least value that is no reading: SCPI instruments write 9.9e37 for an overload and 9.91e37 for none, others 1e30."""
SPEEDS_MM_S = (0.2, 2000.0)
"""Least and greatest speed of a tracing stage; outside them positions or times are in another unit."""
_LARGEST_TABLE = 10_000_000

Rows = NDArray[np.intp]


class RecordingReader(CheckedFile):
    """Reader of one open recording; `raw` ignores the calibration and leaves signals in volts."""

    def __init__(self, path: Path, file: h5py.File, *, raw: bool) -> None:
        super().__init__(path, file)
        self.raw = raw
        self._check_format()
        self._direction = self.numbers("passes/direction_deg", (None,), most=_LARGEST_TABLE)
        self._n_passes = self._direction.size
        self._lines = self.numbers("passes/line_mm", (self._n_passes, None), most=_LARGEST_TABLE)
        self._n_whiskers = self._lines.shape[1]
        ways = np.isin(self._direction, list(TraceDirection)).all()
        self.require(ways, "/passes/direction_deg holds values other than 0, 90, 180 and 270")
        self._pushed = self.integers("passes/pushed", self._n_passes, default=0) != 0

    def scan(self) -> Scan:
        units = self.text("units", "N*mm")
        known = (*UNIT_N_MM, VOLT)
        self.require(units in known, f"units are {units!r}", f"use one of {', '.join(known)}")
        self._moment, self._flags = self._moments(UNIT_N_MM.get(units, 1.0))
        calibration = None if self.raw else self._calibration(volt=units == VOLT)
        if calibration is not None and units == VOLT:
            self._moment = apply_calibration(self._moment.T, calibration).T
            calibration = None  # the signal is in N mm now
        kind, touches = self._kinds()
        self._rows, self._offset_mm = self._rows_of_passes(), self._offsets()
        # passes of a log stay single; otherwise those of one direction, dragged or pushed, form a sweep
        log, is_logged = None, GROUP in self.file
        groups: defaultdict[object, list[int]] = defaultdict(list)
        for k, way in enumerate(zip(self._direction, self._pushed, strict=True)):
            groups[k if is_logged else way].append(k)
        sweeps = tuple(self._sweep(np.array(members)) for members in groups.values())
        if is_logged:
            log = read_log(self, sweeps)
            try:
                sweeps = gather_sweeps(sweeps)
            except ValueError as error:
                raise self.fail(str(error), "give all passes of a direction one step_mm") from error
        with self.naming():
            return Scan(
                sweeps=sweeps,
                touch=touches[0],
                line_pitch_mm=self.attribute("line_pitch_mm", line_pitch_of(sweeps)),
                sample_rate_hz=self.attribute("sampling_rate_hz"),
                calibration=calibration,
                part_id=self.text("part_id"),
                start_time=self.text("start_time"),
                fidelity=self.text("fidelity", "measured"),
                notes=tuple(str(n) for n in np.atleast_1d(self.file.attrs.get("notes", ()))),
                others=touches[1:],
                kind=kind,
                log=log,
            )

    def _check_format(self) -> None:
        foreign = f"is not a scan (its attribute `format` is not {FORMAT!r})"
        self.require(self.text("format") == FORMAT, foreign)
        version = self.attribute("format_version")
        newer = f"is of the newer format version {version:g}"
        self.require(version <= FORMAT_VERSION, newer, "update tactile-marks to read it")
        must = f"it must be {FORMAT_VERSION}"
        self.require(version == FORMAT_VERSION, f"format_version is {version:g}", must)

    def _columns(self, n_channels: int) -> Rows:
        whisker = np.arange(n_channels)
        if "channels/whisker" in self.file:
            whisker = self.numbers("channels/whisker", (n_channels,)).astype(int)
        columns = np.argsort(whisker, kind="stable")[np.sum(whisker < 0) :]
        self.require(
            np.array_equal(whisker[columns], np.arange(self._n_whiskers)),
            f"/scan/signal has {n_channels} channels of whiskers {whisker.tolist()[:20]}, "
            f"and /passes/line_mm {self._n_whiskers} whiskers",
            "number them 0, 1, 2, ... in /channels/whisker; -1 marks a channel that is not a whisker",
        )
        return columns

    def _calibration(self, *, volt: bool) -> Calibration | None:
        if "calibration/gain" not in self.file:
            unknown = "is in volts without a calibration"
            self.require(not volt, unknown, "run `tactile-marks calibrate` on it first")
            return None
        n = self._n_whiskers
        gain = self.numbers("calibration/gain", (n,))
        offset = self.numbers("calibration/offset_v" if volt else "calibration/offset_n_mm", (n,))
        from_land = bool(self.file["calibration"].attrs.get("from_land", False))
        with self.naming("calibration cannot be used: ", hint="calibrate it again"):
            return Calibration(gain=gain, offset_n_mm=offset, from_land=from_land)

    def _kinds(self) -> tuple[tuple[int, ...], tuple[Touch, ...]]:
        kind = self.integers("whisker/kind", self._n_whiskers, default=0)
        numbered = kind.min() >= 0 and np.array_equal(np.unique(kind), np.arange(kind.max() + 1))
        self.require(numbered, "/whisker/kind does not number the kinds of whisker 0, 1, 2, ...")
        names = ["whisker", *(f"whisker_{i}" for i in range(1, int(kind.max()) + 1))]
        return tuple(int(k) for k in kind), tuple(self._touch(name) for name in names)

    def _touch(self, group: str) -> Touch:
        compliance = self.numbers(f"{group}/compliance_mm_per_n", (3, 3))
        arm = self.numbers(f"{group}/moment_arm_mm", (3,))
        with self.naming("its whisker is impossible: "):
            return Touch(
                tip=TipModel(compliance_mm_per_n=compliance, moment_arm_mm=arm),
                preload_mm=self.attribute("preload_mm", group=group),
                tip_radius_mm=self.attribute("tip_radius_mm", 0.0, group=group),
                friction=self.attribute("friction", NOMINAL_FRICTION, group=group),
                whisker=self.text("description", group=group),
            )

    def _offsets(self) -> Floats:
        offset = self.numbers("whisker/offset_mm", (self._n_whiskers,), default=0.0)
        self.require(
            offset[0] == 0.0 and offset.min() >= 0.0,
            f"/whisker/offset_mm is {offset[0]:g} mm for whisker 0, and {offset.min():g} mm at least",
            "count offsets from whisker 0, which must be in the foremost row",
        )
        return offset

    def _rows_of_passes(self) -> list[tuple[Rows, Rows]]:
        n_rows = len(self._moment)
        number = self.integers("stage/pass", n_rows)
        n = self._n_passes
        there = f"/passes has {n} (0 to {n - 1})"
        self.require(number.max() < n, f"/stage/pass names pass {number.max()}, {there}")
        phase = self.integers("stage/phase", n_rows, default=1)
        order = np.argsort(number, kind="stable")
        ends = np.searchsorted(number[order], np.arange(self._n_passes + 1))
        passes = [order[a:b] for a, b in pairwise(ends)]
        return [(rows[phase[rows] == 0], rows[phase[rows] == 1]) for rows in passes]

    def _moments(self, unit_n_mm: float) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        signal = self.dataset("scan/signal", (None, None))
        columns = self._columns(signal.shape[1])
        scale = self.attribute("scale_factor", 1.0) * unit_n_mm
        shift = self.attribute("add_offset", 0.0) * unit_n_mm
        moment = signal[()].astype(np.float32, copy=False)[:, columns]
        bad = ~(np.abs(moment) < OVERLOAD)
        if scale != 1.0 or shift != 0.0:
            moment = (moment * np.float64(scale) + shift).astype(np.float32)
        flags = np.zeros(moment.shape, np.uint8)
        if "scan/flags" in self.file:
            flags = self.dataset("scan/flags", signal.shape)[()].astype(np.uint8)[:, columns]
        bad |= ~np.isfinite(moment)
        moment[bad] = 0.0
        flags[bad] |= np.uint8(SampleFlag.OUT_OF_RANGE)
        return moment, flags

    def _sweep(self, members: Rows) -> Sweep:
        direction, offset_mm = TraceDirection(int(self._direction[members[0]])), self._offset_mm
        name = f"passes in direction {int(direction)} deg"
        lifted, lowered = zip(*(self._rows[p] for p in members), strict=True)
        counts = sorted({rows.size for rows in lowered})
        self.require(
            len(counts) == 1 and counts[0] >= 2,
            f"{name} have {counts[0]} to {counts[-1]} touching samples",
            "give all passes of a direction the same number, at least 2",
        )
        touching, n_air = np.stack(lowered), min(rows.size for rows in lifted)
        n_lead = int(self.numbers("passes/n_lead", (self._n_passes,), default=0.0)[members].min())
        self.require(
            2 * n_lead < counts[0] or n_air <= counts[0],
            f"{name} have {counts[0]} touching and {n_air} lifted samples, and /passes/n_lead is {n_lead}",
            "exchange 0 (lifted) and 1 (touching) in /stage/phase",
        )
        air = np.stack([rows[:n_air] for rows in lifted])
        start, step = self._along(direction, members, touching)
        speed, (least, most) = step * self.attribute("sampling_rate_hz"), SPEEDS_MM_S
        self.require(
            not speed > 0.0 or least <= speed <= most,
            f"{name} run at {speed:.3g} mm/s",
            "give positions in mm (not in um or counts of an encoder) and sampling_rate_hz in samples a second",
        )
        behind = offset_mm / step
        whole = np.rint(behind)
        behind = np.where(np.abs(behind - whole) <= 1e-3 * np.maximum(1.0, whole), whole, behind)
        n_samples = counts[0] - int(np.ceil(behind.max(initial=0.0)))
        self.require(
            n_samples >= 2,
            f"{name} are shorter than the rows' offsets",
            "let the array run on until its last row has crossed the part; see /whisker/offset_mm",
        )
        counted = f"/passes/n_lead is {n_lead} of {n_samples} samples"
        self.require(0 <= 2 * n_lead < n_samples, counted, "it counts the samples before the marks")
        plan = SweepPlan(
            direction=direction,
            line_mm=self._lines[members],
            start_mm=start,
            step_mm=step,
            n_samples=n_samples,
            n_lead=n_lead,
            pushed=bool(self._pushed[members[0]]),
            offset_mm=tuple(float(v) for v in whole * step) if whole.any() else (),
        )
        moment, flags = (
            np.ascontiguousarray(to_places(signal[touching].swapaxes(1, 2), behind))
            for signal in (self._moment, self._flags)
        )
        lifted_n_mm = np.where(self._flags[air] & SampleFlag.OUT_OF_RANGE, np.nan, self._moment[air])
        return Sweep(plan, moment, flags, fill_air(lifted_n_mm.swapaxes(1, 2)))

    def _along(self, direction: TraceDirection, members: Rows, touching: Rows) -> tuple[float, float]:
        n_samples = touching.shape[1]
        if "passes/start_mm" in self.file and "passes/step_mm" in self.file:
            starts, steps = (
                self.numbers(f"passes/{name}", (self._n_passes,))[members] for name in ("start_mm", "step_mm")
            )
            step = _common(steps)
            uneven = float(np.abs(steps - step).max()) * n_samples
        elif "stage/position_mm" in self.file:
            position = self.numbers("stage/position_mm", (self.file["stage/pass"].shape[0], 2))
            along = position[touching, 0 if direction.along_x else 1]
            step = direction.sign * float((along[:, -1] - along[:, 0]).mean()) / (n_samples - 1)
            even = along[:, :1] + direction.sign * step * np.arange(n_samples)
            starts, uneven = along[:, 0], float(np.abs(along - even).max())
        else:
            raise self.fail("has neither /passes/start_mm and step_mm nor /stage/position_mm")
        samples = f"the samples of direction {int(direction)} deg"
        self.require(
            step > 0.0,
            f"{samples} are {step} mm apart",
            "positions increase in directions 0 and 90 and decrease in 180 and 270; step_mm is positive",
        )
        start = _common(starts)
        self.require(
            max(uneven, float(np.abs(starts - start).max())) <= step,
            f"{samples} are not evenly spaced, or differ between passes",
            "record them at even steps from one start, or resample them; an encoder's counter may have wrapped",
        )
        return start, step


def _common(values: Floats) -> float:
    return float(values[0]) if np.ptp(values) == 0.0 else float(values.mean())


def line_pitch_of(sweeps: tuple[Sweep, ...]) -> float:
    """Distance between neighbouring lines of the first sweep."""
    gaps = np.diff(np.unique(np.round(sweeps[0].plan.line_mm, 6)))
    return float(np.median(gaps)) if gaps.size else sweeps[0].plan.step_mm
