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
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel, read_only
from glyphs.ranges import require_positive
from tests.proof.dynamic_modes import WhiskerModes
from whisker_array.simulation.threads import in_threads
from whisker_array.simulation.traces import SampleFlag, Traces
from whisker_array.whisker.sections import WhiskerError

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
        contact_mm_per_n: compliance of ball and plate, see `dynamic_modes.contact_mm_per_n`.
        steps_a_period: time steps in the shortest period.

    Raises:
        WhiskerError: preload, step, speed or contact not positive.
    """
    require_positive(WhiskerError, preload_mm=preload_mm, contact_mm_per_n=contact_mm_per_n)
    require_positive(WhiskerError, step_mm=step_mm, speed_mm_s=speed_mm_s)
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
