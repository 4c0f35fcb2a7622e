"""Scans on disk: HDF5 that a laboratory can write by hand (docs/pages/reference/recordings.md).

One row of `/scan/signal` is one sampling instant, one column one whisker. Passes follow each other in time order, and
each begins with its air samples. A star marks required items; the others have the default in brackets::

    /                      attributes: format* = "tactile-marks-scan", format_version* = 1, sampling_rate_hz*,
                           units ("N*mm"; also "mN*m", "N*m", and "V" with a calibration), scale_factor (1),
                           add_offset (0), line_pitch_mm (from line_mm), start_time, part_id, fidelity, notes
    /scan/signal*          (sample, channel) number; moment = signal * scale_factor + add_offset, in units
    /scan/flags            (sample, channel) uint8, SampleFlag bits (0)
    /stage/pass*           (sample,) integer, number of the pass; negative: between passes, not used
    /stage/phase           (sample,) 0 lifted (air), 1 touching, other: not used (1)
    /stage/position_mm     (sample, 2) plate-frame x, y of whisker 0
    /passes/direction_deg* (pass,) 0, 90, 180 or 270
    /passes/line_mm*       (pass, whisker) plate coordinate across the trace: y for 0/180, x for 90/270
    /passes/start_mm       (pass,) plate coordinate along the trace of the first touching sample (position_mm)
    /passes/step_mm        (pass,) distance between touching samples, positive (position_mm)
    /passes/n_lead         (pass,) samples of the lead-in on land, and of the lead-out behind the marks (0)
    /passes/pushed         (pass,) 1 where the array was pushed back, its base behind the tip (0)
    /log                   of a scan made pass by pass, each with its own length; attributes: array (its fields,
                           JSON)*, height_mm*, field_mm* (4,), region_mm (4,), other_texts (""), stopped (""),
                           problem (""), budget_s
    /log/along_mm*         (pass, 2) least and greatest plate coordinate along the trace, without lead-in and lead-out
    /log/speed_mm_s*       (pass,);  /log/lead_mm*  (pass,);  /log/turnaround_s*  (pass,)
    /log/preload_mm        (pass,) NaN: that of /whisker (NaN)
    /log/confidence        (pass,) probability of the whole text (0);  /log/text, /log/why  (pass,) text ("")
    /channels/whisker      (channel,) whisker of each column; negative: not a whisker (0, 1, 2, ...)
    /channels/{name,axis,units,range}   for people; not used
    /whisker/compliance_mm_per_n*       (3, 3);  /whisker/moment_arm_mm*  (3,)
    /whisker               attributes: preload_mm*, tip_radius_mm (0), friction (0.2), description
    /whisker/kind          (whisker,) kind of each whisker; those of kind 1 are described in /whisker_1 (0)
    /whisker/offset_mm     (whisker,) distance of each behind whisker 0 along the trace, not negative (0); positions
                           and starts are those of whisker 0; another whisker reaches a position later by its offset
    /calibration           attribute: from_land, gains estimated on land rather than on a bench (0)
    /calibration/gain      (whisker,) true moment = (moment - offset) / gain; in V per N mm where units is "V"
    /calibration/offset_n_mm            (whisker,); named offset_v, in V, where units is "V"
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.errors import FileError, report_damage
from whisker_array.arrays import Floats
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.pass_log_file import write_log
from whisker_array.scan.read_recording import FORMAT, FORMAT_VERSION, VOLT, RecordingReader
from whisker_array.scan.scan import Scan
from whisker_array.scan.stagger import to_instants
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.passes import SweepPlan

_CHUNK = 4096


def save_scan(scan: Scan, path: str | Path, *, volts: bool = False) -> None:
    """Write a scan; the file appears whole or not at all. Raises FileError: the file cannot be written."""
    with replacing(Path(path)) as temporary, h5py.File(temporary, "w") as file:
        _write(scan, file)
        if volts:
            file.attrs["units"] = VOLT
            file["channels/units"][...] = VOLT


def save_calibration(path: str | Path, calibration: Calibration, *, out: str | Path | None = None) -> str:
    """Put a calibration into a recording, or its copy `out`; returns the unit of its offsets. Raises FileError."""
    path = Path(path)
    scan = load_scan(path, raw=True)
    if calibration.gain.size != scan.n_whiskers:
        raise FileError(
            path,
            f"has {scan.n_whiskers} whiskers, the calibration {calibration.gain.size}",
            "calibrate this scan",
        )
    with replacing(Path(out) if out is not None else path) as temporary:
        shutil.copyfile(path, temporary)
        with h5py.File(temporary, "r+") as file:
            volt = file.attrs.get("units", "N*mm") in (VOLT, VOLT.encode())
            _write_calibration(file, calibration, volt=volt)
    return VOLT if volt else "N mm"


def _write(scan: Scan, file: h5py.File) -> None:
    numbers = {"sampling_rate_hz": scan.sample_rate_hz, "scale_factor": 1.0, "add_offset": 0.0}
    file.attrs.update(format=FORMAT, format_version=FORMAT_VERSION, units="N*mm", **numbers)
    file.attrs.update({n: getattr(scan, n) for n in ("line_pitch_mm", "start_time", "part_id", "fidelity")})
    if scan.notes:
        file.attrs["notes"] = list(scan.notes)
    # single passes of a log: those of one direction may differ in length
    sweeps = scan.sweeps if scan.log is None else tuple(p.sweep for p in scan.log.passes)
    signal, flags, position, phase, length = [], [], [], [], []
    for sweep in sweeps:
        behind, n_air = sweep.plan.behind, sweep.air_n_mm.shape[2]
        moment = to_instants(sweep.moment_n_mm, behind)
        n_pass, n_whiskers, n_touching = moment.shape
        signal.append(_in_time(sweep.air_n_mm, moment))
        no_flags = np.zeros((n_pass, n_whiskers, n_air), np.uint8)
        flags.append(_in_time(no_flags, to_instants(sweep.flags, behind, outside=SampleFlag.OUTSIDE)))
        position.append(_positions(sweep.plan, n_air))
        phase.append(np.tile(np.repeat(np.array([0, 1], np.uint8), [n_air, n_touching]), n_pass))
        length += [n_air + n_touching] * n_pass
    rows = np.concatenate(signal)
    chunks = (max(1, min(_CHUNK, rows.shape[0])), rows.shape[1])
    file.create_dataset("scan/signal", data=rows, dtype=np.float32, chunks=chunks)
    file.create_dataset(
        "scan/flags", data=np.concatenate(flags), dtype=np.uint8, chunks=chunks, compression=1
    )
    plans = [plan for plan in (s.plan for s in sweeps) for _ in plan.line_mm]
    tables: dict[str, Any] = {
        "stage/position_mm": np.concatenate(position),
        "stage/pass": np.repeat(np.arange(len(length), dtype=np.int32), length),
        "stage/phase": np.concatenate(phase),
        "passes/direction_deg": np.array([int(p.direction) for p in plans], np.int32),
        "passes/line_mm": np.concatenate([s.plan.line_mm for s in sweeps]).astype(np.float64),
        "passes/start_mm": np.array([p.start_mm for p in plans], np.float64),
        "passes/step_mm": np.array([p.step_mm for p in plans], np.float64),
        "passes/n_lead": np.array([p.n_lead for p in plans], np.int32),
        "passes/pushed": np.array([p.pushed for p in plans], np.uint8),
        "channels/name": [f"whisker {i}" for i in range(scan.n_whiskers)],
        "channels/whisker": np.arange(scan.n_whiskers, dtype=np.int32),
        "channels/axis": ["z"] * scan.n_whiskers,
        "channels/units": ["N*mm"] * scan.n_whiskers,
        "channels/range": np.full((scan.n_whiskers, 2), np.nan),
        "whisker/kind": np.asarray(scan.kind, dtype=np.int32),
    }
    if scan.sweeps[0].plan.offset_mm:
        tables["whisker/offset_mm"] = np.asarray(scan.sweeps[0].plan.offset_mm, dtype=np.float64)
    for i, touch in enumerate(scan.touches):
        group = file.require_group("whisker" if i == 0 else f"whisker_{i}")
        group["compliance_mm_per_n"] = touch.tip.compliance_mm_per_n
        group["moment_arm_mm"] = touch.tip.moment_arm_mm
        group.attrs.update({n: getattr(touch, n) for n in ("preload_mm", "tip_radius_mm", "friction")})
        group.attrs["description"] = touch.whisker
    for name, values in tables.items():
        file[name] = values
    if scan.calibration is not None:
        _write_calibration(file, scan.calibration, volt=False)
    if scan.log is not None:
        write_log(scan.log, file)


def _in_time(air: NDArray[Any], touching: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([air, touching], axis=2).transpose(0, 2, 1).reshape(-1, touching.shape[1])


def _write_calibration(file: h5py.File, calibration: Calibration, *, volt: bool) -> None:
    if "calibration" in file:
        del file["calibration"]
    file["calibration/gain"] = calibration.gain
    file["calibration/offset_v" if volt else "calibration/offset_n_mm"] = calibration.offset_n_mm
    file["calibration"].attrs["from_land"] = calibration.from_land


def _positions(plan: SweepPlan, n_air: int) -> Floats:
    ran = replace(plan, n_samples=plan.n_samples + int(plan.behind.max(initial=0)))
    along = np.concatenate([np.full(n_air, plan.start_mm), ran.position_mm()])
    n_pass = plan.line_mm.shape[0]
    pair = (np.tile(along, n_pass), np.repeat(plan.line_mm[:, 0], along.size))
    return np.column_stack(pair if plan.direction.along_x else pair[::-1])


def load_scan(path: str | Path, *, raw: bool = False) -> Scan:
    """Read a recording; sizes are checked before any data is read. Raises FileError."""
    path = Path(path)
    if not path.is_file():
        raise FileError(path, "is not there" if not path.exists() else "is not a file", "check the name")
    with report_damage(path, kind="recording"), h5py.File(path, "r") as file:
        return RecordingReader(path, file, raw=raw).scan()
