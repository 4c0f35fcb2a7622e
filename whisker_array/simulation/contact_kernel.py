"""The compiled loops of `contact`: the tip's position and moment, sample by sample, several lines in parallel."""

from __future__ import annotations

import math

import numpy as np

from glyphs.compiled import FAST, inline_kernel, kernel
from whisker_array.simulation.soft import LEAST_GIVE
from whisker_array.simulation.surface import bilinear, cell_of
from whisker_array.simulation.traces import JAMMED, LOST, SampleFlag

_OUTSIDE = np.uint8(SampleFlag.OUTSIDE)
_NOT_CONVERGED = np.uint8(SampleFlag.NOT_CONVERGED)

MAX_ITERATIONS = 80
TOLERANCE_STEPS = 5e-4
"""The Newton iteration stops when the tip moves less than this fraction of a sample step."""
JAM_FORCE = 10.0
"""Force over that of lifting the tip straight up, from which the tip is jammed; 60 degree walls need up to 5."""
ABREAST = 8
"""Number of lines traced together, enough to keep a processor busy."""
SMOOTHING_STEPS = 1e-3
"""Rounding of |q - q_prev|, as a fraction of a step, which lets the solver pass stick-slip corners."""


@inline_kernel
def _look_up(fields, x, z, inv_pitch):  # type: ignore[no-untyped-def]
    cell = cell_of(fields, x * inv_pitch, z * inv_pitch)
    h, p, q = bilinear(fields, cell, 0), bilinear(fields, cell, 1), bilinear(fields, cell, 2)
    return h, p, q, bilinear(fields, cell, 3)


@inline_kernel
def _look_up_posed(fields, x, z, inv_pitch, pose):  # type: ignore[no-untyped-def]
    (o, ox, oz), (s, sx, sz), (rise, along, across), share, mu = pose
    cell = cell_of(fields, (o + ox * x + oz * z) * inv_pitch, (s + sx * x + sz * z) * inv_pitch)
    h = bilinear(fields, cell, 0) + share * bilinear(fields, cell, 3)
    p = bilinear(fields, cell, 1) + share * bilinear(fields, cell, 4)
    q = bilinear(fields, cell, 2) + share * bilinear(fields, cell, 5)
    return h + rise + along * x + across * z, ox * p + sx * q + along, oz * p + sz * q + across, mu


@inline_kernel
def _sink(h, p, q, top, give, last, load, pitch):  # type: ignore[no-untyped-def]
    """Height and slopes of the track between bottom (h, p, q) and top, thickness, weight of the track's slopes. `last`
    is the load of the last sample: slopes that changed with the present load would make the tip oscillate."""
    h_top, p_top, q_top, kappa, kappa_x, kappa_z = top
    thickness = max(h_top - h, 0.0)
    sinkage = min(load / kappa, thickness)
    free = last / kappa
    # sinkage / load, bounded where the tip reaches the bottom
    bend = min(free, thickness) * min(1.0 / kappa, thickness / max(last, 1e-12))
    share = kappa * give / (1.0 + kappa * give)
    p_track = share * (p_top + bend * kappa_x)
    q_track = share * (q_top + bend * kappa_z)
    # where the track meets the bottom, slopes change over two samples, like differences on the grid; not where there
    # is hardly any sinkage, because there the slopes of the top have already met the bottom
    apart = max(math.hypot(p_track - p, q_track - q) * pitch, 1e-9)
    part = 0.5 + 0.5 * (thickness - free + max(apart - free, 0.0)) / apart
    part = min(max(part, 0.0), 1.0)
    return h + thickness - sinkage, p + part * (p_track - p), q + part * (q_track - q), thickness, part


@inline_kernel
def _give(D, p, q, inv_norm, mu, tx, tz):  # type: ignore[no-untyped-def]
    """Rise of the tip per normal force, e_y.D11 (n - mu t), sliding along (tx, tz)."""
    x, z = -p * inv_norm - mu * tx, -q * inv_norm - mu * tz
    return D[1, 0] * x + D[1, 1] * (inv_norm - mu * (p * tx + q * tz)) + D[1, 2] * z


