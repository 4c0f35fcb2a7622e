"""`tactile-marks bench`: a bench of iron brought up, calibrated and scanned with, and one that is emulated."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipeline.cli.choices import Flag
from pipeline.cli.exit_status import CommandError, UsageError

if TYPE_CHECKING:
    from pipeline.bench.settings import BenchSettings
    from whisker_array.whisker.passes import Pass

Region = tuple[float, float, float, float]
_CALIBRATED_HEIGHTS = 3.0
"""Bare land that a calibration is taken from, character heights."""


@contextlib.contextmanager
def _lifting_at_the_end() -> Iterator[None]:
    """Take a request to end as an interrupt, so that whatever is open is closed, and lifts."""

    def end(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():
        before = {one: signal.signal(one, end) for one in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


@_lifting_at_the_end()
def check(bench: Path) -> int:
    """Ask stage and converter who they are; nothing moves.

    Parameters
    ----------
    bench
        The bench, bench.toml.
    """
    from pipeline.bench.bench import Bench
    from pipeline.bench.settings import read_bench

    with Bench(read_bench(bench)) as opened:
        print(f"stage: {opened.greeting}\nconverter: {opened.daq.describe()}")
    return 0


@_lifting_at_the_end()
def home(bench: Path) -> int:
    """Lift the comb, find the ends of all axes, and carry it lifted; also after a crash or an alarm.

    Parameters
    ----------
    bench
        The bench, bench.toml.
    """
    from pipeline.bench.bench import Bench
    from pipeline.bench.settings import read_bench

    with Bench(read_bench(bench)) as opened:
        opened.home()
        x, y, z = opened.stage.place_mm()
        print(f"homed; the stage stands at x {x:.2f}, y {y:.2f}, z {z:.2f} mm, lifted")
    return 0


@_lifting_at_the_end()
def calibrate(bench: Path) -> int:
    """Find every whisker's gain on a bare plate, and print the lines for bench.toml.

    Parameters
    ----------
    bench
        The bench, bench.toml; under the comb lies a plate without marks.
    """
    from glyphs.surface.maps import TraceDirection
    from pipeline.bench.bench import Bench
    from pipeline.bench.settings import read_bench
    from whisker_array.whisker.passes import Pass

    settings = read_bench(bench)
    x0, y0, x1, y1 = settings.plate.field_mm
    height, comb = settings.comb.character_height_mm, settings.comb
    reach = min(0.5 * _CALIBRATED_HEIGHTS * height, 0.4 * (x1 - x0))
    order = Pass(
        TraceDirection.FORWARD_X,
        tuple(
            0.5 * (y0 + y1) + comb.pitch_mm * (i - 0.5 * (comb.n_whiskers - 1))
            for i in range(comb.n_whiskers)
        ),
        (0.5 * (x0 + x1) - reach, 0.5 * (x0 + x1) + reach),
        sample_pitch_mm=height / 80.0,
        speed_mm_s=5.0 * height,
        air_samples=256,
    )
    if min(order.line_mm) < y0 or max(order.line_mm) > y1:
        raise CommandError(
            f"the comb is {max(order.line_mm) - min(order.line_mm):.1f} mm wide, the field {y1 - y0:.1f} mm high",
            hint="lay a wider bare plate under it and say so in field_mm",
        )
    with Bench(settings) as opened:
        opened.home()
        found = opened.calibrated(order)
    print("gains_known = true")
    print(f"volt_per_n_mm = [{', '.join(f'{g:.5g}' for g in found.gain)}]")
    return 0


@_lifting_at_the_end()
def scan(
    bench: Path,
    *,
    out: Path | None = None,
    dry_run: Path | None = None,
    region: Region | None = None,
    directions: tuple[Literal[0, 90, 180, 270], ...] = (),
    part_id: str = "",
    active: Flag = False,
    budget_s: float = 60.0,
    format: str | None = None,
) -> int:
    """Scan the part under the comb and record the raw moments; homes first.

    Parameters
    ----------
    bench
        The bench, bench.toml.
    out
        Recording to write, .h5.
    dry_run
        Move nothing: print the moves and draw them into this picture (.svg, .png).
    region
        x0 y0 x1 y1 in mm from the plate's corner (default: the bench's field).
    directions
        Trace directions in degrees; all four where the comb turns, else 0.
    part_id
        What the part is called.
    active
        Choose pass after pass while reading, and stop when the serial is sure; it needs a comb that turns.
    budget_s
        Most stage seconds with --active.
    format
        What the serial looks like, with --active, such as AA999999; as read --format takes it.
    """
    from glyphs.atomic import check_writable
    from pipeline.bench.bench import Bench
    from pipeline.bench.settings import read_bench
    from pipeline.cli.whisker import check_recording, scan_actively

    if (out is None) == (dry_run is None):
        raise UsageError("bench scan: give --out, or --dry-run")
    if active and (dry_run is not None or directions or region is not None):
        raise UsageError(
            "bench scan: --active chooses its passes", "leave out --dry-run, --region and --directions"
        )
    settings = read_bench(bench)
    if dry_run is not None:
        return _drawn(_raster(settings, region, directions), settings, dry_run)
    assert out is not None
    check_recording(out)
    check_writable(out)
    if active:
        with Bench(settings) as opened:
            session = opened.session(part_id)
            height_mm = settings.comb.character_height_mm
            return scan_actively(session, out, height_mm=height_mm, budget_s=budget_s, format=format)
    from pipeline.bench.raster import feel_all
    from whisker_array.scan.recording import save_scan

    passes = _raster(settings, region, directions)
    with Bench(settings) as opened:
        session = opened.session(part_id)
        made = feel_all(
            session,
            passes,
            told=lambda k, order: print(f"pass {k} of {len(passes)}: {order.describe()}", flush=True),
        )
        session.close()
    save_scan(made, out)
    print(f"wrote {out}")
    return 0


@_lifting_at_the_end()
def emulate(bench: Path, *, out: Path, part: Path | None = None, seed: int = 0, pace: float = 0.0) -> int:
    """Stand in for a bench: controller and converter answer at pseudo-terminals, until Ctrl-C.

    Parameters
    ----------
    bench
        The bench to stand in for, bench.toml.
    out
        Bench file to write: the same bench, at the pseudo-terminals.
    part
        Height map of the part in the middle of the field; a bare plate without.
    seed
        Of gains, offsets and noise: the same seed is the same bench.
    pace
        Seconds of ours for one of the bench; 0 is as fast as it goes, 1 is real.
    """
    import numpy as np

    from glyphs.surface.maps import HeightMap
    from pipeline.bench.emulator.bench import EmulatedBench
    from pipeline.bench.settings import read_bench, write_bench
    from pipeline.formats.npz import read_soil
    from pipeline.formats.touch_file import read_height_map

    settings = read_bench(bench)
    if part is not None:
        surface = read_height_map(part)
        soil = read_soil(part)
    else:
        surface, soil = (
            HeightMap(np.zeros((8, 8), np.float32), settings.comb.character_height_mm / 40.0),
            None,
        )
    with EmulatedBench(surface, settings, seed=seed, soil=soil, pace=pace) as emulated:
        write_bench(out, emulated.settings)
        print(
            f"a {settings.stage.firmware} stage at {emulated.settings.stage.port} and a converter at "
            f"{emulated.settings.daq.port}; use {out}, end with Ctrl-C",
            flush=True,
        )
        threading.Event().wait()
    return 0


def _raster(
    settings: BenchSettings, region: Region | None, directions: tuple[Literal[0, 90, 180, 270], ...]
) -> tuple[Pass, ...]:
    """The whole plan for the bench's comb."""
    from glyphs.surface.maps import TraceDirection
    from pipeline.bench.raster import raster_passes
    from whisker_array.whisker.array import ALL_DIRECTIONS

    ways = tuple(TraceDirection(d) for d in directions)
    if not ways:
        ways = ALL_DIRECTIONS if settings.stage.turn_axis else ALL_DIRECTIONS[:1]
    fitting = settings.fitting()
    return raster_passes(fitting, region or fitting.field_mm, ways)


def _drawn(passes: tuple[Pass, ...], settings: BenchSettings, picture: Path) -> int:
    """The moves of passes, printed and drawn."""
    from glyphs.atomic import replacing
    from pipeline.bench.moves import moves_of
    from pipeline.plots.moves_picture import moves_figure

    preload = settings.touch().preload_mm
    moves = [moves_of(order, settings, preload_mm=preload) for order in passes]
    for k, (order, one) in enumerate(zip(passes, moves, strict=True), start=1):
        (x0, y0), (x1, y1) = one.begin_mm, one.end_mm
        print(
            f"{k:4d}  {int(order.direction):3d}°  x {x0:.2f} to {x1:.2f}, y {y0:.2f} to {y1:.2f}, "
            f"z {one.lift_z_mm:.2f} down to {one.touch_z_mm:.2f} mm, {one.speed_mm_s:.1f} mm/s, "
            f"{one.ramp.duration_s:.2f} s"
        )
    figure = moves_figure(moves, settings)
    with replacing(picture) as temporary:
        figure.savefig(temporary, format=picture.suffix.lstrip(".") or "svg")
    print(f"{len(moves)} passes, all within the stage's travel; wrote {picture}; nothing has moved")
    return 0
