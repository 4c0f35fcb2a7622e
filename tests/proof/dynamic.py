r"""The dynamic fidelity: a whisker that vibrates while its tip slides, leaves the surface and lands again.

With p = dh/dx at the tip and the force f = lam a, a = (-(p + mu), 1 - mu p), as in `pointwise`::

    on the surface    u_y + c lam = d0 + h(x + u_x - u_x0),  lam > 0      u = sum phi_i q_i     c: Hertz (ball on plate)
    in the air        lam = 0,  while u_y > d0 + h                        x = v t,  u_x0: shift of a slow tip there

Height and slope are taken at the tip's position one step ago, and the height is extrapolated from there by the slope.
So the force acts along the normal of the constraint; otherwise a tip on a wall would gain energy. Newmark's average
acceleration (1959: unconditionally stable, second order) turns every step into one equation for lam, because contact
couples all modes by one force; lam <= 0 is lift-off. On a slow stage the result is that of the pointwise fidelity where
the surface is smooth; at the foot of a wall the tip slips to a new position, which the pointwise fidelity leaves out.
The tip slides forwards.

A whisker as a few vibrating modes, for the dynamic trace.

    base o======================.      q_i'' + 2 zeta w_i q_i' + w_i^2 q_i = phi_i . f        f: force on the tip
         '-> moment m           |      tip     u = sum phi_i q_i
                                o f    moment  m = sum b_i q_i + r . f,   r = T1 - sum b_i phi_i / w_i^2

The shapes are the three lowest modes with the tip held in height, which ring while it slides on the surface, and the
bend of a slow lift of the tip (Craig and Bampton 1968). Together they are transformed to the modes q of the free
whisker, so that a slow force lifts the tip exactly by D11 and gives exactly the moment of T1. Beams are
Euler-Bernoulli, with mass lumped at joints and exact flexibility between them (Meirovitch, Fundamentals of
Vibrations, 2001, ch. 8; Blevins, Formulas for Natural Frequency and Mode Shape, 1979, tables 8-1 and 8-5).

Errors by speed: a dynamic whisker over a stamped groove, compared with the same whisker on a slow stage.

    land ______          ______ ... ringing is measured from here, a stroke behind the last edge
               \        /
                \______/   bevels of 45 degrees, depth h/25, floor h/10 wide; dilated by the ball

The error is that of an edge map: both moments are averaged over pixels of a line pitch, and the rms of the difference
is divided by that of the signal. Everything scales with the character height, so that one speed holds for all
whiskers in proportion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel, read_only
from glyphs.surface.maps import HeightMap
from whisker_array.simulation.surface import prepare_surface
from whisker_array.simulation.threads import in_threads
from whisker_array.simulation.traces import SampleFlag, Traces
from whisker_array.whisker.array import LINES_PER_HEIGHT
from whisker_array.whisker.sections import Material
from whisker_array.whisker.shapes import Whisker
from whisker_array.whisker.touch import Touch
from whisker_array.whisker.validity import land_force_n, lumped_whisker

# ----------------------------------------------------------------------------------------------------- dynamic modes


@dataclass(frozen=True, eq=False)
class WhiskerModes:
    """A whisker in the plane of tracing, as modes normalised to unit mass; units N, mm, t, s.

    Attributes:
        omega_rad_s: (modes,) natural frequencies of the free whisker, ascending.
        tip: (modes, 2) shift of the tip along x and y in each mode.
        moment: (modes,) moment at the sensor in each mode.
        rest_moment_mm: (2,) moment at the sensor for a unit force on the tip, minus the part of the modes.
        held_hz: (held modes,) frequencies with the tip held in height.
        damping: share of critical damping of every mode.
    """

    omega_rad_s: NDArray[np.float64]
    tip: NDArray[np.float64]
    moment: NDArray[np.float64]
    rest_moment_mm: NDArray[np.float64]
    held_hz: NDArray[np.float64]
    damping: float = 0.01


def whisker_modes(whisker: Whisker, *, held: int = 3, damping: float = 0.01, parts: int = 24) -> WhiskerModes:
    """Compute the modes of a whisker in the plane of tracing.

    Args:
        whisker: a planar whisker, clamped at its base.
        held: number of modes with the tip held; the lift adds one more. Compared with finite elements over
            a groove at 120 mm/s, the error is 0.4 % of the land moment with two modes and 0.1 % with three.
        damping: share of critical damping (assumed; clamped steel springs without dampers have 0.2 to 2 %).
        parts: number of lumped pieces per segment.
    """
    lumped = lumped_whisker(whisker, parts=parts)
    n = len(lumped.joints_mm)
    flexibility = (lumped.strain.T @ lumped.strain).reshape(n, 3, n, 3)[:, :2, :, :2].reshape(2 * n, 2 * n)
    mass = np.repeat(lumped.mass_t, 2)
    lift = flexibility[:, -1] / flexibility[-1, -1]
    held_flexibility = flexibility - np.outer(lift, flexibility[-1])
    root = np.sqrt(mass)
    value, vector = np.linalg.eigh(root[:, None] * held_flexibility * root)
    square = 1.0 / value[::-1][:held]
    basis = np.column_stack([lift, vector[:, ::-1][:, :held] / root[:, None]])
    # Craig-Bampton: stiffness is diagonal, mass couples the lift to the held modes
    stiffness = np.diag([1.0 / flexibility[-1, -1], *square])
    coupled = basis.T @ (mass[:, None] * basis)
    half = np.linalg.inv(np.linalg.cholesky(coupled))
    squares, turned = np.linalg.eigh(half @ stiffness @ half.T)
    shape = (basis @ half.T @ turned).T.reshape(held + 1, n, 2)
    arm = whisker.tip_model().moment_arm_mm[:2]
    # the sensor measures the moment of the inertia forces about it: w^2 sum m (r x phi)
    sensor = lumped.joints_mm[-1, :2] - np.array([arm[1], -arm[0]])
    reach = lumped.joints_mm[:, :2] - sensor
    turning = reach[:, 0] * shape[:, :, 1] - reach[:, 1] * shape[:, :, 0]
    moment = squares * (turning * lumped.mass_t).sum(axis=1)
    tip = shape[:, -1]
    return WhiskerModes(
        omega_rad_s=np.sqrt(squares),
        tip=tip,
        moment=moment,
        rest_moment_mm=arm - (moment / squares) @ tip,
        held_hz=np.sqrt(square) / (2.0 * math.pi),
        damping=damping,
    )


def contact_mm_per_n(*, tip_radius_mm: float, force_n: float, material: Material) -> float:
    """Compliance of a ball on a plate of the same material, by Hertz, linearised about a force.

        delta = (9 F^2 / (16 R E*^2))^(1/3),   d delta / dF = (6 R E*^2 F)^(-1/3),   E* = E / (2 (1 - nu^2))

    (Johnson, Contact Mechanics, 1985, eq. 4.23.)
    """
    reduced = material.e_mpa / (2.0 * (1.0 - material.poisson**2))
    return float((6.0 * tip_radius_mm * reduced**2 * force_n) ** (-1.0 / 3.0))


# ----------------------------------------------------------------------------------------------------------- dynamic

_LOST = np.uint8(SampleFlag.CONTACT_LOST)
_JAMMED = np.uint8(SampleFlag.JAMMED)
CONTACT_DAMPING = 0.1
"""Share of critical damping of the tip on its contact (assumed)."""
STEPS_A_PERIOD = 16.0
"""Time steps in the shortest period, that of the tip on its contact; twice as many change the moment by < 0.1 %."""


def shortest_period_s(modes: WhiskerModes, *, contact_mm_per_n: float, friction: float) -> float:
    """Shortest period of the modes while the tip is on level land: diag(w^2) + phi_y phi_a / (c a_y)."""
    push = modes.tip @ np.array([-friction, 1.0])
    held = np.diag(modes.omega_rad_s**2) + np.outer(push, modes.tip[:, 1]) / contact_mm_per_n
    return 2.0 * math.pi / math.sqrt(float(np.abs(np.linalg.eigvals(held)).max()))


@kernel()
def _kernel(  # type: ignore[no-untyped-def]
    first, last, h, slope, slow, mu, d0, step, steps, dt, omega, tip, arm, rest, contact, lag, damping, room, moment,
    flags,
):  # fmt: skip
    samples, n = h.shape[1], omega.size
    c0, c1 = 4.0 / (dt * dt), 2.0 / dt
    for i in range(first, last):
        p, held = slope[i, 0], 0.0
        for m in range(n):
            push = tip[m, 1] * (1.0 - mu * p) - tip[m, 0] * (p + mu)
            held += (tip[m, 1] - p * tip[m, 0]) * push / omega[m] ** 2
        lam = slow[i, 0, 1] * held / (held + contact)
        pressed = contact * lam
        for m in range(n):  # at rest on the first sample
            push = tip[m, 1] * (1.0 - mu * p) - tip[m, 0] * (p + mu)
            room[i, 0, m], room[i, 1, m], room[i, 2, m] = push * lam / omega[m] ** 2, 0.0, 0.0
        for j in range(samples):
            lost = False
            for k in range(steps if j > 0 else 0):
                base = j - 1 + (k + 1.0) / steps
                at = min(int(base), samples - 2)
                part = base - at
                waits = slow[i, at, 0] + part * (slow[i, at + 1, 0] - slow[i, at, 0])
                ahead = -waits
                for m in range(n):
                    ahead += tip[m, 0] * room[i, 0, m]
                place = min(max(base + ahead / step, 0.0), samples - 1.0)
                at = min(int(place), samples - 2)
                part = place - at
                height = h[i, at] + part * (h[i, at + 1] - h[i, at])
                p = slope[i, at] + part * (slope[i, at + 1] - slope[i, at])
                ax, ay = -(p + mu), 1.0 - mu * p
                free, give = 0.0, 0.0
                for m in range(n):
                    q, v, a = room[i, 0, m], room[i, 1, m], room[i, 2, m]
                    drag = 2.0 * damping * omega[m]
                    stiff = c0 + drag * c1 + omega[m] ** 2
                    room[i, 3, m] = (c0 * q + 2.0 * c1 * v + a + drag * (c1 * q + v)) / stiff
                    room[i, 4, m] = (tip[m, 0] * ax + tip[m, 1] * ay) / stiff
                    normal = tip[m, 1] - p * tip[m, 0]
                    free += normal * room[i, 3, m]
                    give += normal * room[i, 4, m]
                # ball and plate: c lam = pressed + lag pressed'
                reach = d0 + height - p * (ahead + waits) - free
                more = 1.0 + lag / dt
                lam = (more * reach - lag / dt * pressed) / (contact + more * give)
                if lam <= 0.0:
                    lam, lost = 0.0, True
                pressed = reach - give * lam
                for m in range(n):
                    q, v, a = room[i, 0, m], room[i, 1, m], room[i, 2, m]
                    new = room[i, 3, m] + room[i, 4, m] * lam
                    room[i, 0, m] = new
                    room[i, 2, m] = c0 * (new - q) - 2.0 * c1 * v - a
                    room[i, 1, m] = c1 * (new - q) - v
            total = lam * (rest[1] * (1.0 - mu * p) - rest[0] * (p + mu))
            for m in range(n):
                total += arm[m] * room[i, 0, m]
            moment[i, j] = total
            flags[i, j] = _LOST if lost else np.uint8(0)


def _slow(
    h: NDArray[np.float64],
    slope: NDArray[np.float64],
    modes: WhiskerModes,
    *,
    preload_mm: float,
    friction: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Shift along x and force lam (lines, samples, 2) of a slow tip at each sample, and where it jams.

    Where it jams or nearly jams, the give of the tip is set to a tenth of that on the land.
    """
    compliance = (modes.tip / modes.omega_rad_s[:, None] ** 2).T @ modes.tip
    ax, ay = -(slope + friction), 1.0 - friction * slope
    give = compliance[1, 0] * ax + compliance[1, 1] * ay
    land = compliance[1, 1] - compliance[1, 0] * friction
    lam = np.maximum(preload_mm + h, 0.0) / np.maximum(give, 0.1 * land)
    shift = lam * (compliance[0, 0] * ax + compliance[0, 1] * ay)
    return np.stack([shift, lam], axis=2), give <= 0.0


