"""Templates: the edges that an ideal array feels on ideal marks, by the same physics as the scan.

All glyphs of a font are laid out on one virtual plate, each in its own cell, and felt once::

    +-------+-------+-------+          the cell's middle is the glyph's reference point:
    |   A   |   B   |   C   |  ...     middle of its ink across, half the cap height up
    +-------+-------+-------+

Plates are flat and lines run along their rows; strips of a view are straightened to match.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.shading import Light, radiance
from glyphs.fonts.glyph import RELIEF_PIXELS, Font, Glyph
from glyphs.soiling.coat import Look
from glyphs.stamping.die import die_glyph, shape_relief_mm
from glyphs.stamping.faces import Die, Face, default_depth_mm, default_die
from glyphs.surface.maps import HeightMap
from recognition.glyph_match.kept_predictions import Arrays, load_or_predict
from recognition.see.text_line import TextLine
from recognition.see.view import (
    DIRECTIONS,
    GREY,
    View,
    ViewKind,
    felt_view,
    layers_of,
    relief_of,
)
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch

CANONICAL_HEIGHT_MM = 5.0
"""Height of all templates. Touch does not depend on scale if whisker, tip, preload and mark scale together."""
PIXELS = 40
"""Template pixels per character height."""
MOST_SETS = 26
"""Template sets that a reader keeps, 15 MB each; loading one from the disk takes 10 ms, predicting it 0.5 s."""


@dataclass(frozen=True)
class TemplateKey:
    """All parameters on which a template set depends, independent of scale."""

    raised: bool
    compliance: tuple[float, ...]  # D11 divided by its yy element, row by row
    arm: tuple[float, ...]  # third row of T1 divided by its length
    preload: float  # over the character height, as is the radius of the tip
    tip_radius: float
    friction: float
    die: Die

    def touch(self) -> Touch:
        return Touch(
            tip=TipModel(np.array(self.compliance).reshape(3, 3), np.array(self.arm)),
            preload_mm=self.preload * CANONICAL_HEIGHT_MM,
            tip_radius_mm=self.tip_radius * CANONICAL_HEIGHT_MM,
            friction=self.friction,
        )


def template_key(
    font: Font,
    touch: Touch,
    *,
    height_mm: float,
    raised: bool = False,
    face: Face = Face.FLAT,
    step: float = 0.1,
) -> TemplateKey:
    """Key of the templates for a touch and a character height, rounded by `step` so that similar parts share a set."""
    compliance = touch.tip.compliance_mm_per_n / touch.tip.compliance_mm_per_n[1, 1]
    arm = touch.tip.moment_arm_mm / np.linalg.norm(touch.tip.moment_arm_mm)
    depth = round_to_ladder(default_depth_mm(height_mm) / height_mm, step)
    return TemplateKey(
        raised=raised,
        compliance=tuple(float(f"{c:.4g}") for c in compliance.ravel()),
        arm=tuple(float(f"{a:.4g}") for a in arm),
        preload=round_to_ladder(touch.preload_mm / height_mm, step),
        tip_radius=round_to_ladder(touch.tip_radius_mm / height_mm, 2 * step) if touch.tip_radius_mm else 0.0,
        friction=round(touch.friction, 2),
        die=default_die(CANONICAL_HEIGHT_MM, font=font, face=face, depth_mm=depth * CANONICAL_HEIGHT_MM),
    )


def round_to_ladder(value: float, step: float) -> float:
    """Round a value to a geometric series with this relative step."""
    ladder = math.log1p(step)
    return float(math.exp(round(math.log(value) / ladder) * ladder))


@dataclass(frozen=True, eq=False)
class TemplateSet:
    """Felt templates of a font's characters, side by side on a plate."""

    chars: tuple[str, ...]
    view: View
    middles_mm: NDArray[np.float64]
    # (T, directions, rows, cols) float32 edges, PIXELS per character height, with the glyph's reference point
    # in the middle pixel; rows and cols odd
    patches: NDArray[np.float32]
    half_width: NDArray[np.float64]
    work: dict[object, object] = field(default_factory=dict)

    def derive(self, key: object, make: Callable[[], Any]) -> Any:
        if key not in self.work:
            self.work[key] = make()
        return self.work[key]


@dataclass(frozen=True, eq=False)
class IdealPlate:
    """A plate with a font's characters side by side, each struck perfectly, in cells of PIXELS per height."""

    surface: HeightMap
    middles_mm: NDArray[np.float64]
    half_width: NDArray[np.float64]
    shape: tuple[int, int]
    rows: slice


def line_of(middles_mm: NDArray[np.float64]) -> TextLine:
    """The line along the middles of a plate's characters, with half a height of land at both ends."""
    (x0, y), x1, half = middles_mm[0], middles_mm[-1, 0], 0.5 * CANONICAL_HEIGHT_MM
    return TextLine(np.array([[x0 - half, y], [x1 + half, y]]), CANONICAL_HEIGHT_MM)


