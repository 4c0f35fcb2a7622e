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

from glyphs.fonts.glyph import RELIEF_PIXELS, Font, Glyph
from glyphs.stamping.die import (
    Die,
    Face,
    default_depth_mm,
    default_die,
    die_glyph,
    shape_relief_mm,
    to_plate,
)
from glyphs.surface.maps import HeightMap, TraceDirection
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch

CELL_MARGIN_HEIGHTS = 0.16
"""Land kept around a glyph in its cell, in character heights."""
CANONICAL_HEIGHT_MM = 5.0
"""Touch is free of scale when whisker, tip, preload and mark shrink together: one set serves every height."""
_TURN_DEG, _STEP = 5.0, 0.1
"""Between two sets, of the turn and of preload and depth: patches are turned upright, and the directions' shares of an
edge differ by a few per cent."""
_ROUGH_TURN_DEG, _ROUGH_STEP = 40.0, 0.6
"""The same, where they only have to tell which font it is."""
PIXELS = 40
"""Template pixels to a character height."""


@dataclass(frozen=True)
class TemplateKey:
    """All that decides what a template set looks like, free of scale.

    Attributes:
        directions: layers.
        rotation_deg: of the glyphs in the plate frame.
        raised: raised marks.
        compliance: D11 over its yy element, row by row.
        arm: third row of T1 over its length.
        preload, tip_radius: over the character height.
        friction: nominal.
        die: at the canonical height.
    """

    directions: tuple[TraceDirection, ...]
    rotation_deg: float
    raised: bool
    compliance: tuple[float, ...]
    arm: tuple[float, ...]
    preload: float
    tip_radius: float
    friction: float
    die: Die

    def touch(self) -> Touch:
        """The whisker scaled to the canonical height."""
        return Touch(
            tip=TipModel(np.array(self.compliance).reshape(3, 3), np.array(self.arm)),
            preload_mm=self.preload * CANONICAL_HEIGHT_MM,
            tip_radius_mm=self.tip_radius * CANONICAL_HEIGHT_MM,
            friction=self.friction,
        )


def template_key(
    font: Font,
    touch: Touch,
    directions: tuple[TraceDirection, ...],
    *,
    height_mm: float,
    rotation_deg: float = 0.0,
    raised: bool = False,
    face: Face = Face.FLAT,
    rough: bool = False,
) -> TemplateKey:
    """The key for characters of a height felt with a touch; rounded, so that near-equal parts share a set.

    Rough ones are shared by almost all parts: to predict a set for each of the fonts that nobody has named would cost
    more than all the rest of a reading.
    """
    turn, step = (_ROUGH_TURN_DEG, _ROUGH_STEP) if rough else (_TURN_DEG, _STEP)
    compliance = touch.tip.compliance_mm_per_n / touch.tip.compliance_mm_per_n[1, 1]
    arm = touch.tip.moment_arm_mm / np.linalg.norm(touch.tip.moment_arm_mm)
    depth = rounded(default_depth_mm(height_mm) / height_mm, step)
    return TemplateKey(
        directions=directions,
        rotation_deg=turn * round(rotation_deg / turn),
        raised=raised,
        compliance=tuple(float(f"{c:.4g}") for c in compliance.ravel()),
        arm=tuple(float(f"{a:.4g}") for a in arm),
        preload=rounded(touch.preload_mm / height_mm, step),
        tip_radius=rounded(touch.tip_radius_mm / height_mm, 2 * step) if touch.tip_radius_mm else 0.0,
        friction=round(touch.friction, 2),
        die=default_die(CANONICAL_HEIGHT_MM, font=font, face=face, depth_mm=depth * CANONICAL_HEIGHT_MM),
    )


def rounded(value: float, step: float) -> float:
    """Value rounded to a geometric ladder of the given relative step."""
    ladder = math.log1p(step)
    return float(math.exp(round(math.log(value) / ladder) * ladder))


@dataclass(frozen=True, eq=False)
class TemplateSet:
    """Predicted edge maps of a font's characters, all on one patch size.

    Attributes:
        font: name of the font.
        chars: (T,) characters.
        patches: (T, directions, rows, cols) float32, PIXELS to the height, the glyph's reference point in the
            middle pixel; rows and cols odd. In the *line frame*: a rotated set has been turned back upright.
        half_width: (T,) half the ink's width, character heights.
        work: place for what matching derives from the patches (spectra, norms), kept as long as the set.
    """

    font: str
    chars: tuple[str, ...]
    patches: NDArray[np.float32]
    half_width: NDArray[np.float64]
    work: dict[object, object] = field(default_factory=dict)


