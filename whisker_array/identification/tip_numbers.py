r"""Five numbers of an L-shaped whisker's tip that combine its lengths, angle and stiffness.

    d = D11 / D11_yy,     q = (ln(d_xx - d_xy^2), d_xy, ln d_zz, arm_x / arm_y),   arm_y / D11_yy
    moment = (arm_y / D11_yy) * (a function of the other four, from the contact)

So contact is simulated for the first four only, and the fifth is a factor. No signal can separate some unknowns (a
length from an angle, a stiffness from a gain). With these five, the noise of finite differences does not separate them
either. D11 is positive definite for any values of the first four.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.bench import Bench
from whisker_array.whisker.shapes import LShaped, TipModel

SHAPE = 4
"""How many of the five numbers are not a factor."""
_PROBE = 1e-3
"""Step of the finite differences, in standard deviations of the cloud."""


def tip_numbers(tip: TipModel) -> NDArray[np.float64]:
    """(5,) the five numbers of the module's docstring."""
    d, arm = tip.compliance_mm_per_n / tip.compliance_mm_per_n[1, 1], tip.moment_arm_mm
    shape = math.log(d[0, 0] - d[0, 1] ** 2), d[0, 1], math.log(d[2, 2]), arm[0] / arm[1]
    return np.array([*shape, arm[1] / tip.compliance_mm_per_n[1, 1]])


def tip_of_numbers(q: NDArray[np.float64]) -> TipModel:
    """Return a tip with these numbers and a vertical compliance of 1 mm/N."""
    d = np.diag([math.exp(q[0]) + q[1] ** 2, 1.0, math.exp(q[2])])
    d[0, 1] = d[1, 0] = q[1]
    return TipModel(d, q[4] * np.array([q[3], 1.0, 0.0]))


def tip_derivatives(
    at: Bench, before: NDArray[np.float64], drawn: NDArray[np.intp], nominal: LShaped
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(5,) the tip's numbers, and (5, drawn) their derivatives by the unknowns at the indices `drawn`."""
    vector = at.vector()

    def of(step: NDArray[np.float64]) -> NDArray[np.float64]:
        return tip_numbers(Bench.of_vector(vector + step).whisker(nominal).tip_model())

    steps = [_PROBE * before[i] * np.eye(vector.size)[i] for i in drawn]
    by = np.stack([(of(step) - of(-step)) / (2.0 * step.sum()) for step in steps], axis=1)
    return of(np.zeros(vector.size)), by
