"""`tactile-marks design --array`: which comb of whiskers, and which plan."""

from __future__ import annotations

from pathlib import Path

from pipeline.cli.choices import listed
from pipeline.cli.exit_status import USAGE, CommandError, failures_reported

MOST_WHISKERS = 500


def design_array(
    *,
    height_mm: float,
    accuracy: float,
    dirt: float,
    length_mm: float | None,
    speed_error: float,
    whiskers: str,
    picture: Path | None,
) -> int:
    """Print the table, and draw the picture; see `pipeline.cli.design.design`."""
    with failures_reported():
        from whisker_array.design.array_design import ArrayRequest, array_words, design_arrays

        sizes = _sizes(whiskers)
        request = ArrayRequest(
            character_height_mm=height_mm,
            accuracy=accuracy,
            severity=dirt,
            length_mm=length_mm,
            speed_error=speed_error,
        )
        if picture is not None:
            from pipeline.plots.pictures import check_picture

            check_picture(picture)
        choices = design_arrays(request, sizes=sizes)
        print("\n".join(array_words(request, choices)))
        if picture is not None:
            from pipeline.plots.array_picture import array_figure
            from pipeline.plots.pictures import save_figure

            save_figure(array_figure(request, choices), picture)
            print(f"wrote {picture}")
    return 0


def _sizes(text: str) -> tuple[int, ...]:
    """Numbers of whiskers, ascending."""
    try:
        sizes = sorted({int(item) for item in listed(text)})
    except ValueError:
        sizes = []
    if not sizes or not 1 <= sizes[0] <= sizes[-1] <= MOST_WHISKERS:
        raise CommandError(
            f"design: --whiskers is {text!r}",
            hint=f"write numbers from 1 to {MOST_WHISKERS} separated by commas",
            status=USAGE,
        )
    return tuple(sizes)