def trace_dynamic(
    height_mm: NDArray[np.float32],
    modes: WhiskerModes,
    *,
    step_mm: float,
    speed_mm_s: float,
    preload_mm: float,
    friction: float,
    contact_mm_per_n: float,
    steps_a_period: float = STEPS_A_PERIOD,
) -> Traces:
    """Simulate traces along the columns of a (lines, samples) field of heights, by a whisker with mass.

    It starts at rest on the first sample. Unlike in the other fidelities, a lost sample has a moment, that of the
    ringing whisker; it is flagged CONTACT_LOST if the tip was in the air at any time since the sample before. Where a
    slow whisker would jam, the sample is flagged JAMMED.

    Args:
        height_mm: dilated heights above the land at each sample, float32.
        modes: modes of the whisker.
        step_mm: distance between neighbouring samples; between them height and slope are interpolated linearly.
        speed_mm_s: speed of the stage.
        preload_mm: d0, depth of the unloaded tip below the land.
        friction: Coulomb coefficient.
        contact_mm_per_n: compliance of ball and plate, see `contact_mm_per_n`.
        steps_a_period: time steps in the shortest period.
    """
    period = shortest_period_s(modes, contact_mm_per_n=contact_mm_per_n, friction=friction)
    steps = max(1, math.ceil(step_mm / speed_mm_s / period * steps_a_period))
    lag = CONTACT_DAMPING * period / math.pi
    h = read_only(height_mm, np.float64)
    slope = np.gradient(h, step_mm, axis=1)
    slow, jams = _slow(h, slope, modes, preload_mm=preload_mm, friction=friction)
    moment, flags = np.empty(h.shape), np.empty(h.shape, dtype=np.uint8)
    room = np.zeros((h.shape[0], 5, modes.omega_rad_s.size))
    given = (
        h, read_only(slope), read_only(slow), float(friction), float(preload_mm), float(step_mm), steps,
        step_mm / speed_mm_s / steps, read_only(modes.omega_rad_s), read_only(modes.tip), read_only(modes.moment),
        read_only(modes.rest_moment_mm), float(contact_mm_per_n), lag, float(modes.damping), room, moment, flags,
    )  # fmt: skip
    in_threads(lambda first, last: _kernel(first, last, *given), h.shape[0])
    flags |= np.where(jams, _JAMMED, np.uint8(0))
    return Traces(moment_n_mm=moment.astype(np.float32), flags=flags)


