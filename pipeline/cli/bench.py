"""`tactile-marks bench`: bring up, calibrate and use a real bench."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipeline.cli.exit_status import CommandError, UsageError
from pipeline.cli.shared import Flag

if TYPE_CHECKING:
    from pipeline.bench.bench import Bench
    from pipeline.bench.settings import BenchSettings
    from whisker_array.whisker.passes import Pass

Region = tuple[float, float, float, float]
_CALIBRATED_HEIGHTS = 3.0  # length of bare land for a calibration, character heights


@contextlib.contextmanager
def _open_bench(settings: BenchSettings) -> Iterator[Bench]:
    """Open a bench; SIGTERM and SIGHUP end it like an interrupt, so that it lifts and is closed."""
    from pipeline.bench.bench import Bench

    def end(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():
        before = {sign: signal.signal(sign, end) for sign in (signal.SIGTERM, signal.SIGHUP)}
    try:
        with Bench(settings) as bench:
            yield bench
    finally:
        for sign, handler in before.items():
            signal.signal(sign, handler)


def check(bench: Path, /) -> None:
    """Ask stage and converter to identify themselves; nothing moves.

    Args:
        bench: The bench, bench.toml.
    """
    from pipeline.bench.settings import read_bench

    with _open_bench(read_bench(bench)) as opened:
        print(f"stage: {opened.greeting}\nconverter: {opened.daq.describe()}")


def home(bench: Path, /) -> None:
    """Lift the comb and find the ends of all axes; also after a crash or an alarm.

    Args:
        bench: The bench, bench.toml.
    """
    from pipeline.bench.settings import read_bench

    with _open_bench(read_bench(bench)) as opened:
        opened.home()
        x, y, z = opened.stage.place_mm()
        print(f"homed; the stage is at x {x:.2f}, y {y:.2f}, z {z:.2f} mm, lifted")


def calibrate(bench: Path, /) -> None:
    """Find every whisker's gain on a bare plate, and print the lines for bench.toml.

    Args:
        bench: The bench, bench.toml; a plate without marks must lie under the comb.
    """
    from glyphs.surface.maps import TraceDirection
    from pipeline.bench.settings import read_bench
    from whisker_array.whisker.passes import Pass

    settings = read_bench(bench)
    x0, y0, x1, y1 = settings.plate.field_mm
    height, comb = settings.comb.character_height_mm, settings.comb
    reach = min(0.5 * _CALIBRATED_HEIGHTS * height, 0.4 * (x1 - x0))
    wide = comb.pitch_mm * (comb.n_whiskers - 1)
    if wide > y1 - y0:
        raise CommandError(
            f"the comb is {wide:.1f} mm wide, the field {y1 - y0:.1f} mm high",
            hint="use a wider bare plate, and set field_mm to it",
        )
    first = 0.5 * (y0 + y1 - wide)
    order = Pass(
        TraceDirection.FORWARD_X,
        tuple(first + comb.pitch_mm * i for i in range(comb.n_whiskers)),
        (0.5 * (x0 + x1) - reach, 0.5 * (x0 + x1) + reach),
        sample_pitch_mm=height / 80.0,
        speed_mm_s=5.0 * height,
        air_samples=256,
    )
    with _open_bench(settings) as opened:
        opened.home()
        gains = opened.calibrate(order)
    print("gains_known = true")
    print(f"volt_per_n_mm = [{', '.join(f'{g:.5g}' for g in gains.gain)}]")


def scan(
    bench: Path,
    /,
    *,
    out: Path | None = None,
    dry_run: Path | None = None,
    region: Region | None = None,
    directions: tuple[Literal[0, 90, 180, 270], ...] = (),
    each_whisker: Flag = False,
    part_id: str = "",
    active: Flag = False,
    budget_s: float = 60.0,
    format: str | None = None,
) -> None:
    """Scan the part under the comb and record the raw moments; homes first.

    Args:
        bench: The bench, bench.toml.
        out: Recording to write, .h5.
        dry_run: Move nothing: print the moves and draw them into this picture (.svg, .png).
        region: x0 y0 x1 y1 in mm from the plate's corner (default: the bench's field).
        directions: Trace directions in degrees (default: all four if the comb turns, else 0).
        each_whisker: Move every whisker over the whole region, there and back, on lines a quarter of a character height
            apart: for a test piece, which is narrower than the comb. The tips run beyond the region by the width of the
            comb.
        part_id: Name of the part.
        active: Choose pass after pass while reading, and stop when the serial is sure; it needs a comb that turns.
        budget_s: Most stage seconds with --active.
        format: Format of the serial, with --active, such as AA999999; see read --format.
    """
    from glyphs.surface.maps import TraceDirection
    from pipeline.bench.bench import feel_all, raster_passes
    from pipeline.bench.settings import read_bench
    from pipeline.cli.whisker import check_recording, scan_actively
    from whisker_array.scan.read_recording import line_pitch_of
    from whisker_array.scan.recording import save_scan
    from whisker_array.whisker.array import ALL_DIRECTIONS

    if (out is None) == (dry_run is None):
        raise UsageError("bench scan: give --out, or --dry-run")
    if active and (dry_run is not None or directions or region is not None or each_whisker):
        raise UsageError(
            "bench scan: --active chooses its passes",
            "leave out --dry-run, --region, --directions and --each-whisker",
        )
    settings = read_bench(bench)
    fitting = settings.fitting()
    possible = ALL_DIRECTIONS if settings.stage.turn_axis else ALL_DIRECTIONS[:1]
    ways = [TraceDirection(d) for d in directions or possible]
    passes = raster_passes(fitting, region or fitting.field_mm, ways, each_whisker=each_whisker)
    if dry_run is not None:
        return _draw(passes, settings, dry_run)
    assert out is not None
    check_recording(out)
    with _open_bench(settings) as opened:
        session = opened.session(part_id)
        if active:
            return scan_actively(session, out, height_mm=fitting.height_mm, budget_s=budget_s, format=format)
        felt = feel_all(
            session,
            passes,
            on_pass=lambda k, order: print(f"pass {k} of {len(passes)}: {order.describe()}", flush=True),
        )
        session.close()
    # lines of a test piece are further apart than those of the default raster
    save_scan(replace(felt, line_pitch_mm=line_pitch_of(felt.sweeps)) if each_whisker else felt, out)
    print(f"wrote {out}")


def _draw(passes: tuple[Pass, ...], settings: BenchSettings, picture: Path) -> None:
    from pipeline.bench.moves import moves_of
    from pipeline.plots.bench_picture import moves_figure
    from pipeline.plots.pictures import save_figure

    preload = settings.fitting().touch.preload_mm
    moves = [moves_of(order, settings, preload_mm=preload) for order in passes]
    for k, (order, move) in enumerate(zip(passes, moves, strict=True), start=1):
        (x0, y0), (x1, y1) = move.begin_mm, move.end_mm
        print(
            f"{k:4d}  {int(order.direction):3d}°  x {x0:.2f} to {x1:.2f}, y {y0:.2f} to {y1:.2f}, "
            f"z {move.lift_z_mm:.2f} down to {move.touch_z_mm:.2f} mm, {move.speed_mm_s:.1f} mm/s, "
            f"{move.ramp.duration_s:.2f} s"
        )
    save_figure(moves_figure(moves, settings), picture)
    print(f"{len(moves)} passes, all within the stage's travel; wrote {picture}; nothing has moved")
