r"""The contact fidelity: rate-independent frictional contact of tip and surface, in three dimensions.

At every sample the base advances by dx. The tip q = (x, z) on the dilated surface h minimises

    1/2 d^T K d + mu f_n |q - q_prev|_G,     d = (x - x_free, h(x, z) + d0, z - z_free),   K = D11^-1,

G = (1 + p^2, pq; pq, 1 + q^2) the surface metric and f_n the normal force of the last iterate::

       base ->  ________________ l1
                                |l2        d: from the unloaded tip (o) to the tip on the surface (x)
      land _____                x _______  The elastic force K d, projected on the surface, balances friction;
                \______________/o d0       the wire may also bend sideways, unlike in the pointwise map.

Where friction on the wall prevents the tip from rising, e_y.D11 (n - mu t) <= 0, it *jams*. Mostly the tip is caught
before that at the foot of the wall, where the slope is slightly less: it stays there, the base moves on and the force
grows without limit, so a force many times that on the land is a jam, too. Where the normal force vanishes, contact is
*lost*. All are flags of the sample.

Dirt that yields (`soft`) sets h between its top and the bottom below, by the load it carries: kappa s = f_n. The
sinkage s is a third unknown of the same iteration, because on slopes f_n at a fixed position changes with s many
times faster than e predicts, or in the wrong direction, so that an iteration for s alone does not converge. The
slopes of the track use load and e of the last sample.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from glyphs.compiled import read_only
from glyphs.ranges import require_positive
from glyphs.surface.display import OneLine
from whisker_array.simulation.contact_kernel import ABREAST, trace_abreast
from whisker_array.simulation.surface import TouchSurface
from whisker_array.simulation.threads import in_threads
from whisker_array.simulation.traces import Traces
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch


@dataclass(frozen=True, repr=False)
class SurfacePose(OneLine):
    """Pose of a surface with its own grid under traces, with a small tilt and a change of its heights::

        h(x, z) = H(u, v) + share D(u, v) + rise + along x + across z
        u, v = column_mm . (1, x, z), row_mm . (1, x, z)

    The fields of such a surface are (rows, cols, 6): height and slopes of H, and those of D.
    """

    column_mm: tuple[float, float, float]
    row_mm: tuple[float, float, float]
    tilt: tuple[float, float, float]
    share: float
    friction: float


def land_lag_mm(tip: TipModel, *, preload_mm: float, friction: float) -> float:
    """Displacement of the tip along x on flat land, e_x.D11 f with e_y.D11 f = d0; negative: behind. It is subtracted
    at the nominal friction, because a stage is set up with the tip, not the base, at the commanded position."""
    force = np.array([-friction, 1.0, 0.0])
    shift = tip.compliance_mm_per_n @ force
    return float(preload_mm * shift[0] / shift[1])


def trace_contact(
    surface: TouchSurface, touch: Touch, plan: SweepPlan, *, pose: SurfacePose | None = None
) -> Traces:
    """Trace the lines of a plan in the trace frame of an oriented surface, each whisker from rest. The friction of the
    touch is the nominal one, which sets only `land_lag_mm`. Raises WhiskerError."""
    require_positive(WhiskerError, step_mm=plan.step_mm)
    tip = touch.tip.pushed() if plan.pushed else touch.tip
    lines = np.ravel(np.asarray(plan.line_mm, dtype=np.float64))
    moment = np.empty((lines.size, plan.n_samples), dtype=np.float32)
    flags = np.empty(moment.shape, dtype=np.uint8)
    lag = land_lag_mm(tip, preload_mm=touch.preload_mm, friction=touch.friction)
    top = surface.yielding
    fields, yielding = read_only(surface.fields), None if top is None else read_only(top)
    lies = None if pose is None else astuple(pose)
    of_tip = [read_only(a) for a in (tip.stiffness_n_per_mm, tip.compliance_mm_per_n, tip.moment_arm_mm)]

    def trace(first: int, last: int) -> None:
        for block in range(first, last):
            some = slice(block * ABREAST, (block + 1) * ABREAST)
            trace_abreast(
                fields, yielding, lies, surface.pitch_mm, lines[some], float(plan.start_mm), float(plan.step_mm),
                lag, float(touch.preload_mm), *of_tip, moment[some], flags[some],
            )  # fmt: skip

    in_threads(trace, -(-lines.size // ABREAST))
    return Traces(moment_n_mm=moment, flags=flags)
