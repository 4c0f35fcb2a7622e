"""Plates that lie askew under an instrument."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial.transform import Rotation

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap


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
