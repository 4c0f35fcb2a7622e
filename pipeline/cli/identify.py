"""`identify`: the whisker and bench that made a recording over a test piece."""

from __future__ import annotations

from pathlib import Path

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported


def identify(
    recording: Path,
    *,
    piece: Path,
    whisker: Path | None = None,
    out: Path | None = None,
    figure: Path | None = None,
) -> int:
    """Find the whisker and bench that made a recording over a piece of known relief.

    Parameters
    ----------
    recording
        The scan, .h5, of four directions and back at best; `scan PIECE.toml` makes one to try it.
    piece
        TOML of a test piece, or the height map of any other, with its corner where the scan's frame begins.
    whisker
        The whisker as drawn, a file that `design` writes. Without it lengths, angle and stiffness are not looked for.
    out
        Whisker file to write, with what was found in place of what was drawn; needs --whisker.
    figure
        Picture (.svg, .png) of what was felt, what the bench found predicts, and what is left over.
    """
    if out is not None and whisker is None:
        raise CommandError("--out writes a whisker, and none was given", hint="add --whisker", status=USAGE)
    with failures_reported():
        from pipeline.reading.identified import identify_recording, table_of, write_found
        from pipeline.workers.options import in_a_worker

        found, drawn = in_a_worker(identify_recording, recording, piece, whisker)
        print("\n".join(table_of(found)))
        if out is not None and drawn is not None:
            write_found(out, found, drawn)
            print(f"wrote {out}")
        if figure is not None:
            from pipeline.plots.identified import draw_identified

            draw_identified(found, figure)
            print(f"wrote {figure}")
    return 0
