"""Templates: what the ideal array feels on the ideal die, by the same physics that makes the scan.

All glyphs of a font are laid out on one virtual plate, each in its own cell turned by the line's rotation,
and scanned once::

    +-------+-------+-------+          the cell's middle is the glyph's reference point:
    |   A   |   B   |   C   |  ...     middle of its ink across, half the cap height up
    +-------+-------+-------+
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from glyphs.die import Die, default_die, die_glyph, ink_points_mm, shape_relief_mm, to_plate
from glyphs.glyph import Font, transformed
from glyphs.maps import HeightMap, TraceDirection
from whisker_array.array import RasterPlan, WhiskerArray
from whisker_array.edges import edge_map
from whisker_array.scan import Touch, trace_scan
from whisker_array.traces import Fidelity

CELL_MARGIN_HEIGHTS = 0.16
"""Land kept around a glyph in its cell, in character heights."""


@dataclass(frozen=True)
class TemplateKey:
    """All that decides what a template set looks like.

    Attributes:
        height_mm: character height.
        pitch_mm: grid of the maps.
        directions: layers.
        rotation_deg: of the glyphs in the plate frame.
        raised: raised marks.
        x_scale: widening of the glyphs against the font's own shape.
        touch: `Touch.key()` of the whisker.
        die: the die; its depth and stroke matter.
    """

    height_mm: float
    pitch_mm: float
    directions: tuple[TraceDirection, ...]
    rotation_deg: float
    raised: bool
    x_scale: float
    touch: tuple[float, ...]
    die: Die


@dataclass(frozen=True, eq=False)
class TemplateSet:
    """Predicted edge maps of a font's characters, all on one patch size.

    Attributes:
        font: name of the font.
        chars: (T,) characters.
        patches: (T, directions, rows, cols) float32, the glyph's reference point in the middle pixel; rows and
            cols odd. In the *line frame*: a rotated set has been turned back upright.
        half_width_mm: (T,) half the ink's width.
        pitch_mm: grid.
        height_mm: character height.
        work: place for what matching derives from the patches (spectra, norms), kept as long as the set.
    """

    font: str
    chars: tuple[str, ...]
    patches: NDArray[np.float32]
    half_width_mm: NDArray[np.float64]
    pitch_mm: float
    height_mm: float
    work: dict[object, object] = field(default_factory=dict)


def predict_templates(font: Font, chars: str, key: TemplateKey, touch: Touch) -> TemplateSet:
    """Scan the ideal plate of a font's characters and cut out the cells.

    Raises:
        FontError: a character that the font has not got.
        DieError, MapError: a die or a scale that cannot be.
    """
    shapes = [
        transformed(die_glyph(font.glyph(c), key.die, height_mm=key.height_mm), x_scale=key.x_scale) for c in chars
    ]
    boxes = [shape.ink_box for shape in shapes]
    half = 0.5 * key.height_mm * np.array([b[2] - b[0] for b in boxes])
    tall = key.height_mm * max(max(abs(b[1] - 0.5), abs(b[3] - 0.5)) for b in boxes)
    margin = CELL_MARGIN_HEIGHTS * key.height_mm
    cos, sin = abs(math.cos(math.radians(key.rotation_deg))), abs(math.sin(math.radians(key.rotation_deg)))
    wide = float(half.max())
    # cells are cut at the line pitch; the plate is drawn at half of it
    n_cols = math.ceil((wide * cos + tall * sin + margin) / key.pitch_mm)
    n_rows = math.ceil((tall * cos + wide * sin + margin) / key.pitch_mm)
    fine = 0.5 * key.pitch_mm
    cell_cols, cell_rows = 2 * n_cols + 1, 2 * n_rows + 1
    z = np.zeros((2 * cell_rows, 2 * cell_cols * len(chars)), dtype=np.float32)
    gx = (np.arange(2 * cell_cols) - 2 * n_cols) * fine
    gy = (np.arange(2 * cell_rows) - 2 * n_rows) * fine
    for i, (shape, box) in enumerate(zip(shapes, boxes, strict=True)):
        u, v = to_plate(gx[None, :], gy[:, None], rotation_deg=key.rotation_deg)
        middle = 0.5 * (box[0] + box[2]) * key.height_mm, 0.5 * key.height_mm
        points = ink_points_mm(shape, height_mm=key.height_mm)
        if points.size:
            z[:, 2 * cell_cols * i : 2 * cell_cols * (i + 1)] = shape_relief_mm(
                shape, key.die, u + middle[0], v + middle[1], height_mm=key.height_mm
            )
    if key.raised:
        z = -z
    plate = HeightMap(z, fine)
    plan = RasterPlan(
        array=WhiskerArray(n_whiskers=1, pitch_mm=key.pitch_mm),
        region_mm=(0.0, 0.0, (cell_cols * len(chars) - 1) * key.pitch_mm, (cell_rows - 1) * key.pitch_mm),
        line_pitch_mm=key.pitch_mm,
        sample_pitch_mm=fine,
        directions=key.directions,
        lead_mm=0.2 * key.height_mm,
        air_samples=0,
    )
    felt = edge_map(trace_scan(plate, touch=touch, plan=plan, fidelity=Fidelity.CONTACT), ideal=True)
    layers = felt.enhancement.reshape(len(key.directions), cell_rows, len(chars), cell_cols)
    patches = np.ascontiguousarray(layers.transpose(2, 0, 1, 3))
    if key.rotation_deg:
        patches = _upright(patches, key.rotation_deg)
    return TemplateSet(
        font=font.name,
        chars=tuple(chars),
        patches=patches,
        half_width_mm=half,
        pitch_mm=key.pitch_mm,
        height_mm=key.height_mm,
    )


def _upright(patches: NDArray[np.float32], rotation_deg: float) -> NDArray[np.float32]:
    """Turn plate-frame patches back into the line frame, about their middle pixel."""
    from scipy import ndimage

    angle = math.radians(rotation_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    # output (row, col) in the line frame looks up the plate frame: x = u cos - v sin, y = u sin + v cos
    matrix = np.array([[cos, sin], [-sin, cos]])
    middle = 0.5 * (np.array(patches.shape[2:]) - 1.0)
    out = np.empty_like(patches)
    for t in range(patches.shape[0]):
        for d in range(patches.shape[1]):
            ndimage.affine_transform(
                patches[t, d], matrix, offset=middle - matrix @ middle, output=out[t, d], order=1, mode="constant"
            )
    return out


class TemplateCache:
    """Keeps the template sets last used; a reader owns one.

    Heights and rotations are rounded before they become keys, so near-equal parts share a set.
    """

    def __init__(self, *, keep: int = 64) -> None:
        self._keep = keep
        self._sets: OrderedDict[object, TemplateSet] = OrderedDict()

    def get(self, font: Font, chars: str, key: TemplateKey, touch: Touch) -> TemplateSet:
        """The set for a key, predicted on first use."""
        full = (font.name, font.source, chars, key)
        found = self._sets.get(full)
        if found is None:
            found = predict_templates(font, chars, key, touch)
            self._sets[full] = found
            while len(self._sets) > self._keep:
                self._sets.popitem(last=False)
        self._sets.move_to_end(full)
        return found


def rounded_height_mm(height_mm: float) -> float:
    """Height rounded to steps of 2 %: templates of one step serve all heights within it."""
    step = math.log(1.02)
    return float(math.exp(round(math.log(height_mm) / step) * step))


def ideal_die(font: Font, height_mm: float, *, depth_mm: float | None = None) -> Die:
    """The die a template is predicted for when nobody says which: flat face, usual bevel and depth."""
    return default_die(height_mm, font=font, depth_mm=depth_mm)