@inline_kernel
def _sinking_step(K, track, top, kappa, friction, balance, turning):  # type: ignore[no-untyped-def]
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
    u, v, w = balance
    det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    det = det if abs(det) > 1e-30 else 1e-30  # a huge step is clipped later, a NaN would stay
    step_x = u * (e * i - f * h) - b * (v * i - f * w) + c * (v * h - e * w)
    step_z = a * (v * i - f * w) - u * (d * i - f * g) + c * (d * w - v * g)
    step_s = a * (e * w - v * h) - b * (d * w - v * g) + u * (d * h - e * g)
    return -step_x / det, -step_z / det, -step_s / det


@kernel(allow=FAST)
def trace_abreast(fields, top, pose, pitch, z_free, start, step, lag, d0, K, D, arm, moment, flags):  # type: ignore[no-untyped-def]
    """Trace a few lines abreast, whose long chains of roots and quotients do not wait for each other; the state
    (previous tips) is local, so that blocks can run in parallel. `top` is None without soft dirt, and `pose` where the
    grid is that of the traces; numba then compiles the kernel without their code."""
    inv_pitch = 1.0 / pitch
    cols = fields.shape[1]
    k00, k01, k02 = K[0, 0], K[0, 1], K[0, 2]
    k11, k12, k22 = K[1, 1], K[1, 2], K[2, 2]
    eps2 = (SMOOTHING_STEPS * step) ** 2
    tol2 = (TOLERANCE_STEPS * step) ** 2
    limit = 0.5 * max(pitch, step)
    n = moment.shape[0]
    before, tip = np.empty((n, 2)), np.empty((n, 2))  # x and z after the last sample, and at present
    last = np.empty((n, 4))  # the last step in x and z, its square, the damping
    seen = np.empty((n, 8))  # force, height, slopes, friction and sliding length where it was last evaluated
    active = np.empty(n, dtype=np.intp)  # lines whose tip has not settled yet
    carried = np.empty((n, 4))  # give and load, now and after the last sample
    for i in range(n):
        before[i, 0], before[i, 1] = start - step, z_free[i]
        if top is not None:
            carried[i, 0], carried[i, 1] = D[1, 1], d0 / D[1, 1]
    for j in range(moment.shape[1]):
        x_command = start + j * step
        x_free = x_command - lag
        for i in range(n):
            active[i] = i
            tip[i, 0], tip[i, 1] = before[i, 0] + step, before[i, 1]
            last[i, 0], last[i, 1], last[i, 2], last[i, 3] = 0.0, 0.0, 0.0, 1.0
            if top is not None:
                carried[i, 2], carried[i, 3] = carried[i, 0], carried[i, 1]
        left = n
        for _ in range(MAX_ITERATIONS):
            still = 0
            for a in range(left):
                i = active[a]
                x, z, xp, zp = tip[i, 0], tip[i, 1], before[i, 0], before[i, 1]
                if pose is None:
                    h, p, q, mu = _look_up(fields, x, z, inv_pitch)
                else:
                    h, p, q, mu = _look_up_posed(fields, x, z, inv_pitch, pose)
                if top is not None:
                    load = carried[i, 1]
                    kappa, kappa_x, kappa_z, near = _look_up(top[:, :, 3:], x, z, inv_pitch)
                    if near > 0.0:
                        h_top, p_top, q_top, _ = _look_up(top, x, z, inv_pitch)
                        above, p_bottom, q_bottom = (h_top, p_top, q_top, kappa, kappa_x, kappa_z), p, q
                        h, p, q, thickness, part = _sink(
                            h, p, q, above, carried[i, 2], carried[i, 3], load, pitch
                        )
                d0x, d1, d2 = x - x_free, h + d0, z - z_free[i]
                f0 = k00 * d0x + k01 * d1 + k02 * d2
                f1 = k01 * d0x + k11 * d1 + k12 * d2
                f2 = k02 * d0x + k12 * d1 + k22 * d2
                # K J, J = d(d)/d(x, z), for the Hessian J^T K J
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
                seen[i, 0], seen[i, 1], seen[i, 2], seen[i, 3] = f0, f1, f2, h
                seen[i, 4], seen[i, 5], seen[i, 6], seen[i, 7] = p, q, mu, length
                if top is not None:
                    tx, tz = dx * inv_len, dz * inv_len
                    carried[i, 0] = max(_give(D, p, q, inv_norm, mu, tx, tz), LEAST_GIVE * D[1, 1])
                    if near > 0.0:
                        bend = min(load / kappa, thickness)
                        mx, mz, deeper = _sinking_step(
                            K, (p, q, inv_norm),
                            (p_bottom + part * (p_top - p_bottom), q_bottom + part * (q_top - q_bottom), part),
                            (kappa, bend * kappa_x, bend * kappa_z), (mu * ux, mu * uz), (rx, rz, load - f_n),
                            (w * (1.0 + p * p - ux * ux), w * (p * q - ux * uz), w * (1.0 + q * q - uz * uz)),
                        )  # fmt: skip
                size2 = mx * mx + mz * mz
                # In a valley the slope changes under the tip, which J^T K J ignores: Newton steps alternate.
                hunting = mx * last[i, 0] + mz * last[i, 1] < -0.25 * last[i, 2]
                damping = 0.5 * last[i, 3] if hunting else min(1.0, 1.3 * last[i, 3])
                last[i, 0], last[i, 1], last[i, 2], last[i, 3] = mx, mz, size2, damping
                scale = damping
                if size2 * scale * scale > limit * limit:
                    scale = limit / math.sqrt(size2)
                tip[i, 0], tip[i, 1] = x + scale * mx, z + scale * mz
                settled = size2 < tol2
                if top is not None:
                    if near > 0.0:
                        sinkage, sunk = load / kappa + scale * deeper, min(load / kappa, thickness)
                        stiff = max(kappa + scale * (kappa_x * mx + kappa_z * mz), 0.5 * kappa)
                        carried[i, 1] = stiff * max(sinkage, 0.0)
                        settled &= abs(min(sinkage, thickness) - sunk) < TOLERANCE_STEPS * step
                    else:
                        carried[i, 1] = f_n
                active[still] = i
                still += 0 if settled else 1
            left = still
            if left == 0:
                break
        outside = pose is None and (x_command < 0.0 or x_command > (cols - 1) * pitch)
        for i in range(n):
            flags[i, j] = _OUTSIDE if outside else np.uint8(0)
        for a in range(left):
            flags[active[a], j] |= _NOT_CONVERGED
        for i in range(n):
            f0, f1, f2, h = seen[i, 0], seen[i, 1], seen[i, 2], seen[i, 3]
            p, q, mu, length = seen[i, 4], seen[i, 5], seen[i, 6], seen[i, 7]
            x, z, xp, zp = tip[i, 0], tip[i, 1], before[i, 0], before[i, 1]
            flag = flags[i, j]
            if f1 - p * f0 - q * f2 <= 0.0:
                flag |= LOST
            # unit sliding direction in space: t = J (dx, dz) / |.|
            inv_len = 1.0 / length
            tx, tz = (x - xp) * inv_len, (z - zp) * inv_len
            inv_norm = 1.0 / math.sqrt(1.0 + p * p + q * q)
            push_limit = JAM_FORCE * (d0 + max(h, 0.0)) / D[1, 1]
            if (
                _give(D, p, q, inv_norm, mu, tx, tz) <= 0.0
                or f0 * f0 + f1 * f1 + f2 * f2 > push_limit * push_limit
            ):
                flag |= JAMMED
            if flag & LOST:
                # the tip hangs free until the surface meets it again
                x, z = x_free, z_free[i]
            bad = flag & (LOST | JAMMED)
            moment[i, j] = 0.0 if bad else arm[0] * f0 + arm[1] * f1 + arm[2] * f2
            flags[i, j] = flag
            before[i, 0], before[i, 1] = x, z
