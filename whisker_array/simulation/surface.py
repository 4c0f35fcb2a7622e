"""The surface for a ball tip: dropouts filled, dilated by the tip (`dilation`), with slopes and friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import FAST, inline_kernel, kernel, read_only
from glyphs.soiling.soil import Soil
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from whisker_array.arrays import Mask
from whisker_array.simulation.dilation import dilate_by_ball
from whisker_array.simulation.soft import carrying_stiffness_n_per_mm
from whisker_array.simulation.threads import in_threads
from whisker_array.whisker.passes import SweepPlan

Friction: TypeAlias = float | NDArray[np.float32]
"""Coulomb coefficient of a surface: one number, or a (rows, cols) map."""


@dataclass(frozen=True, eq=False, repr=False)
class TouchSurface(OneLine):
    """A surface ready to be traced, sample by sample, in the plate frame."""

    # (rows, cols, 4) float32: height mm, slope along columns, slope along rows, and friction of the surface
    # below all soft dirt
    fields: NDArray[np.float32]
    # (rows, cols) bool: whether the height was not measured but filled from its surroundings
    dropout: Mask
    pitch_mm: float
    # (rows, cols, 7) float32, None without soft dirt: height and both slopes of the dirt's top, the stiffness
    # N/mm with which it carries the tip (`soft`), both slopes of the stiffness, and 1 where dirt affects the
    # tip
    yielding: NDArray[np.float32] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        return (self.fields.shape[0], self.fields.shape[1])


def fill_dropouts(z_mm: NDArray[np.float32]) -> tuple[NDArray[np.float32], Mask]:
    """Fill NaN smoothly from the nearest measured neighbours; returns the heights and where they were filled."""
    dropout = np.isnan(z_mm)
    if not dropout.any():
        return z_mm, dropout
    from scipy import ndimage

    rows, cols = ndimage.distance_transform_edt(dropout, return_distances=False, return_indices=True)
    filled = z_mm[rows, cols]
    for _ in range(4):
        smooth = ndimage.uniform_filter(filled, size=5, mode="nearest")
        filled = np.where(dropout, smooth, filled)
    return np.ascontiguousarray(filled, dtype=np.float32), dropout


def check_friction(friction: Friction, shape: tuple[int, int]) -> Friction:
    """Check friction, one coefficient or a map of a given shape. Raises MapError."""
    mu = np.asarray(friction, dtype=np.float32)
    if mu.ndim > 0 and mu.shape != shape:
        raise MapError(f"friction map {mu.shape} does not fit the height map {shape}")
    if not np.isfinite(mu).all() or (mu < 0.0).any():
        raise MapError("friction must be finite and not negative everywhere")
    return mu if mu.ndim > 0 else float(friction)


def check_soil(soil: Soil, shape: tuple[int, int]) -> None:
    """Check that dirt lies on the grid of the height map. Raises MapError: the grids differ."""
    if soil.shape != shape:
        raise MapError(f"soil {soil.shape} does not fit the height map {shape}", hint="give both on one grid")


def prepare_surface(
    height_map: HeightMap, *, tip_radius_mm: float = 0.0, friction: Friction = 0.2, soil: Soil | None = None
) -> TouchSurface:
    """Prepare a height map for tracing: fill dropouts, dilate by the tip, compute slopes, add the friction.

    For soft dirt, both its top and the surface below are dilated, because the tip rests somewhere in between; it
    lies on the grid of the map (`check_soil`). Raises MapError for wrong friction.
    """
    mu = check_friction(friction, height_map.shape)
    filled, dropout = fill_dropouts(height_map.z_mm)
    pitch = height_map.pitch_mm
    if soil is None or not soil.thickness_mm.any():
        fields = dilated_fields(filled, mu, pitch_mm=pitch, radius_mm=tip_radius_mm)
        return TouchSurface(fields=fields, dropout=dropout, pitch_mm=pitch)
    fields = dilated_fields(filled - soil.thickness_mm, mu, pitch_mm=pitch, radius_mm=tip_radius_mm)
    stiffness = carrying_stiffness_n_per_mm(soil, tip_radius_mm=tip_radius_mm, pitch_mm=pitch)
    top = dilated_fields(filled, pitch_mm=pitch, radius_mm=tip_radius_mm)[..., :3]
    carrying = dilated_fields(stiffness, pitch_mm=pitch, radius_mm=0.0)
    carrying[..., 3] = (top != fields[..., :3]).any(axis=2)
    yielding = np.concatenate([top, carrying], axis=2)
    return TouchSurface(fields=fields, dropout=dropout, pitch_mm=pitch, yielding=yielding)


def dilated_fields(
    z_mm: NDArray[np.float32], beside: Friction = 0.0, *, pitch_mm: float, radius_mm: float
) -> NDArray[np.float32]:
    """Fields (rows, cols, 4): heights dilated by a ball, their slopes along columns and rows, and `beside`."""
    z = np.asarray(dilate_by_ball(z_mm, pitch_mm=pitch_mm, radius_mm=radius_mm), dtype=np.float32)
    fields = np.empty((*z.shape, 4), dtype=np.float32)
    fields[..., 0], fields[..., 3] = z, beside
    half = np.float32(0.5 / pitch_mm)
    for layer, axis in ((1, 1), (2, 0)):
        rows, slope = np.moveaxis(z, axis, 0), np.moveaxis(fields[..., layer], axis, 0)
        slope[1:-1] = (rows[2:] - rows[:-2]) * half
        # one-sided at the rim of the map
        slope[0], slope[-1] = (rows[1] - rows[0]) * (half + half), (rows[-1] - rows[-2]) * (half + half)
    return fields


def orient(surface: TouchSurface, direction: TraceDirection) -> TouchSurface:
    """Return the surface in the *trace frame* of a direction: columns run as the whisker is dragged, rows as before."""
    return replace(
        surface,
        fields=_orient(surface.fields, direction),
        dropout=np.ascontiguousarray(_turn(surface.dropout, direction)),
        yielding=None if surface.yielding is None else _orient(surface.yielding, direction),
    )


def _turn(layers: NDArray[Any], direction: TraceDirection) -> NDArray[Any]:
    turned = layers if direction.along_x else layers.swapaxes(0, 1)
    return turned[:, ::-1] if direction.backward else turned


def _orient(fields: NDArray[np.float32], direction: TraceDirection) -> NDArray[np.float32]:
    turned = _turn(fields, direction)
    out = np.empty(turned.shape, dtype=np.float32)
    # slopes along and across the trace are layers 1 and 2, and for dirt on top layers 4 and 5
    of = (0, 1, 2, 3, 4, 5, 6) if direction.along_x else (0, 2, 1, 3, 5, 4, 6)
    for layer in range(fields.shape[2]):
        sign = np.float32(direction.sign if layer in (1, 4) else 1.0)
        np.multiply(turned[..., of[layer]], sign, out=out[..., layer])
    return out


@inline_kernel
def cell_of(fields, u, v):  # type: ignore[no-untyped-def]
    """Cell of a position, u columns and v rows into a grid and clamped to it, and the weights of its corners."""
    u = min(max(u, 0.0), fields.shape[1] - 1.001)
    v = min(max(v, 0.0), fields.shape[0] - 1.001)
    c, r = int(u), int(v)
    fu, fv = u - c, v - r
    return r, c, (1.0 - fu) * (1.0 - fv), fu * (1.0 - fv), (1.0 - fu) * fv, fu * fv


@inline_kernel
def bilinear(fields, cell, k):  # type: ignore[no-untyped-def]
    """Interpolate layer k of the fields in a cell."""
    r, c, w00, w01, w10, w11 = cell
    above, below = w00 * fields[r, c, k] + w01 * fields[r, c + 1, k], fields[r + 1, c, k]
    return above + w10 * below + w11 * fields[r + 1, c + 1, k]


@kernel(allow=FAST)
def _sample_lines(first, last, fields, dropout, inv_pitch, lines, start, step, height, mu, missing):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for j in range(height.shape[1]):
            cell = cell_of(fields, (start + j * step) * inv_pitch, lines[i] * inv_pitch)
            height[i, j], mu[i, j] = bilinear(fields, cell, 0), bilinear(fields, cell, 3)
            r, c = cell[0], cell[1]
            missing[i, j] = dropout[r, c] or dropout[r, c + 1] or dropout[r + 1, c] or dropout[r + 1, c + 1]


def sample_lines(
    surface: TouchSurface, plan: SweepPlan
) -> tuple[NDArray[np.float32], NDArray[np.float32], Mask]:
    """Height, friction and dropout at every sample of a plan in the trace frame, (lines, samples) each: bilinear."""
    lines = np.ravel(np.asarray(plan.line_mm, dtype=np.float64))
    height, mu = np.empty((2, lines.size, plan.n_samples), dtype=np.float32)
    missing = np.empty(height.shape, dtype=np.bool_)
    fields, dropout = read_only(surface.fields), read_only(surface.dropout)
    place = 1.0 / surface.pitch_mm, lines, float(plan.start_mm), float(plan.step_mm)
    arrays = fields, dropout, *place, height, mu, missing
    in_threads(lambda first, last: _sample_lines(first, last, *arrays), lines.size)
    return height, mu, missing
