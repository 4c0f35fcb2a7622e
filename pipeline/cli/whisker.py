"""`tactile-marks scan`, `calibrate`, `identify` and `import`: recordings of touch."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from pipeline.cli.exit_status import CommandError, UsageError
from pipeline.cli.settings import MAPS, Maps
from pipeline.cli.shared import FidelityName, Flag, SensorsName, Speed, write_picture
from pipeline.common.output_paths import PICTURES, check_writable
from pipeline.formats.kinds import SCAN_SUFFIXES

if TYPE_CHECKING:
    from whisker_array.scan.session import StageSession
    from whisker_array.whisker.array import RasterPlan
    from whisker_array.whisker.shapes import Whisker


def scan(
    height_map: Path,
    /,
    *,
    out: Path,
    height_mm: Annotated[float | None, Parameter(validator=Number(gt=0, lt=1000))] = None,
    fidelity: FidelityName = "contact",
    sensors: SensorsName = "real",
    seed: int = 0,
    whisker: Path | None = None,
    speed_mm_s: Speed = None,
    friction: Annotated[float | None, Parameter(validator=Number(gte=0, lte=1))] = None,
    profilers: bool = False,
    two_way: bool = False,
    active: Flag = False,
    budget_s: float = 60.0,
    format: str | None = None,
    maps: Maps = MAPS,
) -> None:
    """Scan a height map with the virtual whisker array and record the raw moments.

    Args:
        height_map: .npz, .x3p, .sdf, .sur ... Friction and soft dirt are simulated if an .npz holds them, as from
            `synth --dirt`. A .toml is a test piece (`identify`).
        out: Recording to write, .h5.
        height_mm: Character height in mm, which sets the scale of array and raster (default: measured, which takes as
            long as reading the part).
        fidelity: Simulation of touch: the ball of the tip in contact, or a point (faster, less accurate).
        sensors: Sensors and stage: real (gains, offsets, noise, drift, vibration, 16 bits, play and position errors,
            whiskers that ring at its speed), or ideal.
        seed: Random seed of the sensors: the same seed gives the same scan.
        whisker: Whisker file to scan with, as from `design --out` (default: a whisker for the character height).
        speed_mm_s: Speed of the stage, mm/s (default: the whisker file's, or 10 heights a second up to 50 mm/s).
        friction: True friction of the part, 0 to 1 (default: the file's, or the whisker's nominal one).
        profilers: Add a second row of whiskers that measures the profile; it separates slopes from heights.
        two_way: Scan every pass again on the way back, with the whiskers pushed; this measures friction.
        active: Choose pass after pass while reading, and stop when the serial is sure or more touch would not help, in
            place of the whole plan; the passes are recorded together.
        budget_s: Most stage seconds with --active.
        format: Format of the serial, with --active, such as AA999999; see read --format.
    """
    from pipeline.formats.touch_file import read_part_map
    from pipeline.formats.whisker_file import PITCH_MM, read_piece, read_whisker_file
    from pipeline.reading.identified import prediction_lines
    from pipeline.reading.predictions import predictions
    from pipeline.reading.readers import find_height_mm
    from recognition.see.virtual_array import VirtualArray
    from recognition.see.virtual_bench import VirtualBench
    from recognition.surface import Surface
    from whisker_array.scan.recording import save_scan
    from whisker_array.scan.sensor import Sensors
    from whisker_array.simulation.traces import Fidelity
    from whisker_array.whisker.array import LINES_PER_HEIGHT, PIECE_LINES, default_plan
    from whisker_array.whisker.defaults import default_whisker

    check_recording(out)
    if active and (profilers or two_way or whisker is not None):
        raise UsageError(
            "scan: --active chooses its passes for the usual comb",
            "leave out --profilers, --two-way and --whisker",
        )
    piece = height_map.suffix.lower() == ".toml"
    top = Surface(read_piece(height_map).height_map(PITCH_MM)) if piece else read_part_map(height_map, maps)
    surface, soil = top.height_map, top.soil
    built = read_whisker_file(whisker) if whisker is not None else None
    height = height_mm or (built.character_height_mm if built else find_height_mm(surface, soil=soil))
    array = VirtualArray(
        built.touch if built else None, Sensors(sensors), Fidelity(fidelity), seed,
        given_speed_mm_s=speed_mm_s, whisker_speed_mm_s=built.speed_mm_s if built else None,
    )  # fmt: skip
    bench = VirtualBench(surface, height, array, soil, friction, height_map.stem).mounted()
    if active:
        return scan_actively(bench.open_session(), out, height_mm=height, budget_s=budget_s, format=format)
    region = (0.0, 0.0, *surface.size_mm)
    plan = default_plan(
        region, character_height_mm=height, speed_mm_s=array.speed_mm_s, kinds=2 if profilers else 1, two_way=two_way,
        lines_per_height=PIECE_LINES if piece else LINES_PER_HEIGHT,
    )  # fmt: skip
    plan = replace(plan, each_whisker=piece)
    print(_describe_plan(plan))
    shape, touch = built.whisker if built else default_whisker(height), array.touch(height)
    mu = touch.friction if friction is None else friction
    if warning := linear_beam_warning(shape, lift_mm=touch.preload_mm, mu=mu):
        print(f"warning: {warning}", file=sys.stderr)
    scanned = bench.scan(plan)
    save_scan(scanned, out)
    print(
        f"wrote {out}: characters {height:.2f} mm, preload {scanned.touch.preload_mm:.2f} mm, "
        f"{plan.n_samples:,} samples at {plan.sample_rate_hz:,.0f} Hz, scan time {plan.scan_time_s:.0f} s"
    )
    if built is not None and built.known is not None and not built.whisker.is_straight:
        print("\n".join(prediction_lines(predictions(built.whisker, built.touch, built.known))))


def check_recording(path: Path) -> None:
    """Check that a recording can have this name and be written. Raises UsageError: the suffix is wrong. FileError:
    it cannot be written."""
    if path.suffix.lower() not in SCAN_SUFFIXES:
        raise UsageError(f"{path}: a recording ends in {SCAN_SUFFIXES[0]}")
    check_writable(path)


def scan_actively(
    session: StageSession, out: Path, *, height_mm: float, budget_s: float, format: str | None
) -> None:
    """Record the passes that a reader chooses, and print why it stopped. Raises CommandError: no pass succeeded."""
    from recognition.active.felt_log import read_and_log
    from recognition.reader import Reader
    from whisker_array.scan.recording import save_scan

    reading = read_and_log(Reader(format=format).touch, session, budget_s=budget_s)
    session.close()
    if reading.scan is None:
        raise CommandError(f"scan: no pass could be scanned: {reading.problem}", hint="check the stage")
    for felt, end_s in zip(reading.passes, reading.ends_s, strict=True):
        text = f"  {felt.text} {felt.confidence:.2f}" if felt.text else ""
        print(f"{end_s:6.1f} s  {felt.order.describe()}{text}")
    save_scan(reading.scan, out)
    print(f"wrote {out}: characters {height_mm:.2f} mm; {reading.describe()}")


def calibrate(recording: Path, /, *, out: Path | None = None, in_place: bool = False) -> None:
    """Find gain and offset of each whisker from the lifted and lead-in samples of a scan; write a calibrated copy.

    Args:
        recording: The scan, .h5.
        out: Copy to write (default: NAME-calibrated.h5 beside the recording).
        in_place: Write the calibration into the recording itself.
    """
    if in_place and out is not None:
        raise UsageError("calibrate: --out and --in-place exclude each other", "give one of them")
    if not in_place and out is None:
        out = recording.with_name(f"{recording.stem}-calibrated{recording.suffix}")
    from glyphs.errors import FileError
    from pipeline.workers.options import in_a_worker
    from whisker_array.estimation.signal_measures import flag_beyond_part
    from whisker_array.scan.lead_in import calibrate_scan
    from whisker_array.scan.recording import load_scan, save_calibration
    from whisker_array.scan.sensor import SensorError

    try:
        lead_in = calibrate_scan(flag_beyond_part(in_a_worker(load_scan, recording, raw=True)))
        unit = save_calibration(recording, lead_in.calibration, out=out)
    except SensorError as error:
        place = f"{error.where}: " if error.where else ""
        raise FileError(recording, f"cannot be calibrated: {place}{error.what}", error.hint) from error
    gain_unit = "1" if unit == "N mm" else f"{unit} / (N mm)"
    print(f"{'':7}  {'gain':>10}  {'offset':>9}  {'residual':>10}      samples\n"
          f"whisker  {gain_unit:>10}  {unit:>9}  {'N mm, rms':>10}    air   land")  # fmt: skip
    known, samples = lead_in.calibration, (lead_in.air_samples, lead_in.land_samples)
    rows = zip(known.gain, known.offset_n_mm, lead_in.residual_n_mm, *samples, strict=True)
    for whisker, (gain, offset, residual, air, land) in enumerate(rows):
        note = "" if land else "  never on the land: gain left at 1"
        print(f"{whisker:7d}  {gain:10.4f}  {offset:+9.4f}  {residual:10.4f}  {air:5d}  {land:5d}{note}")
    print(f"wrote {out or recording}")


def identify(
    recording: Path,
    /,
    *,
    piece: Path,
    whisker: Path | None = None,
    out: Path | None = None,
    figure: Path | None = None,
) -> None:
    """Find the whisker and bench that made a recording over a piece of known relief.

    Args:
        recording: The scan, .h5, best in four directions and back; `scan PIECE.toml` makes one to try.
        piece: TOML file of a test piece, or the height map of any other, with its corner at the origin of the scan's
            frame.
        whisker: The whisker as drawn, a file from `design`. Without it lengths, angle and stiffness are not identified.
        out: Whisker file to write, with the identified values in place of the drawn ones; needs --whisker.
        figure: Picture (.svg, .png) of the measured signals, those that the identified bench predicts, and the
            residuals.
    """
    if out is not None and whisker is None:
        raise UsageError("identify: --out needs the whisker as drawn", "add --whisker")
    from pipeline.reading.identified import identify_recording, table_of, write_found
    from pipeline.workers.options import in_a_worker

    if figure is not None:
        check_writable(figure, PICTURES)
    report, drawn = in_a_worker(identify_recording, recording, piece, whisker)
    print("\n".join(table_of(report)))
    if out is not None and drawn is not None:
        write_found(out, report, drawn)
        print(f"wrote {out}")
    if figure is not None:
        from pipeline.plots.bench_picture import identified_figure

        write_picture(identified_figure(report), figure)


def import_traces(
    files: Annotated[list[Path], Parameter(consume_multiple=True)], /, *, traces: Path, out: Path
) -> None:
    """Convert recorded traces (positions and signals) to a scan for `read` and `inspect`.

    Args:
        files: .csv, .txt, .tsv or .tdms (with the extra tdms), in the order in which they were recorded.
        traces: Description of the files, .toml: columns, units, positions of the whiskers.
        out: Recording to write, .h5.
    """
    import numpy as np

    from glyphs.errors import FileError
    from pipeline.formats.import_traces import import_traces as imported
    from pipeline.formats.traces_file import read_traces_file
    from pipeline.formats.whisker_file import read_whisker_file
    from whisker_array.scan.read_recording import VOLT
    from whisker_array.scan.recording import save_scan
    from whisker_array.simulation.traces import SampleFlag

    check_recording(out)
    if not files:
        raise UsageError("import: no files", "name the traces to be imported")
    described = read_traces_file(traces)
    whisker = traces.parent / described.whisker
    if not whisker.is_file():
        raise FileError(traces, f"names the whisker {described.whisker}, which is not there", "put it beside")
    volts = described.moment_unit == VOLT
    scan = imported(files, described, touch=read_whisker_file(whisker).touch)
    save_scan(scan, out, volts=volts)
    passes = ", ".join(f"{s.plan.line_mm.shape[0]} at {int(s.plan.direction)}°" for s in scan.sweeps)
    print(
        f"wrote {out}: passes {passes} of {scan.n_whiskers} whiskers, samples {scan.sweeps[0].plan.step_mm:.4f} mm "
        f"apart at {scan.sample_rate_hz:,.0f} Hz"
    )
    missing = sum(int(np.count_nonzero(s.flags & np.uint8(SampleFlag.OUT_OF_RANGE))) for s in scan.sweeps)
    if missing:
        print(f"missing samples (empty, or an overload): {missing:,} of {scan.n_samples:,}")
    for fault in scan.notes[1:]:
        print(f"  {fault}")
    if volts:
        print(f"its signals are in volts: run tactile-marks calibrate {out}")


def _describe_plan(plan: RasterPlan) -> str:
    x0, y0, x1, y1 = plan.region_mm
    array, ways = plan.array, "/".join(f"{int(d)}°" for d in plan.directions) + " and back" * plan.two_way
    return (
        f"{x1 - x0:.1f} x {y1 - y0:.1f} mm, {array.kinds * array.n_whiskers} whiskers {array.pitch_mm:.2f} mm apart "
        f"(rows: {array.kinds * array.rows}), lines {plan.line_pitch_mm:.3f} mm, {ways}, {plan.n_passes} passes, "
        f"{plan.n_samples:,} samples, {plan.scan_time_s:.0f} s at {plan.speed_mm_s:g} mm/s"
    )


def linear_beam_warning(whisker: Whisker, *, lift_mm: float, mu: float) -> str:
    """Compare the linear beam (Assumption 1) with the exact bent shape on a level surface, in some 10 ms; a warning, or
    nothing if force and moment are within `LINEAR_ERROR_LIMIT` and the tip bends by `DEFLECTION_LIMIT` of l1 at most.

    The whisker lies in the plane of tracing; `lift_mm` is the height by which the surface lifts the tip: preload plus
    height of marks above the land. Raises WhiskerError: the friction `mu` is negative or not finite.
    """
    from whisker_array.whisker.elastica import ElasticaError, linear_error
    from whisker_array.whisker.validity import DEFLECTION_LIMIT, LINEAR_ERROR_LIMIT, deflection_ratio

    try:
        deviation = linear_error(whisker, lift_mm=lift_mm, mu=mu)
    except ElasticaError as error:
        return f"linear beam theory (Assumption 1) cannot be checked at a lift of {lift_mm:.3g} mm: {error}"
    ratio = deflection_ratio(whisker, preload_mm=lift_mm, mu=mu)
    if deviation.worst <= LINEAR_ERROR_LIMIT and ratio <= DEFLECTION_LIMIT:
        return ""
    return (
        f"at the largest lift, {lift_mm:.3g} mm, the tip bends by {100 * ratio:.1f} % of l1, and linear beam "
        f"theory (Assumption 1) is wrong by {100 * deviation.force:+.1f} % in force and "
        f"{100 * deviation.moment:+.1f} % in moment: lower the preload, or take a longer whisker or a smaller k"
    )
