"""The loop of `registration`, compiled: how badly plays fit eq. (16)."""

from __future__ import annotations

import math

from glyphs.compiled import ANY_ORDER, kernel


@kernel(allow=ANY_ORDER)
def misses(ahead, behind, halves, per_pixel, steepest, mu, row, arm, per_land, rim, room, cost):  # type: ignore[no-untyped-def]
    """Add, for every half play tried, the sum of squares of the edges felt less those that eq. (16) predicts.

    Args:
        ahead, behind: (lines, beyond + samples + beyond) enhancement, its ends repeated beyond all plays.
        halves: half plays, pixels.
        per_pixel: preload over pitch: slopes of heights in preloads a pixel.
        steepest: slopes are cut here.
        mu: friction.
        row, arm: of the tip, (3,) each, as in eq. (16).
        per_land: lift over turn on the land.
        rim: samples at both ends that do not count.
        room: (5, samples) to work in.
        cost: (halves,) added to.
    """
    n = room.shape[1]
    beyond = (ahead.shape[1] - n) // 2
    total, edges, reach, slope, step = room[0], room[1], room[2], room[3], room[4]
    # R'a of `enhancement._lift_and_turn` at slope and -slope; 1 for a whisker that jams
    lift, turn = row[1] - row[0] * mu, arm[1] - arm[0] * mu
    by_lift, by_turn = row[0] + row[1] * mu, arm[0] + arm[1] * mu
    for k in range(halves.size):
        # half sum and half difference of two lines moved towards each other, interpolated
        there, back = math.floor(halves[k]), math.floor(-halves[k])
        part, rest = halves[k] - there, -halves[k] - back
        a0, b0 = beyond - int(there), beyond - int(back)
        for i in range(ahead.shape[0]):
            one, other = ahead[i], behind[i]
            for j in range(n):
                a = (1.0 - part) * one[a0 + j] + part * one[a0 + j - 1]
                b = (1.0 - rest) * other[b0 + j] + rest * other[b0 + j - 1]
                total[j], edges[j] = 0.5 * (a + b), 0.5 * (a - b)
                reach[j] = 1.0 + total[j]
            for _ in range(2):
                slope[0], slope[n - 1] = reach[1] - reach[0], reach[n - 1] - reach[n - 2]
                for j in range(1, n - 1):
                    slope[j] = 0.5 * (reach[j + 1] - reach[j - 1])
                for j in range(n):
                    p = min(max(slope[j] * per_pixel, -steepest), steepest)
                    up, down = lift - by_lift * p, lift + by_lift * p
                    rising = per_land * (turn - by_turn * p) / up if up > 0.0 else 1.0
                    falling = per_land * (turn + by_turn * p) / down if down > 0.0 else 1.0
                    reach[j] = (1.0 + total[j]) / max(0.5 * (rising + falling), 0.1)
                    step[j] = 0.5 * (rising - falling)
            missed = 0.0
            for j in range(rim, n - rim):
                miss = edges[j] - reach[j] * step[j]
                missed += miss * miss
            cost[k] += missed
