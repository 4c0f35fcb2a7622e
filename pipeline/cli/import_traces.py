"""`tactile-marks import`: traces recorded by others, as a scan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported


def import_traces(
    files: Annotated[list[Path], Parameter(consume_multiple=True)],
    /,
    *,
    traces: Path,
    out: Path,
) -> int:
    """Make a scan of traces recorded by others: positions and signals in, what `read` and `inspect` take out.

    Parameters
    ----------
    files
        .csv, .txt, .tsv or .tdms (with the extra tdms), in the order in which they were recorded.
    traces
        What stands in them, .toml: columns, units, where the whiskers are.
    out
        Recording to write, .h5.
    """
    with failures_reported():
        from glyphs.atomic import check_writable
        from glyphs.errors import FileError
        from pipeline.formats.import_traces import import_traces as imported
        from pipeline.formats.kinds import is_scan
        from pipeline.formats.traces_file import read_traces_file
        from pipeline.formats.whisker_file import read_whisker_file
        from whisker_array.scan.read_recording import VOLT
        from whisker_array.scan.recording import save_scan

        if not is_scan(out):
            raise CommandError(f"{out}: a recording ends in .h5", status=USAGE)
        if not files:
            raise CommandError("import: no files", hint="name the traces to be imported", status=USAGE)
        check_writable(out)
        told = read_traces_file(traces)
        whisker = traces.parent / told.whisker
        if not whisker.is_file():
            raise FileError(traces, f"names the whisker {told.whisker}, which is not there", "put it beside")
        volts = told.moment_unit == VOLT
        scan = imported(files, told, touch=read_whisker_file(whisker).touch)
        save_scan(scan, out, volts=volts)
    passes = ", ".join(f"{s.plan.line_mm.shape[0]} at {int(s.plan.direction)}°" for s in scan.sweeps)
    print(
        f"wrote {out}: passes {passes} of {scan.n_whiskers} whiskers, samples {scan.sweeps[0].plan.step_mm:.4f} mm "
        f"apart at {scan.sample_rate_hz:,.0f} Hz"
    )
    if volts:
        print(f"its signals are in volts: run tactile-marks calibrate {out}")
    return 0
