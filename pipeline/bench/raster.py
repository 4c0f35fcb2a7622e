"""Scan a whole region with a bench's comb, line by line, without active choice of passes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime

from glyphs.surface.maps import TraceDirection
from recognition.active.active_reader import scan_of
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import Fitting, StageSession
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.passes import Pass


def raster_passes(
    fitting: Fitting, region_mm: tuple[float, float, float, float], directions: Iterable[TraceDirection]
) -> tuple[Pass, ...]:
    """Passes of the default raster for the character height, with the mounted comb.

    Args:
        fitting: fitting of the bench.
        region_mm: (x0, y0, x1, y1).
        directions: trace directions, in order.
    """
    usual = default_plan(region_mm, character_height_mm=fitting.height_mm, directions=tuple(directions))
    between = math.ceil(fitting.array.pitch_mm / usual.line_pitch_mm - 1e-9)
    return replace(usual, array=fitting.array, line_pitch_mm=fitting.array.pitch_mm / between).passes()


def feel_all(
    session: StageSession,
    passes: Sequence[Pass],
    *,
    on_pass: Callable[[int, Pass], None] = lambda k, order: None,
) -> Scan:
    """Run the passes one after the other.

    Args:
        session: session of the part; it stays open.
        passes: passes, in order.
        on_pass: callback after each pass, with its number from 1 and the pass.

    Raises:
        StageError: a pass failed.
    """
    began, felt = datetime.now(UTC).isoformat(timespec="seconds"), []
    for k, order in enumerate(passes, start=1):
        felt.append(session.feel(order))
        on_pass(k, order)
    return replace(scan_of(session.fitting, felt), start_time=began)