def ideal_plate(
    font: Font,
    chars: str,
    die: Die,
    *,
    raised: bool = False,
    cell_margin_heights: float = 0.16,
    land_heights: float = 0.25,
) -> IdealPlate:
    """Strike the plate, at the canonical height and half the templates' pitch. Raises FontError or StampError."""
    height, pitch = CANONICAL_HEIGHT_MM, CANONICAL_HEIGHT_MM / PIXELS
    shapes = [die_glyph(font.glyph(c), die, height_mm=height) for c in chars]
    boxes = [shape.ink_box for shape in shapes]
    half = 0.5 * np.array([b[2] - b[0] for b in boxes])
    tall = max(max(abs(b[1] - 0.5), abs(b[3] - 0.5)) for b in boxes)
    n_cols = math.ceil((float(half.max()) + cell_margin_heights) * PIXELS)
    n_rows, cell = (math.ceil((tall + land) * PIXELS) for land in (land_heights, cell_margin_heights))
    # cells are felt at the template's pitch; the plate is drawn at half of it
    fine = 0.5 * pitch
    rows, cols = 2 * n_rows + 1, 2 * n_cols + 1
    z = np.zeros((2 * rows, 2 * cols * len(chars)), dtype=np.float32)
    u = (np.arange(2 * cols, dtype=np.float64) - 2 * n_cols) * fine
    v = (2 * n_rows - np.arange(2 * rows, dtype=np.float64)) * fine
    for i, shape in enumerate(shapes):
        z[:, 2 * cols * i : 2 * cols * (i + 1)] = sunk_relief_mm(shape, die, u[None, :], v[:, None])
    middles = np.column_stack(
        [(np.arange(len(chars)) * cols + n_cols) * pitch, np.full(len(chars), n_rows * pitch)]
    )
    surface, own_rows = HeightMap(-z if raised else z, fine), slice(n_rows - cell, n_rows + cell + 1)
    return IdealPlate(surface, middles, half, (rows, cols), own_rows)


def lit_views(
    plate: IdealPlate,
    lights: Sequence[Light],
    *,
    albedo: float = 0.3,
    roughness: float = 0.4,
    reflectance: float = 0.3,
    middle_grey: float = 0.2,
) -> tuple[View, ...]:
    """Photographs of an ideal plate of matt metal, one under each light."""
    shape = plate.surface.shape
    look = Look(
        np.full((*shape, 3), albedo, dtype=np.float32),
        np.full(shape, roughness, dtype=np.float32),
        np.full(shape, reflectance, dtype=np.float32),
    )
    views = []
    for light in lights:
        seen = radiance(plate.surface, look, light)[..., 1]
        grey = np.clip(middle_grey * seen / seen.mean(), 0.0, 1.0) ** (1.0 / 2.2)
        views.append(View(ViewKind.PHOTO, layers_of(GREY, grey), plate.surface.pitch_mm))
    return tuple(views)


def predict_templates(font: Font, chars: str, key: TemplateKey) -> TemplateSet:
    """Feel the ideal plate of a font's characters and cut out the cells. Raises FontError or StampError."""
    arrays = load_or_predict(("felt", *map(font.glyph, chars), key), lambda: _feel(font, chars, key))
    x_mm, y_mm, pitch_mm = arrays["grid"].tolist()
    return TemplateSet(
        chars=tuple(chars),
        view=View(ViewKind.FELT, arrays["layers"], pitch_mm, (x_mm, y_mm), key.touch()),
        middles_mm=arrays["middles_mm"],
        patches=arrays["patches"],
        half_width=arrays["half_width"],
    )


def _feel(font: Font, chars: str, key: TemplateKey) -> Arrays:
    height, pitch = CANONICAL_HEIGHT_MM, CANONICAL_HEIGHT_MM / PIXELS
    plate = ideal_plate(font, chars, key.die, raised=key.raised)
    rows, cols = plate.shape
    plan = RasterPlan(
        array=WhiskerArray(n_whiskers=1, pitch_mm=pitch),
        region_mm=(0.0, 0.0, (cols * len(chars) - 1) * pitch, (rows - 1) * pitch),
        line_pitch_mm=pitch,
        sample_pitch_mm=0.5 * pitch,
        directions=DIRECTIONS,
        lead_mm=0.2 * height,
        air_samples=0,
    )
    scan = trace_scan(plate.surface, touch=key.touch(), plan=plan, fidelity=Fidelity.CONTACT)
    felt = edge_map(scan, ideal=True)
    view = felt_view(felt, relief_of(scan, felt))
    patches = felt.enhancement.reshape(len(DIRECTIONS), rows, len(chars), cols)[:, plate.rows]
    return {
        "layers": view.layers,
        "grid": np.array([*view.origin_mm, view.pitch_mm]),
        "middles_mm": plate.middles_mm,
        "patches": np.ascontiguousarray(patches.transpose(2, 0, 1, 3)),
        "half_width": plate.half_width,
    }


def sunk_relief_mm(
    shape: Glyph, die: Die, u: NDArray[np.floating], v: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Sunk relief of one glyph of CANONICAL_HEIGHT_MM at offsets (u right, v up) from its reference point, mm."""
    if shape.relief is not None:
        from scipy import ndimage

        felt, pixel = shape.relief, CANONICAL_HEIGHT_MM / RELIEF_PIXELS
        pixels = np.broadcast_arrays(felt.shape[0] // 2 - v / pixel, felt.shape[1] // 2 + u / pixel)
        relief = ndimage.map_coordinates(felt, pixels, order=1, mode="constant")
        return np.asarray(relief * np.float32(CANONICAL_HEIGHT_MM), dtype=np.float32)
    x0, _, x1, _ = (edge * CANONICAL_HEIGHT_MM for edge in shape.ink_box)
    offsets = u + 0.5 * (x0 + x1), v + 0.5 * CANONICAL_HEIGHT_MM
    return shape_relief_mm(shape, die, *offsets, height_mm=CANONICAL_HEIGHT_MM)
