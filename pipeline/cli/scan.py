"""`tactile-marks scan` and `tactile-marks calibrate`: recordings made and calibrated."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pipeline.cli.choices import FidelityName
from pipeline.cli.exit_status import USAGE, CommandError, failures_reported
from pipeline.cli.settings import MAPS, Maps

if TYPE_CHECKING:
    from whisker_array.scan.session import StageSession


def scan(
    height_map: Path,
    *,
    out: Path,
    height_mm: float | None = None,
    fidelity: FidelityName = "contact",
    noise: bool = True,
    memory: bool = True,
    seed: int = 0,
    whisker: Path | None = None,
    friction: float | None = None,
    profilers: bool = False,
    two_way: bool = False,
    active: Annotated[bool, Parameter(negative="")] = False,
    budget_s: float = 60.0,
    format: str | None = None,
    maps: Maps = MAPS,
) -> int:
    """Scan a height map with the virtual whisker array and record the raw moments.

    Parameters
    ----------
    height_map
        .npz, .x3p, .sdf, .sur ... Friction and soft dirt count where an .npz holds them, as `synth --dirt` writes
        it. A .toml is a test piece (`identify`).
    out
        Recording to write, .h5.
    height_mm
        Character height in mm, which sets the scale of array and raster; measured unless given, which takes as long as
        to read the part.
    fidelity
        How touch is simulated.
    noise
        Sensors as real ones are: gains, offsets, noise, drift, 16 bits. Without it they are ideal, and so is the stage.
    memory
        Of those sensors, too, creep, hysteresis and a zero that shifts, and a stage with play and errors of its place.
    seed
        Of all that: the same seed gives the same scan.
    whisker
        Whisker to scan with, as `design --out` writes it; one for the character height unless given.
    friction
        True friction of the part, 0 to 1; what the file says, or the whisker's nominal one, unless given.
    profilers
        Add a second row of whiskers that measures the profile; it separates slopes from heights.
    two_way
        Scan every pass again on its return, pushed backwards; it measures friction.
    active
        Choose pass after pass while reading, and stop when the serial is sure or more touch would not help, in place of
        the whole plan; the passes felt are recorded together.
    budget_s
        Most stage seconds with --active.
    format
        What the serial looks like, with --active, such as AA999999; as read --format takes it.
    """
    with failures_reported():
        from glyphs.atomic import check_writable
        from pipeline.cli.beam_warning import linear_beam_warning
        from pipeline.cli.plan_words import describe_plan
        from pipeline.formats.kinds import is_scan
        from pipeline.formats.npz import read_soil
        from pipeline.formats.piece_file import read_surface
        from pipeline.formats.touch_file import read_height_map
        from pipeline.formats.whisker_file import read_whisker_file
        from pipeline.reading.identified import prediction_lines
        from pipeline.reading.simulated_scan import feel, find_height_mm
        from whisker_array.identification.predictions import predictions
        from whisker_array.scan.recording import save_scan
        from whisker_array.simulation.traces import Fidelity
        from whisker_array.whisker.array import default_plan
        from whisker_array.whisker.defaults import default_whisker
        from whisker_array.whisker.touch import default_touch

        if not is_scan(out):
            raise CommandError(f"{out}: a recording ends in .h5", status=USAGE)
        if height_mm is not None and not 0.0 < height_mm < 1000.0:
            raise CommandError(
                f"--height-mm is {height_mm}", hint="it lies between 0 and 1000 mm", status=USAGE
            )
        if active and (profilers or two_way or whisker is not None):
            raise CommandError(
                "scan: --active chooses its passes for the usual comb",
                hint="leave out --profilers, --two-way and --whisker",
                status=USAGE,
            )
        check_writable(out)
        piece = height_map.suffix.lower() == ".toml"
        surface = read_surface(height_map) if piece else read_height_map(height_map, maps)
        soil = read_soil(height_map, maps)
        if friction is not None and not 0.0 <= friction <= 1.0:
            raise CommandError(f"--friction is {friction}", hint="it lies between 0 and 1", status=USAGE)
        built = read_whisker_file(whisker) if whisker is not None else None
        if height_mm is None and built is not None:
            height_mm = built.character_height_mm
        height = height_mm if height_mm is not None else find_height_mm(surface, soil=soil)
        if active:
            from pipeline.reading.simulated_scan import open_session

            session = open_session(
                surface,
                height_mm=height,
                fidelity=Fidelity(fidelity),
                noise=noise,
                memory=memory,
                sensor_seed=seed,
                part_id=height_map.stem,
                friction=friction,
                soil=soil,
            )
            return scan_actively(session, out, height_mm=height, budget_s=budget_s, format=format)
        plan = default_plan(
            (0.0, 0.0, *surface.size_mm),
            character_height_mm=height,
            kinds=2 if profilers else 1,
            two_way=two_way,
        )
        if built is not None:
            plan = replace(plan, speed_mm_s=built.speed_mm_s)
        print(describe_plan(plan))
        shape = built.whisker if built is not None else default_whisker(height)
        touch = built.touch if built is not None else default_touch(height)
        mu = touch.friction if friction is None else friction
        if warning := linear_beam_warning(shape, lift_mm=touch.preload_mm, mu=mu):
            print(f"warning: {warning}", file=sys.stderr)
        felt = feel(
            surface,
            plan=plan,
            height_mm=height,
            fidelity=Fidelity(fidelity),
            noise=noise,
            memory=memory,
            sensor_seed=seed,
            part_id=height_map.stem,
            touch=touch,
            friction=friction,
            soil=soil,
        )
        save_scan(felt, out)
    print(
        f"wrote {out}: characters {height:.2f} mm, preload {felt.touch.preload_mm:.2f} mm, "
        f"{plan.n_samples:,} samples at {plan.sample_rate_hz:,.0f} Hz, scan time {plan.scan_time_s:.0f} s"
    )
    if built is not None and built.known is not None and not built.whisker.is_straight:
        print("\n".join(prediction_lines(predictions(built.whisker, built.touch, built.known))))
    return 0


def scan_actively(
    session: StageSession, out: Path, *, height_mm: float, budget_s: float, format: str | None
) -> int:
    """Record the passes that a reader chooses, and say why it stopped.

    Raises:
        CommandError: nothing could be felt.
    """
    from recognition.active.replay import read_kept
    from recognition.reader import Reader
    from whisker_array.scan.recording import save_scan

    found = read_kept(Reader(format=format).touch, session, budget_s=budget_s)
    session.close()
    if found.scan is None:
        raise CommandError(f"scan: nothing was felt: {found.problem}", hint="see to the stage")
    for one in found.passes:
        print(
            f"{one.stage_s:6.1f} s  {one.order.describe()}{f'  {one.text} {one.confidence:.2f}' if one.text else ''}"
        )
    save_scan(found.scan, out)
    print(f"wrote {out}: characters {height_mm:.2f} mm; {found.describe()}")
    return 0


def calibrate(recording: Path, *, out: Path | None = None, in_place: bool = False) -> int:
    """Find gain and offset of each whisker from the lifted and lead-in samples of a scan; write a calibrated copy.

    Parameters
    ----------
    recording
        The scan, .h5.
    out
        Copy to write; NAME-calibrated.h5 beside the recording unless given.
    in_place
        Write the calibration into the recording itself.
    """
    if in_place and out is not None:
        raise CommandError("calibrate: --out and --in-place", hint="give one of them", status=USAGE)
    if not in_place and out is None:
        out = recording.with_name(f"{recording.stem}-calibrated{recording.suffix}")
    with failures_reported():
        from glyphs.errors import FileError
        from pipeline.formats.lead_in import calibrate_scan
        from pipeline.workers.options import in_a_worker
        from whisker_array.scan.recording import load_scan, save_calibration
        from whisker_array.scan.sensor import SensorError

        try:
            lead_in = calibrate_scan(in_a_worker(load_scan, recording, raw=True))
            unit = save_calibration(recording, lead_in.calibration, out=out)
        except SensorError as error:
            place = f"{error.where}: " if error.where else ""
            raise FileError(recording, f"cannot be calibrated: {place}{error.what}", error.hint) from error
    gain_unit = "1" if unit == "N mm" else f"{unit} / (N mm)"
    print(f"{'':7}  {'gain':>10}  {'offset':>9}  {'residual':>10}      samples\n"
          f"whisker  {gain_unit:>10}  {unit:>9}  {'N mm, rms':>10}    air   land")  # fmt: skip
    rows = zip(
        lead_in.calibration.gain,
        lead_in.calibration.offset_n_mm,
        lead_in.residual_n_mm,
        lead_in.air_samples,
        lead_in.land_samples,
        strict=True,
    )
    for whisker, (gain, offset, residual, air, land) in enumerate(rows):
        note = "" if land else "  never on the land: gain left at 1"
        print(f"{whisker:7d}  {gain:10.4f}  {offset:+9.4f}  {residual:10.4f}  {air:5d}  {land:5d}{note}")
    print(f"wrote {out or recording}")
    return 0
