"""Import recorded traces as a scan: cut into passes and resampled at even steps along the travel.

    stage  x |        ______      number   -1 0 0 0 0 0 -1 1 1 ...     a pass has one number, or is one file
             |   ____/            lifted    1 1 0 0 0 0  1 ...         air, then land
             |__/                                                      samples that stand still are left out
             +-------------> t    position: u = +-x or +-y, growing; moments by straight lines at even steps of u

All passes of a direction are resampled on one raster, over the stretch that they share. The sampling rate comes from
the whole time between pauses. Time may go back at midnight, or to 0 at a new pass only.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError
from glyphs.surface.maps import TraceDirection
from pipeline.errors import DataError, naming, reading
from pipeline.formats.grid import MM, SECONDS, UNITS
from pipeline.formats.trace_table import TraceTable, read_trace_table
from pipeline.formats.traces_file import TracesFile
from whisker_array.estimation.faults import FaultKind, find_signal_faults
from whisker_array.scan.read_recording import OVERLOAD, SPEEDS_MM_S, UNIT_N_MM, VOLT, line_pitch_of
from whisker_array.scan.scan import Scan
from whisker_array.scan.sweep import Sweep, fill_air
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.touch import Touch

_MOST_BYTES = 2_000_000_000
# drift of a pass across its travel, as a share of the travel
_ASKEW = 0.02
# distance of two samples, in steps, above which the stretch between them is a dropout
_GAP_STEPS = 2.5
# least stretch that all passes of a direction must share, as a share of the longest pass
_SHORT = 0.5
# least jump of a position that is no step of the stage, as a share of the other steps of its pass together
_JUMP = 0.05
# step of the clock, in usual steps, above which sampling was paused
PAUSE_STEPS = 2.5

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Pass:
    """One travel: `u` grows along it, mm, by steps of `step_mm` where it runs; `moment` (samples, whiskers)."""

    name: str
    path: Path
    direction: TraceDirection
    u: Floats
    step_mm: float
    across_mm: float
    moment: Floats
    air: Floats


def import_traces(paths: Sequence[Path], layout: TracesFile, *, touch: Touch) -> Scan:
    """Read a scan from trace files, in the order of recording; moments in N mm, volts unchanged. Its notes name faults
    of the signals. Raises FileError: with line or channel. MissingExtraError: TDMS without its library."""
    passes: list[_Pass] = []
    rates = []
    for path in paths:
        with reading(path, kind=path.suffix, most_bytes=_MOST_BYTES):
            table = read_trace_table(path, layout)
        with naming(path):
            rates.append(_rate_hz(table, layout))
            of_file = tuple(_passes(path, table, layout))
            passes += of_file
            step_mm = float(np.median([p.step_mm for p in of_file]))
            time_unit = None if layout.columns.time is None else layout.time_unit
            check_speed(
                step_mm=step_mm, rate_hz=rates[-1], time_unit=time_unit, position_unit=layout.position_unit
            )
    if max(rates) > 1.01 * min(rates):
        worst = paths[int(np.argmax(rates))]
        raise FileError(
            worst, f"was sampled at {max(rates):g} Hz, others at {min(rates):g} Hz", "import them separately"
        )
    ways = sorted({p.direction for p in passes}, key=int)
    sweeps = tuple(_sweep([p for p in passes if p.direction is way], layout) for way in ways)
    scan = Scan(
        sweeps=sweeps,
        touch=touch,
        line_pitch_mm=line_pitch_of(sweeps),
        sample_rate_hz=float(np.median(rates)),
        part_id=layout.part_id,
        start_time=layout.start_time,
    )
    faults = find_signal_faults(scan, volts=layout.moment_unit == VOLT)
    if other_unit := [f for f in faults if f.kind is FaultKind.UNIT and f.whisker is None]:
        hint = 'correct moment_unit; write "V" for counts, too, and run calibrate'
        raise FileError(paths[0], f"says moment_unit = {layout.moment_unit!r}, {other_unit[0].text}", hint)
    source = f"imported from {', '.join(p.name for p in paths)}"[:1000]
    return replace(scan, notes=(source, *(f.text for f in faults)))


def _passes(path: Path, table: TraceTable, layout: TracesFile) -> Iterable[_Pass]:
    columns = layout.columns
    xy_mm = np.column_stack([table.columns[columns.x], table.columns[columns.y]]) * MM[layout.position_unit]
    signal = np.column_stack([table.columns[c] for c in columns.moment])
    signal[~(np.abs(signal) < OVERLOAD)] = np.nan
    signal *= UNIT_N_MM.get(layout.moment_unit, 1.0)
    table.require(xy_mm, "position", "fill it in, or take that row out")
    number, lifted = table.column(columns.number), table.column(columns.lifted) != 0.0
    table.require(number, "pass", "write -1 between passes")
    numbers = np.unique(number[number >= 0.0])
    if not numbers.size:
        raise DataError(f"has no pass in column {columns.number!r}", "number passes from 0")
    for each in numbers:
        rows = np.flatnonzero(number == each)
        name = f"pass {each:g}" if columns.number is not None else "the pass"
        yield _pass(path, table, name, rows[~lifted[rows]], xy_mm, signal, signal[rows[lifted[rows]]])


def _pass(
    path: Path,
    table: TraceTable,
    name: str,
    rows: NDArray[np.intp],
    xy_mm: Floats,
    signal: Floats,
    air: Floats,
) -> _Pass:
    if rows.size < 2:
        raise DataError(f"has {rows.size} touching samples in {name}", "check columns.lifted")
    _check_counter(table, name, rows, xy_mm)
    went = xy_mm[rows[-1]] - xy_mm[rows[0]]
    axis = int(np.argmax(np.abs(went)))
    travel, strayed = abs(float(went[axis])), float(np.ptp(xy_mm[rows, 1 - axis]))
    if travel == 0.0 or strayed > _ASKEW * travel:
        where = f"{name}, {table.place(int(rows[0]))} on"
        raise DataError(
            f"moves {abs(went[0]):.3f} mm in x and {abs(went[1]):.3f} mm in y in {where}",
            "a pass runs along x or along y, from one end to the other; correct columns.lifted and columns.pass",
        )
    direction = TraceDirection((90 if axis else 0) + (180 if went[axis] < 0.0 else 0))
    u = between_polls(np.sign(went[axis]) * xy_mm[rows, axis])
    # the stage is at rest before and after the pass, and its scale flickers by a count
    ahead = np.r_[True, u[1:] > np.maximum.accumulate(u)[:-1]]
    lag = max(1, u.size // 10)
    step = float(np.median(u[lag:] - u[:-lag])) / lag
    fall = np.maximum.accumulate(u) - u
    if fall.max() > max(2.0 * step, 1e-6 * travel):
        back = int(rows[int(np.argmax(fall > 2.0 * step))])
        hint = "sort the lines by time, and number each travel as a pass of its own"
        raise DataError(f"runs back in {name}, {table.place(back)}", hint)
    across = float(np.median(xy_mm[rows, 1 - axis]))
    return _Pass(name, path, direction, u[ahead], step, across, signal[rows[ahead]], air)


def _check_counter(table: TraceTable, name: str, rows: NDArray[np.intp], position_mm: Floats) -> None:
    steps = np.diff(position_mm[rows], axis=0)
    size = np.abs(steps).max(axis=1)
    usual = float(np.median(size[size > 0.0])) if size.any() else 0.0
    jumps = np.flatnonzero(size > max(20.0 * usual, _JUMP * float((size * (size <= 20.0 * usual)).sum())))
    if not 0 < jumps.size <= 2:
        return  # more of them: several travels in one pass
    travel = np.delete(steps, jumps, axis=0).sum(axis=0)
    axis = int(np.argmax(np.abs(travel)))
    for k in jumps:
        if (steps[k] * travel)[axis] <= 0.0 or abs(steps[k, 1 - axis]) > abs(steps[k, axis]):
            far = steps[k, int(np.argmax(np.abs(steps[k])))]
            raise DataError(
                f"has a position that jumps by {far:+.3f} mm in {name}, {table.place(int(rows[k + 1]))}",
                "the encoder's counter wraps or was reset, or lines are missing; correct the positions",
            )


def between_polls(u: Floats) -> Floats:
    """Interpolate (samples,) positions along the travel between polls, for a stage polled more slowly than the signals.
    A position that holds for much longer than usual is a stop, and nothing is changed."""
    polls = np.flatnonzero(np.r_[True, np.diff(u) != 0.0])
    if polls.size < 3:
        return u
    held = np.diff(polls)
    usual = float(np.median(held[1:] if held.size > 1 else held))
    if usual < 2.0:
        return u
    lines, moves = np.interp(np.arange(u.size), polls, u[polls]), np.zeros(u.size, dtype=np.bool_)
    moves[: polls[-1]] = np.repeat(held <= _GAP_STEPS * usual, held)
    return np.where(moves, lines, u)


def _sweep(passes: Sequence[_Pass], layout: TracesFile) -> Sweep:
    direction, n = passes[0].direction, len(layout.columns.moment)
    behind = np.asarray(layout.behind_mm or (0.0,) * n)
    side = np.asarray(layout.across_mm or (0.0,) * n)
    if layout.turns and direction in (TraceDirection(90), TraceDirection(180)):
        side = -side  # the frame has y down the part, so right of +x is +y, and right of +y is -x
    step = float(np.median([p.step_mm for p in passes]))
    low, high = max(p.u[0] for p in passes), min(p.u[-1] for p in passes) - float(behind.max())
    longest = max(p.u[-1] - p.u[0] for p in passes)
    if high - low < _SHORT * longest:
        short = min(passes, key=lambda p: p.u[-1] - p.u[0])
        raise FileError(
            short.path,
            f"runs from {short.u[0]:.3f} to {short.u[-1]:.3f} mm in {short.name}; the passes at {int(direction)}° have "
            f"{max(0.0, high - low):.3f} mm in common of {longest:.3f}",
            "leave out incomplete passes, or import them separately; correct positions after a reset of the encoder",
        )
    if layout.part_mm is not None:
        # run-in and run-out must lie on the part's land: off the part no whisker touches
        edges = layout.part_mm[::2] if direction.along_x else layout.part_mm[1::2]
        first, last = sorted(-v if direction.backward else v for v in edges)
        low, high = max(low, first), min(high, last)
    n_samples = int((high - low) / step + 1e-6) + 1
    if n_samples < 2:
        what = f"has passes that do not cross part_mm at {int(direction)}°"
        raise FileError(passes[0].path, what, "correct part_mm, which counts as the stage's position does")
    n_lead = round(layout.lead_mm / step)
    if 2 * n_lead >= n_samples:
        raise FileError(
            passes[0].path,
            f"has passes of {high - low:.3f} mm, twice lead_mm is {2 * layout.lead_mm:g}",
            "correct lead_mm" + (", part_mm or the sign of the positions" if layout.part_mm else ""),
        )
    u = low + step * np.arange(n_samples)
    moment = np.empty((len(passes), n, n_samples), dtype=np.float32)
    flags = np.zeros(moment.shape, dtype=np.uint8)
    for i, each in enumerate(passes):
        for w in range(n):
            moment[i, w] = np.interp(u + behind[w], each.u, each.moment[:, w])
            after = np.clip(np.searchsorted(each.u, u + behind[w]), 1, each.u.size - 1)
            unfelt = each.u[after] - each.u[after - 1] > _GAP_STEPS * step
            flags[i, w, unfelt] = SampleFlag.DROPOUT
    missing = ~np.isfinite(moment)
    moment[missing], flags[missing] = 0.0, SampleFlag.OUT_OF_RANGE
    line_mm = np.array([p.across_mm for p in passes])[:, None] + side
    if layout.part_mm is not None:
        across, along = line_mm[:, :, None], -u if direction.backward else u
        x, y = (along, across) if direction.along_x else (across, along)
        x0, y0, x1, y1 = layout.part_mm
        flags[(x < x0) | (x > x1) | (y < y0) | (y > y1)] |= np.uint8(SampleFlag.OUTSIDE)
    n_air = min(p.air.shape[0] for p in passes)
    late = np.rint(behind / step) * step
    plan = SweepPlan(
        direction=direction,
        line_mm=line_mm,
        start_mm=float(-low if direction.backward else low),
        step_mm=step,
        n_samples=n_samples,
        n_lead=n_lead,
        offset_mm=tuple(float(v) for v in late) if late.any() else (),
    )
    air = fill_air(np.stack([p.air[p.air.shape[0] - n_air :].T for p in passes]))
    return Sweep(plan=plan, moment_n_mm=moment, flags=flags, air_n_mm=air)


def _rate_hz(table: TraceTable, layout: TracesFile) -> float:
    columns = layout.columns
    if columns.time is None:
        if not (rate := layout.sampling_rate_hz or table.rate_hz):
            raise DataError("has no time and no sampling rate", "give columns.time or sampling_rate_hz")
        return rate
    time_s = table.columns[columns.time] * (
        1.0 if columns.time in table.stamped else SECONDS[layout.time_unit]
    )
    table.require(time_s, "time", "fill it in, or take that row out")
    steps = np.diff(time_s)
    steps = np.where(np.abs(steps + SECONDS["d"]) < 0.5 * SECONDS["d"], steps + SECONDS["d"], steps)
    if (row := _first_out_of_order(time_s, table.column(columns.number), steps)) is not None:
        raise DataError(
            f"has times that run back {table.place(row)}",
            "sort the lines by time, or give sampling_rate_hz in place of columns.time",
        )
    grows = steps[steps > 0.0]
    if not grows.size:
        raise DataError("has times that are all the same", "give sampling_rate_hz in place of columns.time")
    run = steps[(steps >= 0.0) & (steps <= PAUSE_STEPS * float(np.median(grows)))]
    return run.size / float(run.sum())


def _first_out_of_order(time_s: Floats, number: Floats, steps: Floats, *, restart: float = 0.2) -> int | None:
    """The first row whose time is before that of the row ahead, other than with a clock that restarts at a new pass: in
    less than `restart` of the time since its last start. A step over midnight is positive."""
    start = 0
    for k in np.flatnonzero(steps < 0.0).tolist():
        row = k + 1
        since_start, until_then = time_s[row] - time_s[start], time_s[k] - time_s[start]
        if number[row] == number[k] or since_start > restart * until_then:
            return row
        start = row
    return None


def check_speed(*, step_mm: float, rate_hz: float, time_unit: str | None, position_unit: str) -> None:
    """Check the speed of the stage (`time_unit` is None for a stated rate). Raises DataError, with the likely unit."""
    speed, (least, most) = step_mm * rate_hz, SPEEDS_MM_S
    if least <= speed <= most:
        return
    times = [
        f'time_unit = "{u}"'
        for u, s in SECONDS.items()
        if time_unit is not None and least <= speed * SECONDS[time_unit] / s <= most
    ]
    places = [f'position_unit = "{u}"' for u in UNITS if least <= speed * MM[u] / MM[position_unit] <= most]
    units = " or ".join(times[:1] + places[:1])
    what = f"moves at {speed:.3g} mm/s and was sampled at {rate_hz:.4g} Hz"
    if time_unit is None:
        hint = f"say {units} if that is its unit, or correct" if units else "correct"
        raise DataError(what, f"{hint} sampling_rate_hz")
    hint = f"say {units} if that is their unit" if units else "correct time_unit"
    raise DataError(
        f"{what} by its times in {time_unit}", f"{hint}, or give sampling_rate_hz in place of columns.time"
    )