def predict_templates(font: Font, chars: str, key: TemplateKey) -> TemplateSet:
    """Scan the ideal plate of a font's characters and cut out the cells.

    Raises:
        FontError: a character that the font has not got.
        StampError, MapError: a die or a scale that cannot be.
    """
    height, pitch = CANONICAL_HEIGHT_MM, CANONICAL_HEIGHT_MM / PIXELS
    shapes = [die_glyph(font.glyph(c), key.die, height_mm=height) for c in chars]
    boxes = [shape.ink_box for shape in shapes]
    half = 0.5 * np.array([b[2] - b[0] for b in boxes])
    tall = max(max(abs(b[1] - 0.5), abs(b[3] - 0.5)) for b in boxes)
    cos, sin = abs(math.cos(math.radians(key.rotation_deg))), abs(math.sin(math.radians(key.rotation_deg)))
    wide = float(half.max())
    n_cols = math.ceil((wide * cos + tall * sin + CELL_MARGIN_HEIGHTS) * PIXELS)
    n_rows = math.ceil((tall * cos + wide * sin + CELL_MARGIN_HEIGHTS) * PIXELS)
    # cells are felt at the template's pitch; the plate is drawn at half of it
    fine = 0.5 * pitch
    cell_cols, cell_rows = 2 * n_cols + 1, 2 * n_rows + 1
    z = np.zeros((2 * cell_rows, 2 * cell_cols * len(chars)), dtype=np.float32)
    gx = (np.arange(2 * cell_cols) - 2 * n_cols) * fine
    gy = (np.arange(2 * cell_rows) - 2 * n_rows) * fine
    u, v = to_plate(gx[None, :], gy[:, None], rotation_deg=key.rotation_deg)
    for i, (shape, box) in enumerate(zip(shapes, boxes, strict=True)):
        middle = (0.5 * (box[0] + box[2]) * height, 0.5 * height)
        z[:, 2 * cell_cols * i : 2 * cell_cols * (i + 1)] = _relief(shape, key, u, v, middle)
    plate = HeightMap(-z if key.raised else z, fine)
    plan = RasterPlan(
        array=WhiskerArray(n_whiskers=1, pitch_mm=pitch),
        region_mm=(0.0, 0.0, (cell_cols * len(chars) - 1) * pitch, (cell_rows - 1) * pitch),
        line_pitch_mm=pitch,
        sample_pitch_mm=fine,
        directions=key.directions,
        lead_mm=0.2 * height,
        air_samples=0,
    )
    felt = edge_map(trace_scan(plate, touch=key.touch(), plan=plan, fidelity=Fidelity.CONTACT), ideal=True)
    layers = felt.enhancement.reshape(len(key.directions), cell_rows, len(chars), cell_cols)
    patches = np.ascontiguousarray(layers.transpose(2, 0, 1, 3))
    if key.rotation_deg:
        patches = _upright(patches, key.rotation_deg)
    return TemplateSet(font=font.name, chars=tuple(chars), patches=patches, half_width=half)


def _relief(
    shape: Glyph,
    key: TemplateKey,
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    middle: tuple[float, float],
) -> NDArray[np.float32]:
    """Sunk relief of one glyph at offsets (u, v) from its middle."""
    if shape.relief is not None:
        return _felt_relief(shape.relief, u, v)
    return shape_relief_mm(shape, key.die, u + middle[0], v + middle[1], height_mm=CANONICAL_HEIGHT_MM)


def _felt_relief(
    felt: NDArray[np.float32], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Relief of a learned glyph at offsets (u right, v up) from its middle, mm, as it was felt."""
    from scipy import ndimage

    pixel = CANONICAL_HEIGHT_MM / RELIEF_PIXELS
    at = [felt.shape[0] // 2 - v / pixel, felt.shape[1] // 2 + u / pixel]
    found = ndimage.map_coordinates(felt, at, order=1, mode="constant")
    return np.asarray(found * np.float32(CANONICAL_HEIGHT_MM), dtype=np.float32)


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
                patches[t, d],
                matrix,
                offset=middle - matrix @ middle,
                output=out[t, d],
                order=1,
                mode="constant",
            )
    return out


MOST_SETS = 1024
"""64 fonts at the heights and rotations of a batch: to predict a set takes 0.1 s, to look it up nothing."""
MOST_BYTES, SET_BYTES = 400_000_000, 15_000_000
"""Of templates and what matching derives from them: a reader stays below 1 GB; and what a set takes at most, about."""


class TemplateCache:
    """Keeps the template sets last used; a reader owns one."""

    def __init__(self, *, keep: int = MOST_SETS, most_bytes: int = MOST_BYTES) -> None:
        self._keep, self._most_bytes = keep, most_bytes
        self._sets: OrderedDict[object, TemplateSet] = OrderedDict()

    def get(self, font: Font, chars: str, key: TemplateKey) -> TemplateSet:
        """The set for a key, predicted on first use."""
        full = (font.name, font.source, chars, key)
        found = self._sets.get(full)
        if found is None:
            self._make_room()
            found = predict_templates(font, chars, key)
            self._sets[full] = found
        self._sets.move_to_end(full)
        return found

    def _make_room(self) -> None:
        """Forget the sets longest unused, until one more is within the limits."""
        sizes = [_n_bytes(kept) for kept in self._sets.values()]
        total = sum(sizes)
        for size in sizes:
            if len(self._sets) < self._keep and total <= self._most_bytes:
                break
            self._sets.popitem(last=False)
            total -= size


def _n_bytes(value: object) -> int:
    """Bytes of the arrays that a set, or anything derived from it, holds."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, dict):
        return sum(_n_bytes(v) for v in value.values())
    if isinstance(value, str):
        return 0
    if isinstance(value, tuple | list):
        return sum(_n_bytes(v) for v in value if not isinstance(v, str))
    return sum(_n_bytes(v) for v in vars(value).values()) if hasattr(value, "__dict__") else 0
