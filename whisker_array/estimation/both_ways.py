"""Slope and lift where one differentiator was dragged both ways, compiled: `estimate` for whole maps at once."""

from __future__ import annotations

import math

import numpy as np

from glyphs.compiled import ANY_ORDER, kernel


@kernel(allow=ANY_ORDER)
def both_ways(ahead, back, row, arm, mu, land, steepest, slope, total, count):  # type: ignore[no-untyped-def]
    """Slope along the traces, and the lifts by both ways, each added to `total` where it is known.

    Args:
        ahead, back: (rows, cols) enhancement of the two ways, the base ahead in + and in -.
        row, arm: (3,) of the tip, as in eqs. (11) and (14).
        mu: friction.
        land: moment per lift on the land.
        steepest: slopes are cut here.
        slope: (rows, cols) overwritten; NaN where the moments fit none.
        total, count: (rows, cols) sum of the lifts known, in preloads, and how many there are.
    """
    # m = lift (a - b p) / (c - e p) one way, p = -p the other: R'a ~ (-mu - p, 1 - mu p)
    a, b = arm[1] - arm[0] * mu, arm[1] * mu + arm[0]
    c, e = row[1] - row[0] * mu, row[1] * mu + row[0]
    rows, cols = slope.shape
    for i in range(rows):
        for j in range(cols):
            one, other = (1.0 + ahead[i, j]) * land, (1.0 + back[i, j]) * land
            q = one / other
            square, linear, constant = b * e * (q - 1.0), (a * e - b * c) * (1.0 + q), a * c * (1.0 - q)
            disc = linear * linear - 4.0 * square * constant
            # the root nearer to zero; NaN where none is real
            p = -2.0 * constant / (linear + math.copysign(math.sqrt(disc), linear))
            p = -steepest if p < -steepest else p
            p = steepest if p > steepest else p
            slope[i, j] = p
            # the lean's tangent, tan(atan(p) + atan(mu)); beyond 90 degrees no force lifts the tip
            up, down = 1.0 - p * mu, 1.0 + p * mu
            t, s = (mu + p) / up, (mu - p) / down
            give_t, give_s = row[1] - row[0] * t, row[1] - row[0] * s
            lift_t, lift_s = one * give_t / (arm[1] - arm[0] * t), other * give_s / (arm[1] - arm[0] * s)
            known_t = up > 0.0 and give_t > 0.0 and abs(lift_t) < np.inf
            known_s = down > 0.0 and give_s > 0.0 and abs(lift_s) < np.inf
            total[i, j] += (lift_t if known_t else 0.0) + (lift_s if known_s else 0.0)
            count[i, j] += (1 if known_t else 0) + (1 if known_s else 0)
