"""A map of depths looked up at many places: along lines moved and turned, across strokes, and the plane of its land."""

from __future__ import annotations

import numpy as np
from numba import njit

LEAST_PIVOT = 1e-9
"""Of the largest element of the normal equations: below, they do not tell all three terms of a plane."""


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def bilinear(depth, row, col):  # type: ignore[no-untyped-def]
    """Depth at a place, which is moved onto the map; NaN beside what was felt."""
    rows, cols = depth.shape
    row, col = min(max(row, 0.0), rows - 1.001), min(max(col, 0.0), cols - 1.001)
    r, c = int(row), int(col)
    down, right = row - r, col - c
    upper = depth[r, c] * (1.0 - right) + depth[r, c + 1] * right
    lower = depth[r + 1, c] * (1.0 - right) + depth[r + 1, c + 1] * right
    return upper * (1.0 - down) + lower * down


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def mean_depths(depth, poses, middle, moves):  # type: ignore[no-untyped-def]
    """(poses, moves down, moves right) mean depth of (poses, n, 2) points; places not felt count as land."""
    n = poses.shape[1]
    out = np.zeros((poses.shape[0], moves.size, moves.size))
    for p in range(poses.shape[0]):
        for i in range(moves.size):
            for j in range(moves.size):
                total = 0.0
                for k in range(n):
                    row = poses[p, k, 0] + (middle[0] + moves[i])
                    value = bilinear(depth, row, poses[p, k, 1] + (middle[1] + moves[j]))
                    if np.isfinite(value):
                        total += value
                out[p, i, j] = total / n
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def across(depth, points, normals, aside, plane):  # type: ignore[no-untyped-def]
    """(aside, n) depth below a plane across a stroke at each of (n, 2) points."""
    out = np.empty((aside.size, points.shape[0]))
    for i in range(aside.size):
        for k in range(points.shape[0]):
            row, col = points[k, 0] + aside[i] * normals[k, 0], points[k, 1] + aside[i] * normals[k, 1]
            out[i, k] = bilinear(depth, row, col) - plane[0] - (row * plane[1] + col * plane[2])
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def deepest(depth, most_points):  # type: ignore[no-untyped-def]
    """(n,) depth where the stroke's middle is, looked for over neighbouring points together."""
    n = depth.shape[1]
    window = min(most_points, n)
    ahead = (window - 1) // 2
    out = np.empty(n)
    for k in range(n):
        best = -np.inf
        out[k] = depth[0, k]
        for i in range(depth.shape[0]):
            total = 0.0
            for j in range(max(0, k + ahead - window + 1), min(n, k + ahead + 1)):
                total += depth[i, j]
            if total > best:
                best, out[k] = total, depth[i, k]
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def robust_plane(level, row, col, rounds):  # type: ignore[no-untyped-def]
    """Level and slopes of samples at (row, col), by Tukey's weights, which leave out what lies off; if they tell."""
    terms, matrix = np.array([np.median(level), 0.0, 0.0]), np.empty((3, 4))
    residual, design = np.empty(level.size), np.empty(3)
    for _ in range(rounds):
        for n in range(level.size):
            residual[n] = level[n] - terms[0] - terms[1] * row[n] - terms[2] * col[n]
        spread = 1.4826 * np.median(np.abs(residual))
        if spread <= 0.0:
            break
        matrix[:] = 0.0
        for n in range(level.size):
            weight = max(1.0 - (residual[n] / (3.0 * spread)) ** 2, 0.0) ** 2
            design[0], design[1], design[2] = 1.0, row[n], col[n]
            for i in range(3):
                for j in range(3):
                    matrix[i, j] += weight * design[i] * design[j]
                matrix[i, 3] += weight * design[i] * level[n]
        least = LEAST_PIVOT * np.abs(matrix[:, :3]).max()
        for i in range(3):
            # symmetric and not negative: no rows need change places
            if not matrix[i, i] > least:
                return terms, False
            for j in range(i + 1, 3):
                matrix[j] -= matrix[i] * (matrix[j, i] / matrix[i, i])
        for i in range(2, -1, -1):
            total = matrix[i, 3]
            for j in range(i + 1, 3):
                total -= matrix[i, j] * terms[j]
            terms[i] = total / matrix[i, i]
    return terms, True
