r"""The contact fidelity: rate-independent frictional contact of tip and surface, in three dimensions.

At every sample the base advances by dx. The tip q = (x, z) on the dilated surface h minimises

    1/2 d^T K d + mu f_n |q - q_prev|_G,     d = (x - x_free, h(x, z) + d0, z - z_free),   K = D11^-1,

G = (1 + p^2, pq; pq, 1 + q^2) the surface metric and f_n the normal force of the last iterate::

       base ->  ________________ l1
                                |l2        d: from the force-free tip (o) to the tip on the surface (x)
      land _____                x _______  The elastic force K d, projected on the surface, balances friction;
                \______________/o d0       sideways the wire may give, which the pointwise map cannot know.

Where the wall's friction leaves the tip no way to rise, e_y.D11 (n - mu t) <= 0, it *jams*. Mostly it does not
come so far but is caught at the wall's foot, where the slope is just short of that: then it is held there, the base
walks on and the force grows without end, so a force many times the land's is a jam as well. Where the normal
force vanishes, contact is *lost*. All are flags of the sample.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from whisker_array.surface import TouchSurface
from whisker_array.traces import SampleFlag, Traces
from whisker_array.whisker import TipModel

_LOST = np.uint8(SampleFlag.CONTACT_LOST)
_JAMMED = np.uint8(SampleFlag.JAMMED)
_OUTSIDE = np.uint8(SampleFlag.OUTSIDE)
_NOT_CONVERGED = np.uint8(SampleFlag.NOT_CONVERGED)

MAX_ITERATIONS = 80
TOLERANCE_STEPS = 5e-4
"""Newton stops when the tip moves less than this fraction of a sample step."""
JAM_FORCE = 10.0
"""A tip pushed so many times harder than lifting it straight up takes is jammed: 60 degree walls need up to 5."""
SMOOTHING_STEPS = 1e-3
"""|q - q_prev| is rounded at this fraction of a step: a stick-slip corner the solver can pass."""


@njit(cache=True, fastmath=True, inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _look_up(fields, x, z, inv_pitch):  # type: ignore[no-untyped-def]
    """Height, both slopes and friction at (x, z), bilinear, clamped at the rim."""
    rows, cols = fields.shape[0], fields.shape[1]
    u = min(max(x * inv_pitch, 0.0), cols - 1.001)
    v = min(max(z * inv_pitch, 0.0), rows - 1.001)
    c, r = int(u), int(v)
    fu, fv = u - c, v - r
    w00, w01 = (1.0 - fu) * (1.0 - fv), fu * (1.0 - fv)
    w10, w11 = (1.0 - fu) * fv, fu * fv
    a, b = fields[r, c], fields[r, c + 1]
    e, g = fields[r + 1, c], fields[r + 1, c + 1]
    return (
        w00 * a[0] + w01 * b[0] + w10 * e[0] + w11 * g[0],
        w00 * a[1] + w01 * b[1] + w10 * e[1] + w11 * g[1],
        w00 * a[2] + w01 * b[2] + w10 * e[2] + w11 * g[2],
        w00 * a[3] + w01 * b[3] + w10 * e[3] + w11 * g[3],
    )


@njit(cache=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _trace_line(fields, pitch, z_free, start, step, lag, d0, K, D, arm, moment, flags):  # type: ignore[no-untyped-def]
    """One whisker's line; the state (previous tip) lives here, so that lines run in parallel."""
    inv_pitch = 1.0 / pitch
    cols = fields.shape[1]
    k00, k01, k02 = K[0, 0], K[0, 1], K[0, 2]
    k11, k12, k22 = K[1, 1], K[1, 2], K[2, 2]
    eps2 = (SMOOTHING_STEPS * step) ** 2
    tol2 = (TOLERANCE_STEPS * step) ** 2
    limit = 0.5 * max(pitch, step)
    xp, zp = start - step, z_free
    for j in range(moment.size):
        x_command = start + j * step
        x_free = x_command - lag
        x, z = xp + step, zp
        converged = False
        damping, mx_last, mz_last, size2_last = 1.0, 0.0, 0.0, 0.0
        f0 = f1 = f2 = h = p = q = mu = sx = sz = length = 0.0
        for _ in range(MAX_ITERATIONS):
            h, p, q, mu = _look_up(fields, x, z, inv_pitch)
            d0x, d1, d2 = x - x_free, h + d0, z - z_free
            f0 = k00 * d0x + k01 * d1 + k02 * d2
            f1 = k01 * d0x + k11 * d1 + k12 * d2
            f2 = k02 * d0x + k12 * d1 + k22 * d2
            # K J, J = d(d)/d(x, z): what the Hessian J^T K J needs of it
            a0, a1 = k00 + k01 * p, k01 + k11 * p
            b0, b1, b2 = k02 + k01 * q, k12 + k11 * q, k22 + k12 * q
            inv_norm = 1.0 / math.sqrt(1.0 + p * p + q * q)
            push = mu * max((f1 - p * f0 - q * f2) * inv_norm, 0.0)
            dx, dz = x - xp, z - zp
            slide = p * dx + q * dz
            sx, sz = dx + p * slide, dz + q * slide
            length = math.sqrt(dx * sx + dz * sz + eps2)
            inv_len = 1.0 / length
            ux, uz = sx * inv_len, sz * inv_len
            rx = f0 + p * f1 + push * ux
            rz = f2 + q * f1 + push * uz
            w = push * inv_len
            hxx = a0 + p * a1 + w * (1.0 + p * p - ux * ux)
            hxz = b0 + p * b1 + w * (p * q - ux * uz)
            hzz = b2 + q * b1 + w * (1.0 + q * q - uz * uz)
            det = hxx * hzz - hxz * hxz
            mx = -(hzz * rx - hxz * rz) / det
            mz = -(hxx * rz - hxz * rx) / det
            size2 = mx * mx + mz * mz
            # In a valley the slope turns under the tip, which J^T K J knows nothing of: Newton steps to and fro.
            if mx * mx_last + mz * mz_last < -0.25 * size2_last:
                damping *= 0.5
            else:
                damping = min(1.0, 1.3 * damping)
            mx_last, mz_last, size2_last = mx, mz, size2
            scale = damping
            if size2 * scale * scale > limit * limit:
                scale = limit / math.sqrt(size2)
            x, z = x + scale * mx, z + scale * mz
            if size2 < tol2:
                converged = True
                break
        flag = np.uint8(0)
        if not converged:
            flag |= _NOT_CONVERGED
        if x_command < 0.0 or x_command > (cols - 1) * pitch:
            flag |= _OUTSIDE
        if f1 - p * f0 - q * f2 <= 0.0:
            flag |= _LOST
        # unit sliding direction in space: t = J (dx, dz) / |.|
        inv_len = 1.0 / length
        tx, tz = (x - xp) * inv_len, (z - zp) * inv_len
        ty = p * tx + q * tz
        inv_norm = 1.0 / math.sqrt(1.0 + p * p + q * q)
        rise = (
            D[1, 0] * (-p * inv_norm - mu * tx)
            + D[1, 1] * (inv_norm - mu * ty)
            + D[1, 2] * (-q * inv_norm - mu * tz)
        )
        push_limit = JAM_FORCE * (d0 + max(h, 0.0)) / D[1, 1]
        if rise <= 0.0 or f0 * f0 + f1 * f1 + f2 * f2 > push_limit * push_limit:
            flag |= _JAMMED
        if flag & _LOST:
            # the tip hangs free until the surface meets it again
            x, z = x_free, z_free
        bad = flag & (_LOST | _JAMMED)
        moment[j] = 0.0 if bad else arm[0] * f0 + arm[1] * f1 + arm[2] * f2
        flags[j] = flag
        xp, zp = x, z


