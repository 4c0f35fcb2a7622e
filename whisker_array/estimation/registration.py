"""Estimate the play between the directions of a scan from the physics of the touch.

Back-and-forth maps cannot simply be matched: to first order the edge signal *is* a shift. With e = h/d0 - a h' the
forward map is the profile shifted one way, and the backward map the profile shifted the other way::

    forward   h/d0 - a h'  ~  h(x - a d0)/d0         half sum         the profile, for any edges
    backward  h/d0 + a h'  ~  h(x + a d0)/d0         half difference  the edges, which the profile predicts

So for every trial play, the half sum gives the profile, and the edges that eq. (16) predicts from it are compared with
the half difference. The play that agrees best is removed.
"""

from __future__ import annotations

import math

import numpy as np

from glyphs.compiled import ANY_ORDER, kernel, read_only
from glyphs.surface.maps import OPPOSITE_DIRECTIONS, TraceDirection
from whisker_array.arrays import Floats
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.touch import Touch

LIMIT_PIXELS = 6
"""Largest play searched for, to either side; more would be a fault of the stage."""
DEAD_BAND_PIXELS = 0.75
"""Smaller play is ignored, because real contact differs as much from the pointwise prediction."""
MOST_LINES = 12
"""Number of lines used, those with the most edges."""
STEEPEST = 1.7
"""Slopes are clipped here, at 60 degrees, the steepest of a die; beyond is sampling noise."""


def registration_mm(
    layers: list[Floats], directions: tuple[TraceDirection, ...], *, touch: Touch, pitch_mm: float
) -> dict[TraceDirection, tuple[float, float]]:
    """Plate shift (dx, dy) of each direction that aligns its map with the common one; empty without play. Opposite
    directions share their play equally; the crossed pair is aligned with the first by its profile."""
    by_direction = dict(zip(directions, layers, strict=True))
    shift: dict[TraceDirection, tuple[float, float]] = {}
    profiles: list[Floats] = []
    for forward, back in OPPOSITE_DIRECTIONS:
        if forward not in by_direction or back not in by_direction:
            continue
        along_x = forward.along_x
        ahead, behind = (by_direction[d] if along_x else by_direction[d].T for d in (forward, back))
        play = play_pixels(ahead, behind, touch=touch, pitch_mm=pitch_mm)
        if abs(play) > DEAD_BAND_PIXELS:
            half = 0.5 * play * pitch_mm
            shift[forward] = (half, 0.0) if along_x else (0.0, half)
            shift[back] = (-half, 0.0) if along_x else (0.0, -half)
            ahead, behind = _shift_rows(ahead, 0.5 * play), _shift_rows(behind, -0.5 * play)
        profiles.append(0.5 * (ahead + behind) if along_x else 0.5 * (ahead + behind).T)
    if len(profiles) == 2:
        rows, cols = _offset_pixels(*profiles)
        if max(abs(rows), abs(cols)) > DEAD_BAND_PIXELS:
            for d in OPPOSITE_DIRECTIONS[1]:
                present = shift.get(d, (0.0, 0.0))
                shift[d] = (present[0] + cols * pitch_mm, present[1] + rows * pitch_mm)
    return shift


def play_pixels(ahead: Floats, behind: Floats, *, touch: Touch, pitch_mm: float) -> float:
    """Find the play, pixels, that agrees best with eq. (16), positive if the forward map must move on; 0 if unclear."""
    mu, row, arm = touch.friction, touch.tip.compliance_mm_per_n[1], touch.tip.moment_arm_mm
    moment_ratio(0.0, mu, touch.tip)  # raises an error if the whisker jams on the land
    per_land = (row[1] - row[0] * mu) / (arm[1] - arm[0] * mu)
    strength = (ahead**2).sum(axis=1) + (behind**2).sum(axis=1)
    lines = np.argsort(-strength)[:MOST_LINES]
    beyond = math.ceil(0.5 * LIMIT_PIXELS) + 1
    wide = [np.pad(layer[lines], ((0, 0), (beyond, beyond)), mode="edge") for layer in (ahead, behind)]
    plays = np.arange(-LIMIT_PIXELS, LIMIT_PIXELS + 1)
    cost, room = np.zeros(plays.size), np.empty((5, ahead.shape[1]))
    add_costs(
        *wide, 0.5 * plays, touch.preload_mm / pitch_mm, STEEPEST, mu, read_only(row), read_only(arm),
        float(per_land), LIMIT_PIXELS, room, cost,
    )  # fmt: skip
    best = int(np.argmin(cost))
    if not 0 < best < plays.size - 1 or cost[best] > 0.98 * np.median(cost):
        return 0.0
    return float(plays[best] + _vertex(*cost[best - 1 : best + 2]))


def _vertex(before: float, middle: float, after: float) -> float:
    curve = before - 2.0 * middle + after
    return 0.5 * (before - after) / curve if curve else 0.0


@kernel(allow=ANY_ORDER)
def add_costs(ahead, behind, halves, per_pixel, steepest, mu, row, arm, per_land, rim, room, cost):  # type: ignore[no-untyped-def]
    """Add to `cost`, for every half play, the sum of squared differences between measured edges and those of eq. (16).

    Enhancement (lines, beyond + samples + beyond) is padded by its end values; row and arm (3,) are those of the tip,
    as in eq. (16); `room` (5, samples) is a work array.
    """
    n = room.shape[1]
    beyond = (ahead.shape[1] - n) // 2
    total, edges, reach, slope, step = room[0], room[1], room[2], room[3], room[4]
    # R'a of `enhancement._lift_and_turn` at slope and -slope; 1 for a whisker that jams
    lift, turn = row[1] - row[0] * mu, arm[1] - arm[0] * mu
    by_lift, by_turn = row[0] + row[1] * mu, arm[0] + arm[1] * mu
    for k in range(halves.size):
        # half sum and half difference of two lines shifted towards each other, interpolated
        there, back = math.floor(halves[k]), math.floor(-halves[k])
        part, back_part = halves[k] - there, -halves[k] - back
        a0, b0 = beyond - int(there), beyond - int(back)
        for i in range(ahead.shape[0]):
            line, other = ahead[i], behind[i]
            for j in range(n):
                a = (1.0 - part) * line[a0 + j] + part * line[a0 + j - 1]
                b = (1.0 - back_part) * other[b0 + j] + back_part * other[b0 + j - 1]
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


def _shift_rows(layer: Floats, pixels: float) -> Floats:
    from scipy import ndimage

    return np.asarray(ndimage.shift(layer, (0.0, pixels), order=1, mode="nearest"))


def _offset_pixels(reference: Floats, moved: Floats) -> tuple[float, float]:
    from glyphs.opencv import cv2

    reach = LIMIT_PIXELS + 1
    a, b = ((layer - layer.mean()).astype(np.float32) for layer in (reference, moved))
    window = cv2.matchTemplate(np.pad(a, reach), b, cv2.TM_CCORR)
    r, c = np.unravel_index(int(np.argmax(window)), window.shape)
    if not (0 < r < 2 * reach and 0 < c < 2 * reach):
        return (0.0, 0.0)
    rows, cols = _vertex(*window[r - 1 : r + 2, c]), _vertex(*window[r, c - 1 : c + 2])
    return float(r - reach + rows), float(c - reach + cols)