# ----------------------------------------------------------------------------------------------------- dynamic speed

BEVEL_RAD = math.pi / 4.0
"""The usual bevel of stamped marks."""
DEPTH_HEIGHTS, STROKE_HEIGHTS = 0.04, 0.1
"""Depth and stroke of usual marks, character heights (0.25 mm deep at 6.35 mm)."""
FINE_ERROR = 0.05
"""Largest error of the edge map in passes for reading characters."""
_STEPS_A_PITCH, _BEFORE_HEIGHTS, _BEHIND_HEIGHTS = 20, 0.3, 0.8
_SLOWEST = 2.0


@dataclass(frozen=True, eq=False)
class SpeedCost:
    """One speed over the groove: moments, as shares of the land moment, and errors.

    Attributes:
        speed_mm_s: speed of the stage.
        place_mm: (samples,) position along the trace.
        fast: (samples,) moment at that speed.
        slow: (samples,) moment on a stage so slow that nothing rings. (The pointwise fidelity would leave out the slip
            of the tip at the foot of the groove.)
        error: error of the edge map, as a share of the signal.
        ringing: greatest error from a stroke behind the last edge on.
        in_air_mm: length of surface on which the tip was in the air at least briefly.
    """

    speed_mm_s: float
    place_mm: NDArray[np.float64]
    fast: NDArray[np.float64]
    slow: NDArray[np.float64]
    error: float
    ringing: float
    in_air_mm: float


