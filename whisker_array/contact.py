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

Dirt that yields (`soft`) puts h in between its top and what lies below, by the load it carries: kappa s = f_n. The
sinkage s is a third unknown of the same iteration: on slopes f_n at a place held fixed changes with s many times
faster than e says, or the wrong way, so no step for s alone settles. The track's slopes take load and e of the last
sample.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from whisker_array.soft import LEAST_GIVE
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


@njit(cache=True, fastmath=True, inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _sink(h, p, q, top, give, last, load, pitch):  # type: ignore[no-untyped-def]
    """Height and slopes of the track between bottom (h, p, q) and top, the thickness, and which part is the track's.

    `last` is the load of the last sample: slopes that turned with the load would make the tip hunt at the bottom.
    """
    h_top, p_top, q_top, kappa, kappa_x, kappa_z = top
    thickness = max(h_top - h, 0.0)
    sinkage = min(load / kappa, thickness)
    free = last / kappa
    # sinkage / load, bounded where the dirt is pushed through however soft it is
    bend = min(free, thickness) * min(1.0 / kappa, thickness / max(last, 1e-12))
    share = kappa * give / (1.0 + kappa * give)
    p_track = share * (p_top + bend * kappa_x)
    q_track = share * (q_top + bend * kappa_z)
    # where the track meets the bottom slopes turn over two samples, as differences on the grid do; but not where
    # next to nothing sinks in: the slopes of the top have met the bottom already
    apart = max(math.hypot(p_track - p, q_track - q) * pitch, 1e-9)
    part = 0.5 + 0.5 * (thickness - free + max(apart - free, 0.0)) / apart
    part = min(max(part, 0.0), 1.0)
    return h + thickness - sinkage, p + part * (p_track - p), q + part * (q_track - q), thickness, part


@njit(cache=True, fastmath=True, inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _sinking_step(K, track, top, kappa, friction, rest, turning):  # type: ignore[no-untyped-def]
    """Newton's step in x, z and sinkage s: both balances along the track, and kappa s = f_n, by Cramer's rule."""
    p, q, inv_norm = track
    ux, uz = friction
    # change of the force, in components and along the normal, by x, z and s
    x0, x1, x2 = K[0, 0] + K[0, 1] * top[0], K[0, 1] + K[1, 1] * top[0], K[0, 2] + K[1, 2] * top[0]
    z0, z1, z2 = K[0, 2] + K[0, 1] * top[1], K[1, 2] + K[1, 1] * top[1], K[2, 2] + K[1, 2] * top[1]
    nx, nz = (x1 - p * x0 - q * x2) * inv_norm, (z1 - p * z0 - q * z2) * inv_norm
    y0, y1, y2 = -top[2] * K[0, 1], -top[2] * K[1, 1], -top[2] * K[1, 2]
    ns = (y1 - p * y0 - q * y2) * inv_norm
    a, b, c = x0 + p * x1 + ux * nx + turning[0], z0 + p * z1 + ux * nz + turning[1], y0 + p * y1 + ux * ns
    d, e, f = x2 + q * x1 + uz * nx + turning[1], z2 + q * z1 + uz * nz + turning[2], y2 + q * y1 + uz * ns
    g, h, i = kappa[1] - nx, kappa[2] - nz, kappa[0] - ns
    u, v, w = rest
    det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    det = det if abs(det) > 1e-30 else 1e-30  # a huge step is cut, a NaN would stay
    step_x = u * (e * i - f * h) - b * (v * i - f * w) + c * (v * h - e * w)
    step_z = a * (v * i - f * w) - u * (d * i - f * g) + c * (d * w - v * g)
    step_s = a * (e * w - v * h) - b * (d * w - v * g) + u * (d * h - e * g)
    return -step_x / det, -step_z / det, -step_s / det


@njit(cache=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _trace_line(fields, top, pitch, z_free, start, step, lag, d0, K, D, arm, moment, flags):  # type: ignore[no-untyped-def]
    """One whisker's line; the state (previous tip) lives here, so that lines run in parallel.

    `top` is None without yielding dirt: numba then leaves out all that concerns it as it compiles.
    """
    inv_pitch = 1.0 / pitch
    cols = fields.shape[1]
    k00, k01, k02 = K[0, 0], K[0, 1], K[0, 2]
    k11, k12, k22 = K[1, 1], K[1, 2], K[2, 2]
    eps2 = (SMOOTHING_STEPS * step) ** 2
    tol2 = (TOLERANCE_STEPS * step) ** 2
    limit = 0.5 * max(pitch, step)
    xp, zp = start - step, z_free
    if top is not None:
        give, load = D[1, 1], d0 / D[1, 1]
    for j in range(moment.size):
        x_command = start + j * step
        x_free = x_command - lag
        x, z = xp + step, zp
        converged = False
        if top is not None:
            give_last, load_last = give, load
        damping, mx_last, mz_last, size2_last = 1.0, 0.0, 0.0, 0.0
        f0 = f1 = f2 = h = p = q = mu = sx = sz = length = 0.0
        for _ in range(MAX_ITERATIONS):
            h, p, q, mu = _look_up(fields, x, z, inv_pitch)
            if top is not None:
                kappa, kappa_x, kappa_z, near = _look_up(top[:, :, 3:], x, z, inv_pitch)
                if near > 0.0:
                    h_top, p_top, q_top, _ = _look_up(top, x, z, inv_pitch)
                    above, p_bottom, q_bottom = (h_top, p_top, q_top, kappa, kappa_x, kappa_z), p, q
                    h, p, q, thickness, part = _sink(h, p, q, above, give_last, load_last, load, pitch)
            d0x, d1, d2 = x - x_free, h + d0, z - z_free
            f0 = k00 * d0x + k01 * d1 + k02 * d2
            f1 = k01 * d0x + k11 * d1 + k12 * d2
            f2 = k02 * d0x + k12 * d1 + k22 * d2
            # K J, J = d(d)/d(x, z): what the Hessian J^T K J needs of it
            a0, a1 = k00 + k01 * p, k01 + k11 * p
            b0, b1, b2 = k02 + k01 * q, k12 + k11 * q, k22 + k12 * q
            inv_norm = 1.0 / math.sqrt(1.0 + p * p + q * q)
            f_n = max((f1 - p * f0 - q * f2) * inv_norm, 0.0)
            push = mu * f_n
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
            if top is not None:
                tx, tz = dx * inv_len, dz * inv_len
                give = (
                    D[1, 0] * (-p * inv_norm - mu * tx)
                    + D[1, 1] * (inv_norm - mu * (p * tx + q * tz))
                    + D[1, 2] * (-q * inv_norm - mu * tz)
                )
                give = max(give, LEAST_GIVE * D[1, 1])
                if near > 0.0:
                    bend = min(load / kappa, thickness)
                    mx, mz, deeper = _sinking_step(
                        K, (p, q, inv_norm),
                        (p_bottom + part * (p_top - p_bottom), q_bottom + part * (q_top - q_bottom), part),
                        (kappa, bend * kappa_x, bend * kappa_z), (mu * ux, mu * uz), (rx, rz, load - f_n),
                        (w * (1.0 + p * p - ux * ux), w * (p * q - ux * uz), w * (1.0 + q * q - uz * uz)),
                    )  # fmt: skip
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
            settled = True
            if top is not None:
                if near > 0.0:
                    sinkage, before = load / kappa + scale * deeper, min(load / kappa, thickness)
                    load = max(kappa + scale * (kappa_x * mx + kappa_z * mz), 0.5 * kappa) * max(sinkage, 0.0)
                    settled = abs(min(sinkage, thickness) - before) < TOLERANCE_STEPS * step
                else:
                    load = f_n
            if size2 < tol2 and settled:
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
def _trace_lines(fields, top, pitch, lines, start, step, lag, d0, K, D, arm, moment, flags):  # type: ignore[no-untyped-def]
    for i in prange(lines.size):
        _trace_line(fields, top, pitch, lines[i], start, step, lag, d0, K, D, arm, moment[i], flags[i])


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
        surface.fields, surface.yielding, surface.pitch_mm, lines, float(start_mm), float(step_mm), lag,
        float(preload_mm),
        np.ascontiguousarray(tip.stiffness_n_per_mm), np.ascontiguousarray(tip.compliance_mm_per_n),
        np.ascontiguousarray(tip.moment_arm_mm), moment, flags,
    )  # fmt: skip
    return Traces(moment_n_mm=moment, flags=flags)
