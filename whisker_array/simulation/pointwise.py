r"""The pointwise fidelity: the paper's formula at every sample, with the slope along the trace.

With p = dh/dx = -tan(alpha) the sliding contact force is f = f_n (n - mu t), and in components::

       n - mu t  ~  ( -(p + mu),  1 - mu p )          alpha > 0: the surface falls in +x
                                                       ____
    height constraint (7),(11)  e_y.D11 f = d0 + h         \  alpha
    moment (13),(14)            m = s3.T1 f                 \____

so that  m = (d0 + h) * (T1x (p + mu) - T1y (1 - mu p)) / (Dyx (p + mu) - Dyy (1 - mu p)),
which is m_land (1 + h/d0) F(slope, mu) of eq. (16).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import FAST, kernel, read_only
from glyphs.ranges import require_positive
from whisker_array.simulation.threads import in_threads
from whisker_array.simulation.traces import JAMMED, LOST, Traces
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import TipModel


@kernel(allow=FAST)
def _kernel(first, last, h, mu, d0, inv_two_step, dyx, dyy, tx, ty, moment, flags):  # type: ignore[no-untyped-def]
    samples = h.shape[1]
    unity, zero = np.float32(1.0), np.float32(0.0)
    for i in range(first, last):
        beside = mu[i % mu.shape[0]]
        each = 1 if beside.size == samples else 0  # from a map; otherwise one number for all
        for j in range(samples):
            left, right = max(j - 1, 0), min(j + 1, samples - 1)
            p = (h[i, right] - h[i, left]) * inv_two_step
            if right - left == 1:  # one-sided at the ends of the trace
                p = p + p
            m = beside[j * each]
            ax = -(p + m)
            ay = unity - m * p
            reach = d0 + h[i, j]
            give = dyx * ax + dyy * ay
            lost, jam = reach <= zero, give <= zero
            moment[i, j] = zero if (lost or jam) else reach * (tx * ax + ty * ay) / give
            flags[i, j] = (LOST if lost else np.uint8(0)) | (JAMMED if jam else np.uint8(0))


def trace_pointwise(
    height_mm: NDArray[np.float32],
    tip: TipModel,
    *,
    step_mm: float,
    preload_mm: float,
    friction: float | NDArray[np.float32],
) -> Traces:
    """Trace the columns of (lines, samples) dilated heights by eqs. (11), (14), (16). Raises WhiskerError."""
    require_positive(WhiskerError, preload_mm=preload_mm, step_mm=step_mm)
    h = np.ascontiguousarray(height_mm, dtype=np.float32)
    mu = read_only(np.atleast_2d(friction), np.float32)
    moment = np.empty_like(h)
    flags = np.empty(h.shape, dtype=np.uint8)
    compliance, arm = tip.compliance_mm_per_n, tip.moment_arm_mm
    numbers = preload_mm, 0.5 / step_mm, compliance[1, 0], compliance[1, 1], arm[0], arm[1]
    arguments = read_only(h), mu, *(np.float32(number) for number in numbers), moment, flags
    in_threads(lambda first, last: _kernel(first, last, *arguments), h.shape[0])
    return Traces(moment_n_mm=moment, flags=flags)
