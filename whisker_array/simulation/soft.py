r"""Dirt that yields under the tip: how far a ball sinks in, and the track that it leaves.

The law of a ball indentation test: the dirt carries the mean pressure H on the ball's contact area 2 pi r s, so a
ball of radius r pressed with f_n sinks by s, but no deeper than the bottom of the dirt::

                 s = f_n / kappa,   kappa = 2 pi r H            h = max(h_top - s, h_bottom)
      top  _____
               |\_(  )___ h     track      h_top, h_bottom: heights of the ball if the dirt were hard, or
      ____________________      bottom     missing; both dilated by the ball

The dirt does not spring back: the tip slides on its own track h, whose slope sets the direction of the contact force.
Between top and bottom f_n = (d0 + h) / e, e = e_y.D11 (n - mu t) of eq. (7), and with it

    s = (d0 + h_top) / (1 + kappa e),      grad h = (1 - phi) (grad h_top + s / kappa grad kappa),
    phi = 1 / (1 + kappa e)

so the softer the dirt compared with the whisker, the less a slope of its top matters. Ploughing in front of the ball is
part of the friction coefficient.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.soil import Soil
from whisker_array.arrays import Floats
from whisker_array.whisker.shapes import TipModel

LEAST_GIVE = 0.05
"""Least e as a share of its value on frictionless land: where the tip would jam, the dirt gives way."""
_ROUNDS = 6


def carrying_stiffness_n_per_mm(soil: Soil, *, tip_radius_mm: float, pitch_mm: float) -> NDArray[np.float32]:
    """kappa = 2 pi r H, normal force per depth of sinkage, (rows, cols).

    H is the mean hardness under the ball, weighted by thickness, because the force is the pressure integrated over
    the dirt's area; clean metal does not count.
    """
    radius = max(tip_radius_mm, 0.5 * pitch_mm)  # half a sample is the finest that the grid resolves
    hardness = soil.hardness_mpa
    reach = int(np.floor(radius / pitch_mm))
    if reach >= 1 and np.ptp(hardness) > 0.0:
        from scipy import ndimage

        width = 2 * reach + 1
        # 64 bits, because the filter sums hardnesses that differ by orders of magnitude
        weight = soil.thickness_mm.astype(np.float64)
        total = ndimage.uniform_filter(weight, width, mode="nearest")
        mean = ndimage.uniform_filter(weight * hardness, width, mode="nearest")
        near = total > 1e-6 * float(weight.max(initial=0.0))
        under = np.divide(mean, total, out=hardness.astype(np.float64), where=near)
        hardness = np.clip(under, hardness.min(), hardness.max()).astype(np.float32)
    return np.asarray(np.float32(2.0 * math.pi * radius) * hardness, dtype=np.float32)


def sunken_heights(
    top_mm: NDArray[np.float32],
    bottom_mm: NDArray[np.float32],
    stiffness_n_per_mm: NDArray[np.float32],
    tip: TipModel,
    *,
    step_mm: float,
    preload_mm: float,
    friction: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Heights under traces for the pointwise formula; all arrays are (lines, samples). e depends on the slope of the
    track, and the slope weakly on e, so a few iterations per sample converge."""
    top, kappa, mu = (np.asarray(a, dtype=np.float64) for a in (top_mm, stiffness_n_per_mm, friction))
    thickness = np.maximum(top - bottom_mm, 0.0)
    d_yx, d_yy = float(tip.compliance_mm_per_n[1, 0]), float(tip.compliance_mm_per_n[1, 1])
    reach = np.maximum(preload_mm + top, 0.0)
    top_slope, kappa_slope = (_slope(a, step_mm) for a in (top, kappa))
    slope, sinkage = np.zeros_like(top), np.zeros_like(top)
    for _ in range(_ROUNDS):
        give = (d_yy * (1.0 - mu * slope) - d_yx * (slope + mu)) / np.sqrt(1.0 + slope**2)
        give = np.maximum(give, LEAST_GIVE * d_yy)
        sinkage = reach / (1.0 + kappa * give)
        held = np.minimum(sinkage, thickness)
        # held / f_n, which is 1 / kappa while the dirt carries, and stays bounded where the tip reaches the bottom
        per_force = held * give / np.maximum(reach - held, 1e-9)
        slope = (1.0 - 1.0 / (1.0 + kappa * give)) * (top_slope + held * per_force * kappa_slope)
    return np.asarray(np.maximum(top - sinkage, bottom_mm), dtype=np.float32)


def _slope(values: Floats, step_mm: float) -> Floats:
    if values.shape[1] < 2:
        return np.zeros_like(values)
    return np.asarray(np.gradient(values, step_mm, axis=1))