@njit(parallel=True, cache=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _trace_lines(fields, pitch, lines, start, step, lag, d0, K, D, arm, moment, flags):  # type: ignore[no-untyped-def]
    for i in prange(lines.size):
        _trace_line(fields, pitch, lines[i], start, step, lag, d0, K, D, arm, moment[i], flags[i])


def land_lag_mm(tip: TipModel, *, preload_mm: float, friction: float) -> float:
    """How far the tip is displaced along x on flat land, e_x.D11 f with e_y.D11 f = d0; negative: behind.

    A stage is set up with the tip, not the base, over the commanded place, so traces are labelled by the
    commanded position and this displacement is taken off, at the nominal friction.
    """
    force = np.array([-friction, 1.0, 0.0])
    shift = tip.compliance_mm_per_n @ force
    return float(preload_mm * shift[0] / shift[1])


def trace_contact(
    surface: TouchSurface,
    tip: TipModel,
    *,
    lines_mm: NDArray[np.float64],
    start_mm: float,
    step_mm: float,
    n_samples: int,
    preload_mm: float,
    nominal_friction: float,
) -> Traces:
    """Trace parallel lines over an oriented surface (see `surface.orient`), each whisker from rest.

    Args:
        surface: in the trace frame: columns run along the trace.
        tip: compliance and moment arm of the whisker.
        lines_mm: (lines,) lateral coordinate of each trace, mm.
        start_mm: commanded position of the first sample along the trace, mm.
        step_mm: distance of samples, mm.
        n_samples: samples a line.
        preload_mm: d0, mm.
        nominal_friction: friction at which the stage was set up (for the lag on the land).

    Raises:
        ValueError: preload or step not positive.
    """
    if not (preload_mm > 0.0 and math.isfinite(preload_mm)):
        raise ValueError(f"preload_mm is {preload_mm}; the whisker must be pressed on: give a positive depth")
    if not (step_mm > 0.0 and math.isfinite(step_mm)):
        raise ValueError(f"step_mm is {step_mm}; it must be positive")
    lines = np.ascontiguousarray(lines_mm, dtype=np.float64)
    moment = np.empty((lines.size, n_samples), dtype=np.float32)
    flags = np.empty((lines.size, n_samples), dtype=np.uint8)
    lag = land_lag_mm(tip, preload_mm=preload_mm, friction=nominal_friction)
    _trace_lines(
        surface.fields, surface.pitch_mm, lines, float(start_mm), float(step_mm), lag, float(preload_mm),
        np.ascontiguousarray(tip.stiffness_n_per_mm), np.ascontiguousarray(tip.compliance_mm_per_n),
        np.ascontiguousarray(tip.moment_arm_mm), moment, flags,
    )  # fmt: skip
    return Traces(moment_n_mm=moment, flags=flags)