@dataclass(frozen=True, eq=False)
class _Stage:
    """One whisker over one groove: its traces by speed, the moment at the slowest, and the start of the ringing."""

    trace: Callable[..., Traces]
    slow_n_mm: NDArray[np.float64]
    step_mm: float
    rings_from: int


def groove(
    height_mm: float, *, tip_radius_mm: float, bevel_rad: float, stroke_heights: float = STROKE_HEIGHTS
) -> tuple[NDArray[np.float32], float, int]:
    """Heights of the dilated groove, their pitch, and the sample from which ringing is measured."""
    step = height_mm / (LINES_PER_HEIGHT * _STEPS_A_PITCH)
    depth, stroke = DEPTH_HEIGHTS * height_mm, stroke_heights * height_mm
    wide = stroke + 2.0 * depth / math.tan(bevel_rad)
    x = np.arange(0.0, (_BEFORE_HEIGHTS + _BEHIND_HEIGHTS) * height_mm + wide, step)
    middle = _BEFORE_HEIGHTS * height_mm + 0.5 * wide
    z = -np.clip((0.5 * wide - np.abs(x - middle)) * math.tan(bevel_rad), 0.0, depth)
    rim = math.ceil(tip_radius_mm / step) + 1
    rows = np.tile(z.astype(np.float32), (2 * rim + 1, 1))
    dilated = prepare_surface(HeightMap(rows, step), tip_radius_mm=tip_radius_mm, friction=0.0)
    return dilated.fields[rim : rim + 1, :, 0], step, round((middle + 0.5 * wide + stroke) / step)


