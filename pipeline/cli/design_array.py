"""`tactile-marks design --array`: which comb of whiskers, and which plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.choices import listed
from pipeline.cli.exit_status import USAGE, CommandError, failures_reported

if TYPE_CHECKING:
    from whisker_array.design.array_design import ArrayChoice, ArrayRequest

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
        from whisker_array.design.array_design import ArrayRequest, design_arrays

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
        print("\n".join(array_report(request, choices)))
        if picture is not None:
            from pipeline.plots.array_picture import array_figure
            from pipeline.plots.pictures import save_figure

            save_figure(array_figure(request, choices), picture)
            print(f"wrote {picture}")
    return 0


def array_report(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> list[str]:
    """List the choices as a table and the quickest one in words; no line is wider than 80 characters."""
    import math

    from whisker_array.design.array_design import ribbon_mm
    from whisker_array.design.plan_accuracy import ways_words

    x0, y0, x1, y1 = request.region_mm
    out = [
        f"Characters {request.character_height_mm:g} mm high, {x1 - x0:.1f} x {y1 - y0:.1f} mm felt,",
        f"{100 * request.accuracy:g} % of characters right at dirt {request.severity:g} (as measured):",
        "",
        "whiskers  rows  stagger  pitch  ribbon  incl.  lines  ways  passes  mm/s  stage",
        "                     mm     mm      mm                                        s",
    ]
    for c in choices:
        a = c.plan.array
        out.append(
            f"{a.n_whiskers:8d}  {a.rows:4d}  {a.stagger_mm:7.2f}  {a.pitch_mm:5.2f}  {ribbon_mm(c.whisker):6.2f}"
            f"  {math.degrees(c.whisker.beta_rad):4.0f}°  {c.lines:5d}  {len(c.measured.directions):4d}"
            f"  {c.plan.n_passes:6d}  {c.plan.speed_mm_s:4.0f}  {c.stage_s:5.1f}"
        )
    best = min(choices, key=lambda c: c.stage_s)
    read = best.measured
    out += [
        "",
        f"Quickest: {best.plan.array.n_whiskers} whiskers, {best.stage_s:.1f} s a serial, "
        f"{ways_words(read.directions)}; of {read.parts} parts so",
        f"felt, {100 * read.accuracy:.1f} % (+-{100 * read.spread:.1f}) of characters were right, "
        f"{read.accepted} accepted, {read.accepted_wrong} of these wrong.",
        "Accuracy was measured with the default whisker, slow: python",
        "tests/benchmarks/plan_accuracy.py. Speed makes the edge map wrong by "
        f"{100 * request.speed_error:g} %.",
    ]
    return out


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
