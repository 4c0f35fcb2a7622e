"""What touch feels of parts in tests, and parts that are tilted, shallower, or struck by blows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial.transform import Rotation

from glyphs.fonts.glyph import Font
from glyphs.soiling.soil import Soil
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap, TraceDirection
from recognition.enrol.learned_font import Hand
from recognition.see.curves import straight_through
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import HEIGHTS, KNOWN, LAYERS, View, ViewKind
from whisker_array.estimation.relief import Relief
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.whisker.array import ALL_DIRECTIONS, default_plan
from whisker_array.whisker.touch import Touch, default_touch

# -------------------------------------------------------------------------------------------------------------- felt


def felt(
    surface: HeightMap,
    height_mm: float = 5.0,
    *,
    touch: Touch | None = None,
    directions: tuple[TraceDirection, ...] = ALL_DIRECTIONS,
    **more: Any,
) -> Scan:
    """A scan of all of it, for characters so high; `more` is for `trace_scan`."""
    plan = default_plan((0.0, 0.0, *surface.size_mm), character_height_mm=height_mm, directions=directions)
    return trace_scan(surface, touch=touch or default_touch(height_mm), plan=plan, **more)


def view_of(relief: Relief) -> View:
    """The view of a surface without edges."""
    layers = np.zeros((LAYERS, *relief.height_mm.shape), dtype=np.float32)
    layers[KNOWN] = np.isfinite(relief.height_mm)
    layers[HEIGHTS] = np.nan_to_num(relief.height_mm)
    return View(ViewKind.FELT, layers, relief.pitch_mm, relief.origin_mm)


def stamped_line(part: StampedPart) -> tuple[TextLine, NDArray[np.float64]]:
    """The straight line through the characters of a part, and the columns of its strip where they stand."""
    boxes = np.array(part.boxes_mm)
    middles = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    half = 0.5 * part.height_mm
    along = np.linalg.norm(middles - middles[0], axis=1) + half
    line = TextLine(straight_through(middles, before=half, after=half), part.height_mm)
    return line, (along / part.height_mm + MARGIN) * HEIGHT_ROWS - 0.5


def shallower(part: StampedPart, which: int, *, floor_mm: float, below: float = 0.0) -> HeightMap:
    """The part with one character struck less deep by the same die, or only its part below a share of its box."""
    z, pitch = part.height_map.z_mm.copy(), part.height_map.pitch_mm
    x0, y0, x1, y1 = part.boxes_mm[which]
    y0 += below * (y1 - y0)
    cell = (slice(int(y0 / pitch) - 1, int(y1 / pitch) + 3), slice(int(x0 / pitch) - 1, int(x1 / pitch) + 3))
    lifted = z[cell] - z[cell].min() - floor_mm
    z[cell] = np.minimum(lifted, 0.0)
    return HeightMap(z, pitch)


# ------------------------------------------------------------------------------------------------------------ tilted


def tilted(flat: HeightMap, deg: float, azimuth_deg: float) -> tuple[HeightMap, Soil]:
    """What an instrument measures from above of a tilted plate; the soil is as thick as the plate's x."""
    row, col = np.indices(flat.shape)
    at = np.stack([flat.pitch_mm * col, flat.pitch_mm * row, flat.z_mm], axis=-1).reshape(-1, 3)
    azimuth = np.radians(azimuth_deg)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    seen = Rotation.from_rotvec(np.radians(deg) * axis).apply(at)
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    x, y = (np.arange(a, b, flat.pitch_mm) for a, b in zip(low, high, strict=True))
    grid = LinearNDInterpolator(seen[:, :2], np.column_stack([seen[:, 2], at[:, 0]]))(*np.meshgrid(x, y))
    return HeightMap(grid[..., 0], flat.pitch_mm), Soil(
        np.nan_to_num(np.maximum(grid[..., 1], 0.0)), 1.0, 0.2
    )


# ------------------------------------------------------------------------------------------------------------- blows

BLOW_SIZE = (53, 65)


def drawn(char: str, font: Font) -> NDArray[np.float32]:
    """A character of the font as it is."""
    relief = Hand(font, 1.0, 0.0, 0.0, 0.04, 1.0).relief(char, BLOW_SIZE)
    assert relief is not None
    return relief


def blow(char: str, seed: int, font: Font) -> NDArray[np.float32]:
    """A character as a blow leaves it: moved, turned, deeper or not, rough."""
    rng = np.random.default_rng([ord(char), seed])
    turned = ndimage.rotate(drawn(char, font), rng.normal(0.0, 1.2), reshape=False, order=1)
    moved = ndimage.shift(turned, rng.normal(0.0, 0.8, 2), order=1) * rng.normal(1.0, 0.12)
    return np.asarray(moved + rng.normal(0.0, 0.001, BLOW_SIZE), dtype=np.float32)