@lru_cache(maxsize=8)
def _stage(
    whisker: Whisker, touch: Touch, character_height_mm: float, bevel_rad: float, stroke_heights: float
) -> _Stage:
    ball, preload = touch.tip_radius_mm, touch.preload_mm
    force = float(land_force_n(whisker, preload_mm=preload, mu=touch.friction)[1])
    heights, step, rings_from = groove(
        character_height_mm, tip_radius_mm=ball, bevel_rad=bevel_rad, stroke_heights=stroke_heights
    )
    trace = partial(
        trace_dynamic, heights, whisker_modes(whisker), step_mm=step, preload_mm=preload, friction=touch.friction,
        contact_mm_per_n=contact_mm_per_n(tip_radius_mm=ball, force_n=force, material=whisker.material),
    )  # fmt: skip
    return _Stage(trace, trace(speed_mm_s=_SLOWEST).moment_n_mm[0].astype(np.float64), step, rings_from)


def speed_cost(
    whisker: Whisker,
    touch: Touch,
    *,
    speed_mm_s: float,
    character_height_mm: float,
    bevel_rad: float = BEVEL_RAD,
    stroke_heights: float = STROKE_HEIGHTS,
) -> SpeedCost:
    """Simulate the errors at a speed over one stamped groove.

    Args:
        whisker: whisker of the touch.
        touch: preload, ball and friction.
        speed_mm_s: speed of the stage.
        character_height_mm: character height, with which the groove scales.
        bevel_rad: bevel of its walls.
        stroke_heights: width of its floor, character heights.
    """
    stage = _stage(whisker, touch, character_height_mm, bevel_rad, stroke_heights)
    slow, traced = stage.slow_n_mm, stage.trace(speed_mm_s=speed_mm_s)
    fast, land = traced.moment_n_mm[0].astype(np.float64), float(slow[0])
    signal, wrong = slow / land - 1.0, (fast - slow) / land
    pixel = np.ones(_STEPS_A_PITCH) / _STEPS_A_PITCH
    averaged = [np.convolve(v, pixel, mode="valid") for v in (wrong, signal)]
    lost = (traced.flags[0] & np.uint8(SampleFlag.CONTACT_LOST)) != 0
    return SpeedCost(
        speed_mm_s=speed_mm_s,
        place_mm=stage.step_mm * np.arange(slow.size, dtype=np.float64),
        fast=fast / land,
        slow=slow / land,
        error=float(np.sqrt((averaged[0] ** 2).mean() / (averaged[1] ** 2).mean())),
        ringing=float(np.abs(wrong[stage.rings_from :]).max()),
        in_air_mm=float(lost.sum()) * stage.step_mm,
    )
