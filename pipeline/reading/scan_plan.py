"""Plan a touch scan from the camera's reading, and turn the plan into a raster. The region is in the photograph's
frame, with the photograph's middle (`ScanPlanRecord.middle_mm`); without a scale it is the stage's whole field."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from pipeline.common.reading_records import ScanPlanRecord
from whisker_array.scan.session import Fitting, StageSession
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.passes import Pass

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from pipeline.common.settings import ReadSettings
    from recognition.decide.reading import Reading

MARGIN_ALONG_HEIGHTS, MARGIN_ACROSS_HEIGHTS = 2.5, 1.0
"""Land scanned around the line, in character heights: dirt may have hidden a character at an end."""
TRUSTED_SHARE = 0.8
"""Least mean confidence of the characters for which the camera's line position is trusted; below it all is scanned."""
USUAL_HEIGHT_MM = 5.0  # of a character, if neither camera nor settings give its height
STAGE_FIELD_MM = (60.0, 25.0)


def plan_of(
    vision: Reading,
    photo: Photo,
    settings: ReadSettings,
    *,
    field_mm: tuple[float, float] = STAGE_FIELD_MM,
    reason: str = "",
) -> ScanPlanRecord:
    """Plan the scan that resolves the doubts of the camera: around the line, over the whole picture if no line was
    found with certainty, or over the stage's field (width and height `field_mm`) if the photograph has no pitch."""
    from recognition.see.photo_frame import photo_middle_mm
    from whisker_array.whisker.array import default_plan
    from whisker_array.whisker.touch import default_touch

    known = photo.pitch_mm is not None
    region, height_mm = (0.0, 0.0, *field_mm), settings.height_mm or USUAL_HEIGHT_MM
    if known:
        region, height_mm = _around(vision, photo, settings.height_mm)
    raster = default_plan(region, character_height_mm=height_mm, speed_mm_s=settings.speed_mm_s)
    x0, y0, x1, y1 = (round(v, 3) for v in region)
    return ScanPlanRecord(
        region_mm=(x0, y0, x1, y1),
        directions_deg=tuple(int(d) for d in raster.directions),
        passes=raster.n_passes,
        line_pitch_mm=raster.line_pitch_mm,
        sample_pitch_mm=raster.sample_pitch_mm,
        speed_mm_s=raster.speed_mm_s,
        preload_mm=default_touch(height_mm).preload_mm,
        seconds=round(raster.scan_time_s, 1),
        height_mm=height_mm,
        reason=reason,
        middle_mm=photo_middle_mm(photo) if known else None,
    )


def seen_region(
    vision: Reading, photo: Photo, *, height_mm: float | None
) -> tuple[float, float, float, float] | None:
    """(x0, y0, x1, y1) around the line that the camera found, in the photograph's frame, mm, if it is trusted."""
    if photo.pitch_mm is None or vision.trace.line is None or _mean_confidence(vision) < TRUSTED_SHARE:
        return None
    return _around(vision, photo, height_mm)[0]


def _around(
    vision: Reading, photo: Photo, height_mm: float | None
) -> tuple[tuple[float, float, float, float], float]:
    from recognition.see.photo_frame import photo_middle_mm, photo_origin_mm

    left, top = photo_origin_mm(photo)
    middle = photo_middle_mm(photo)
    right, bottom = 2.0 * middle[0] - left, 2.0 * middle[1] - top
    picture, line = (left, top, right, bottom), vision.trace.line
    if line is None:
        return picture, height_mm or USUAL_HEIGHT_MM
    height = height_mm or float(f"{line.height_mm:.3g}")
    if _mean_confidence(vision) < TRUSTED_SHARE:
        # dirt that fills the picture is easily mistaken for one line as high as the picture
        return picture, min(height, 0.5 * (bottom - top))
    half = 0.5 * line.height_mm
    x0, y0 = (float(v) - half for v in line.centre_mm.min(axis=0))
    x1, y1 = (float(v) + half for v in line.centre_mm.max(axis=0))
    turn = math.radians(line.turned_deg)
    along, across = MARGIN_ALONG_HEIGHTS * height, MARGIN_ACROSS_HEIGHTS * height
    # the greater margin lies along the line, however it is turned
    wide = max(across, abs(math.cos(turn)) * along)
    high = max(across, abs(math.sin(turn)) * along)
    x0, y0, x1, y1 = x0 - wide, y0 - high, x1 + wide, y1 + high
    x0, y0, x1, y1 = max(x0, left), max(y0, top), min(x1, right), min(y1, bottom)
    if x1 - x0 < height or y1 - y0 < height:  # the line lies outside the picture
        return picture, height
    return (x0, y0, x1, y1), height


def _mean_confidence(vision: Reading) -> float:
    confidences = [c.confidence for c in vision.characters]
    return math.fsum(confidences) / len(confidences) if confidences else 0.0


class FramedSession:
    """A `StageSession` with its own frame for orders and samples: (x_mm, y_mm) is a place in the stage's frame minus
    the same in this one. (x0, y0, x1, y1) `field_mm` may be scanned, in this frame."""

    def __init__(
        self,
        session: StageSession,
        *,
        x_mm: float,
        y_mm: float,
        field_mm: tuple[float, float, float, float],
    ) -> None:
        self._session, self._x_mm, self._y_mm = session, x_mm, y_mm
        self.fitting: Fitting = replace(session.fitting, field_mm=field_mm)

    def feel(self, order: Pass) -> Sweep:
        moved = order.moved(self._x_mm, self._y_mm)
        return replace(self._session.feel(moved), plan=order.sweep_plan())

    def close(self) -> None:
        self._session.close()
