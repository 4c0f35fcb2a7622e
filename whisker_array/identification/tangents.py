r"""What each number of a bench does to a prediction.

A touch knows of a whisker only five numbers of its tip, in which lengths, angle and stiffness are gathered::

    q = (D11_xx, D11_xy, D11_zz) / D11_yy,   arm_x / arm_y,   arm_y / D11_yy
    moment = (arm_y / D11_yy) * (what the contact makes of the other four)

    d moment / d p = sum over j  d moment / d q_j  *  d q_j / d p

So the contact is run for the first four alone, the fifth is a factor, and what no signal tells apart (a length from
an angle, a stiffness from a gain) is told apart by no noise of differences either.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.bench import DRAWN, Bench, Unknown, of_screw, of_whisker, screw_ways
from whisker_array.identification.forward import Forward
from whisker_array.whisker.shapes import LShaped, TipModel

MOST_SIGMAS = 150.0
"""What a number may do to a sample, in sigmas for each standard deviation before: more, and the tip has jumped."""
_PROBE = 1e-3
"""Of a difference of the tip's own numbers, which are smooth: in standard deviations before."""
_SHAPE = 4
"""Of the tip's numbers those that are no factor."""


def tip_numbers(tip: TipModel) -> NDArray[np.float64]:
    """(5,) the numbers q of the module's docstring."""
    d, arm = tip.compliance_mm_per_n, tip.moment_arm_mm
    return np.asarray(np.array([d[0, 0], d[0, 1], d[2, 2], d[1, 1] * arm[0] / arm[1], arm[1]]) / d[1, 1])


def tip_of_numbers(q: NDArray[np.float64]) -> TipModel:
    """A tip with these numbers; one that yields by 1 mm to 1 N upwards.

    Raises:
        WhiskerError: numbers that no tip has.
    """
    d = np.array([[q[0], q[1], 0.0], [q[1], 1.0, 0.0], [0.0, 0.0, q[2]]])
    return TipModel(d, q[4] * np.array([q[3], 1.0, 0.0]))


def jacobian_of(
    forward: Forward,
    at: Bench,
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    here: Sequence[NDArray[np.float64]],
    sigma: Sequence[NDArray[np.float64]],
    *,
    reach: float,
) -> list[NDArray[np.float64]]:
    """(samples, n) of every trace: what each number does to the prediction; nothing where the tip jumps by it.

    Args:
        forward: predicts.
        at: the bench.
        before: (n,) standard deviations of the numbers before.
        free: (n,) those that are asked for.
        here: (samples,) of every trace, predicted of the bench.
        sigma: (samples,) of every trace.
        reach: of a difference, in standard deviations before.
    """
    vector, names = at.vector(), list(Unknown)
    out = [np.zeros((p.size, vector.size)) for p in here]

    def differs(there: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        """What a step of `reach` does, for each standard deviation."""
        by = [(t - p) / reach for t, p in zip(there, here, strict=True)]
        return [np.where(np.abs(b) > MOST_SIGMAS * s, 0.0, b) for b, s in zip(by, sigma, strict=True)]

    for i, name in enumerate(names):
        if not free[i] or name in DRAWN:
            continue
        step = np.zeros(vector.size)
        step[i] = reach * before[i]
        for k, by in enumerate(differs(forward.moments(Bench.of_vector(vector + step)))):
            out[k][:, i] = by / before[i]
    drawn = np.array([i for i, name in enumerate(names) if free[i] and name in DRAWN], dtype=np.intp)
    by_factor = np.zeros(drawn.size)
    if drawn.size and isinstance(forward.nominal, LShaped):
        q, by_drawn = _tip_by(at, before, drawn, forward.nominal)
        sd = np.sqrt((by_drawn**2).sum(axis=1))
        for j in range(_SHAPE):
            if sd[j] < 1e-9:
                continue
            moved = q.copy()
            moved[j] += reach * sd[j]
            for k, by in enumerate(differs(forward.moments(at, tip=tip_of_numbers(moved)))):
                out[k][:, drawn] += np.outer(by / sd[j], by_drawn[j] / before[drawn])
        by_factor = by_drawn[_SHAPE] / (q[_SHAPE] * before[drawn])
    for k, (trace, (signal, units)) in enumerate(zip(forward.traces, forward.pressed(at), strict=True)):
        own = of_whisker(trace.whisker, n_whiskers=at.gain.size)
        out[k][:, drawn] += np.outer(signal, by_factor)
        out[k][:, own] = np.stack([signal / at.gain[trace.whisker], *units], axis=1)
        # a screw that is ahead is a piece that lies as much behind
        along_x = trace.plan.direction.along_x
        shift = out[k][:, names.index(Unknown.SHIFT_X if along_x else Unknown.SHIFT_Y)]
        ways = screw_ways(trace.plan.position_mm())
        out[k][:, of_screw(vector.size, along_x=along_x)] = -shift[:, None] * ways
        out[k][np.isnan(trace.felt_n_mm)] = 0.0
    return out


def _tip_by(
    at: Bench, before: NDArray[np.float64], drawn: NDArray[np.intp], nominal: LShaped
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(5,) the tip's numbers, and (5, drawn) what a standard deviation of each of the whisker's does to them."""
    vector = at.vector()

    def of(step: NDArray[np.float64]) -> NDArray[np.float64]:
        return tip_numbers(Bench.of_vector(vector + step).whisker(nominal).tip_model())

    steps = [_PROBE * before[i] * np.eye(vector.size)[i] for i in drawn]
    by = np.stack([(of(step) - of(-step)) / (2.0 * _PROBE) for step in steps], axis=1)
    return of(np.zeros(vector.size)), by
