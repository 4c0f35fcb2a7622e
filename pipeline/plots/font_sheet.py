"""A specimen sheet: every letter of a font as ink, and some of them as stamped relief."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from glyphs.fonts.glyph import Font, signed_distance
from glyphs.fonts.outlines import SERIAL_CHARACTERS
from glyphs.stamping.die import die_glyph, ideal_relief
from glyphs.stamping.faces import Face, default_die

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STEP = 0.02  # cap heights: raster of the ink
_RELIEF_CHARACTERS = "AR38SQ5W"


def sheet_figure(fonts: Sequence[Font], *, die_face: Face = Face.FLAT, height_mm: float = 5.0) -> Figure:
    """Draw the sheet; saving it is the caller's business.

    Args:
        fonts: at least one.
        die_face: face of the die that stamps the relief row (DOTTED falls back to FLAT for outlined fonts).
        height_mm: character height.

    Returns:
        A matplotlib Figure that no window owns.

    Raises:
        ValueError: no font given.
    """
    if not fonts:
        raise ValueError("a specimen sheet needs at least one font")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 2.9 * len(fonts)), dpi=100, layout="constrained")
    axes = figure.subplots(2 * len(fonts), 1, squeeze=False, height_ratios=[1.25, 1.0] * len(fonts))[:, 0]
    for k, font in enumerate(fonts):
        face = Face.FLAT if die_face is Face.DOTTED and font.stroke_ratio == 0.0 else die_face
        ink, relief = axes[2 * k], axes[2 * k + 1]
        ink.contourf(*_ink_row(font, face, height_mm), levels=[-1e3, 0.0], colors=["black"])
        ink.set_title(f"{font.name}  ({font.source})", fontsize=9, loc="left")
        picture, pitch = _relief_row(font, face, height_mm)
        extent = (0.0, picture.shape[1] * pitch, 0.0, picture.shape[0] * pitch)
        shown = relief.imshow(picture, cmap="viridis", extent=extent, interpolation="nearest")
        relief.set_xlabel("mm", fontsize=7)
        relief.tick_params(labelsize=7)
        bar = figure.colorbar(shown, ax=relief, fraction=0.02, pad=0.01)
        bar.ax.tick_params(labelsize=7)
        bar.set_label(f"{face} mm", fontsize=7)
        ink.set_aspect("equal", anchor="W")
        relief.set_anchor("W")
        ink.set_axis_off()
    return figure


def _ink_row(font: Font, face: Face, height_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y and signed distance of A-Z and 0-9 in two lines, cap heights."""
    die = default_die(height_mm, font=font, face=face)
    lines = (SERIAL_CHARACTERS[:26], SERIAL_CHARACTERS[26:] + "-./")
    shapes = [
        [die_glyph(font.glyphs[c], die, height_mm=height_mm) for c in line if c in font.glyphs]
        for line in lines
    ]
    width = max(sum(s.advance for s in row) for row in shapes) + 0.2
    x = np.arange(0.0, width, _STEP)
    y = np.arange(-0.35, 2.95, _STEP)
    distance = np.full((y.size, x.size), 9.0, dtype=np.float32)
    for row, base in zip(shapes, (1.7, 0.0), strict=True):
        origin = 0.1
        for shape in row:
            here = np.flatnonzero((x > origin - 0.3) & (x < origin + shape.advance + 0.3))
            rows = np.flatnonzero((y > base - 0.5) & (y < base + 1.5))
            window = np.ix_(rows, here)
            stroke = die.stroke_mm / height_mm
            d = signed_distance(shape, x[None, here] - origin, y[rows, None] - base, stroke=stroke)
            distance[window] = np.minimum(distance[window], d)
            origin += shape.advance
    return x, y, distance


def _relief_row(font: Font, face: Face, height_mm: float) -> tuple[np.ndarray, float]:
    """A few characters stamped faultlessly, side by side, and the pitch, mm."""
    die = default_die(height_mm, font=font, face=face)
    pitch = height_mm / 80
    tiles = [
        ideal_relief(
            font.glyphs[c], die, height_mm=height_mm, pitch_mm=pitch, margin_mm=0.15 * height_mm
        ).height_map.z_mm
        for c in _RELIEF_CHARACTERS
        if c in font.glyphs
    ]
    rows = max(t.shape[0] for t in tiles)
    padded = [np.pad(t, (((rows - t.shape[0]) // 2, -((t.shape[0] - rows) // 2)), (0, 0))) for t in tiles]
    return np.hstack(padded), pitch
