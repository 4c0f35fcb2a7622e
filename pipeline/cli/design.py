"""`tactile-marks design`: design a whisker, and with --array a comb of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pipeline.cli.exit_status import CommandError, UsageError
from pipeline.cli.shared import Flag, write_picture
from pipeline.common.output_paths import PICTURES, check_writable
from pipeline.common.texts import split_commas

if TYPE_CHECKING:
    from pipeline.formats.whisker_file import WhiskerFile
    from whisker_array.design.design import Design
    from whisker_array.design.limits import Limits, Request

SectionName = Literal["auto", "ribbon", "round"]
MOST_WHISKERS = 500


def design(
    *,
    height_mm: float,
    alpha: str | None = None,
    mu: str | None = None,
    depth_mm: float | None = None,
    section: SectionName = "auto",
    speed_mm_s: float | None = None,
    beta_deg: str = "0:45",
    axis_clearance_mm: float = 1.5,
    sensitive_to: float | None = None,
    trade_offs: bool = True,
    out: Path | None = None,
    picture: Path | None = None,
    drawing: Path | None = None,
    whisker: Path | None = None,
    array: Flag = False,
    accuracy: float = 0.98,
    dirt: float = 0.3,
    length_mm: float | None = None,
    whiskers: str = "1,2,4,6,8,12,16,24,32,48",
) -> None:
    """Design the whisker that shows edges best in the worst case, and name the limits that bind.

    With --array: the comb of default whiskers and the plan that scan a serial in the least stage time.

    Args:
        height_mm: Character height, mm.
        alpha: Slopes of the walls of the marks, least:greatest, degrees, such as 30:60. Needed without --array.
        mu: Friction, least:greatest, such as 0.1:0.5. Needed without --array.
        depth_mm: Depth of the deepest marks, mm. Needed without --array.
        section: Section of the whisker.
        speed_mm_s: Scan speed to reach, mm/s (default: the usual one for the height).
        beta_deg: Setting angles that the holder allows, least:greatest, degrees; 0 keeps l1 level.
        axis_clearance_mm: Least height of the sensor's axis above the land: what the sensor needs below it, mm.
        sensitive_to: Tune the whisker to walls of this slope instead, degrees.
        trade_offs: Also report what a larger sideways slide, or another speed, would achieve.
        out: Whisker file to write, .toml, for `scan --whisker`.
        picture: Picture of the edge factor and the trade-offs to write, .png or .pdf.
        drawing: Drawing with dimensions for the workshop to write, .dxf or .svg; needs the extra drawing.
        whisker: Whisker file: report what that whisker achieves for these demands, in place of a design, and how
            certain that is if the file is from `identify`.
        array: Choose whiskers, rows, stagger, pitch, speed and plan instead.
        accuracy: With --array: share of the characters to be read right, as measured on simulated parts.
        dirt: With --array: severity of the dirt for that accuracy, one of those measured.
        length_mm: With --array: length of the line, mm (default: that of eight characters).
        whiskers: With --array: numbers of whiskers to compare, separated by commas.
    """
    if picture is not None:
        check_writable(picture, PICTURES)
    if array:
        from pipeline.cli.design_report import print_arrays
        from pipeline.plots.design_picture import array_figure
        from whisker_array.design.array_design import ArrayRequest, design_arrays

        wanted = ArrayRequest(
            character_height_mm=height_mm, accuracy=accuracy, severity=dirt, length_mm=length_mm
        )
        choices = design_arrays(wanted, sizes=_sizes(whiskers))
        print_arrays(wanted, choices)
        if picture is not None:
            write_picture(array_figure(wanted, choices), picture)
        return
    if alpha is None or mu is None or depth_mm is None:
        raise UsageError("design: --alpha, --mu and --depth-mm are needed", "give all three, or --array")
    from pipeline.cli.design_report import explain_failure, print_report
    from pipeline.formats.whisker_file import SUFFIX, write_whisker_file
    from whisker_array.design.design import NoWhiskerError, design_whisker
    from whisker_array.design.limits import DesignError, Limits, Request
    from whisker_array.design.trade import slide_trade_off, speed_trade_off
    from whisker_array.design.tuned import tune

    low, high = _range("--alpha", alpha)
    flat, steep = _range("--beta-deg", beta_deg)
    if not 0.0 <= flat <= steep <= 80.0:
        raise UsageError(f"--beta-deg is {beta_deg}", "setting angles lie between 0 and 80")
    request = Request(
        alpha_rad=(math.radians(low), math.radians(high)), mu=_range("--mu", mu), depth_mm=depth_mm,
        character_height_mm=height_mm, speed_mm_s=speed_mm_s,
    )  # fmt: skip
    if axis_clearance_mm < 0.0:
        raise UsageError(f"--axis-clearance-mm is {axis_clearance_mm:g}", "give 0 or more")
    limits = Limits(beta_rad=(math.radians(flat), math.radians(steep)), axis_clearance_mm=axis_clearance_mm)
    if whisker is not None:
        if any(flag is not None for flag in (out, picture, drawing, sensitive_to)):
            raise UsageError(
                "design: --whisker reports an existing whisker and designs none",
                "leave out --out, --picture, --drawing and --sensitive-to",
            )
        return _report_built(whisker, request, limits)
    if out is not None:
        check_writable(out, (SUFFIX,))
    if drawing is not None:
        from pipeline.plots.whisker_drawing import check_drawing, save_drawing

        check_drawing(drawing)
    within: Any = {"limits": limits, "section": section}
    tuned = None if sensitive_to is None else tune(math.radians(sensitive_to), request, **within)
    try:
        chosen = tuned.design if tuned else design_whisker(request, **within)
    except NoWhiskerError as error:
        raise DesignError(explain_failure(error)) from error
    trades = (slide_trade_off(chosen), speed_trade_off(chosen)) if trade_offs and tuned is None else ()
    print_report(chosen, trades=trades, tuned=tuned)
    if out is not None:
        write_whisker_file(out, _file(chosen))
        print(f"wrote {out}")
    if drawing is not None:
        save_drawing(_file(chosen), drawing)
        print(f"wrote {drawing}")
    if picture is not None:
        from pipeline.plots.design_picture import design_figure

        write_picture(design_figure(chosen, trades=trades, tuned=tuned), picture)


def _report_built(path: Path, request: Request, limits: Limits) -> None:
    import numpy as np

    from pipeline.cli.design_report import fitness, print_limits
    from pipeline.formats.whisker_file import read_whisker_file
    from pipeline.reading.identified import prediction_lines
    from pipeline.reading.predictions import predictions
    from whisker_array.design.checks import check
    from whisker_array.identification.knowledge import Knowledge

    built = read_whisker_file(path)
    if built.whisker.is_straight:
        raise CommandError(f"{path} is a straight whisker", hint="it is a profiler: F is 1 on every wall")
    known = built.known or Knowledge((), np.zeros((0, 0)))
    predicted = predictions(built.whisker, built.touch, known, more=fitness(request))
    print("\n".join(prediction_lines(predicted, measured=built.known is not None)))
    print_limits(check(built.whisker, request, limits, preload_mm=built.touch.preload_mm).rows())


def _range(flag: str, text: str) -> tuple[float, float]:
    try:
        low, high = [float(end) for end in text.split(":")] * (1 if ":" in text else 2)
    except ValueError:
        low = high = math.nan
    if not low <= high:
        raise UsageError(f"{flag} is {text!r}", "write least:greatest, such as 30:60, or one number")
    return low, high


def _sizes(text: str) -> tuple[int, ...]:
    try:
        sizes = sorted({int(item) for item in split_commas(text)})
    except ValueError:
        sizes = []
    if not sizes or not 1 <= sizes[0] <= sizes[-1] <= MOST_WHISKERS:
        raise UsageError(
            f"design: --whiskers is {text!r}", f"write numbers from 1 to {MOST_WHISKERS} separated by commas"
        )
    return tuple(sizes)


def _file(built: Design) -> WhiskerFile:
    """The design as a whisker file; the stage is set up at the nominal friction, if it is in the range."""
    from pipeline.formats.whisker_file import WhiskerFile
    from whisker_array.whisker.defaults import NOMINAL_FRICTION
    from whisker_array.whisker.touch import Touch

    whisker, (least, most) = built.whisker, built.request.mu
    friction = min(max(NOMINAL_FRICTION, least), most)
    return WhiskerFile(
        whisker=whisker,
        touch=Touch.of(
            whisker, preload_mm=built.preload_mm, tip_radius_mm=built.request.tip_radius_mm, friction=friction
        ),
        character_height_mm=built.request.character_height_mm,
        line_pitch_mm=built.request.line_pitch_mm,
        sample_pitch_mm=built.request.sample_pitch_mm,
        speed_mm_s=built.speed_mm_s,
    )
