"""The pose of one character on a felt surface: position, rotation, size and depth, by robust least squares.

    felt depth                 predicted depth, moved, turned, sized        what is left
    .. 0 8 9 9 7 0 ..    -     ..  0 9 9 9 9 0 ..  x depth + a plane   =    noise, or dirt

A sample is either as predicted, with noise, or it has no information, because of dirt or a scratch: a missing stroke
counts against a character only up to a limit. The logarithm of this mixture's likelihood compares characters.

A pose is a vector of nine numbers:

    RIGHT, DOWN       distance from the middle of the place, character heights
    TURN              radians, from right to down
    WIDE, TALL, DEEP  logarithms of factors
    LEVEL and slopes  of the land, in usual depths, and per character height to the right and down
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Glyph = NDArray[np.float32]
"""(rows, columns, 3) image of a predicted character, with its middle in the middle pixel: relative depth, and its
gradient to the right and down, per character height."""
PIXELS = 24
"""Pixels per character height."""
RIGHT, DOWN, TURN, WIDE, TALL, DEEP, LEVEL = range(7)
NUMBERS = 9


def points_at(pose: Floats, points: Floats) -> Floats:
    """(n, 2) points of a character in a pose, from its reference point, about the middle of a place."""
    cos, sin = math.cos(pose[TURN]), math.sin(pose[TURN])
    turned = points * np.exp(pose[[WIDE, TALL]]) @ np.array([[cos, sin], [-sin, cos]])
    return np.asarray(turned + pose[[RIGHT, DOWN]])


def spread_of_poses(
    *,
    right: float,
    down: float,
    turn_deg: float,
    deep: float,
    wide: float = 0.06,
    tall: float = 0.05,
    land: float = 0.5,
) -> Floats:
    """Standard deviations of poses about the expected one, each in its own unit except the turn."""
    return np.array([right, down, math.radians(turn_deg), wide, tall, deep, land, land, land])


@dataclass(frozen=True, eq=False)
class PlaceSamples:
    """The depths that were felt around a place; noise and dirt are wider than a pixel, so `alike` count as one."""

    right: Floats
    down: Floats
    felt: Floats
    usual: float
    missed: float = 0.15
    span: float = 6.0
    alike: float = 9.0

    def predict(self, glyph: Glyph, pose: Floats) -> Floats:
        """(n, channels) values of a character in a pose at the samples."""
        from glyphs.opencv import cv2

        rows, columns = glyph.shape[:2]
        along, across = self._inside(pose)
        x, y = along * PIXELS + columns // 2, across * PIXELS + rows // 2
        seen = cv2.remap(glyph, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        return np.asarray(seen.reshape(self.felt.size, -1), dtype=np.float64)

    def _inside(self, pose: Floats) -> tuple[Floats, Floats]:
        right, down = self.right - pose[RIGHT], self.down - pose[DOWN]
        cos, sin = math.cos(pose[TURN]), math.sin(pose[TURN])
        along, across = cos * right + sin * down, cos * down - sin * right
        return along * math.exp(-pose[WIDE]), across * math.exp(-pose[TALL])

    def correlation(self, glyph: Glyph, pose: Floats) -> float:
        """Correlation of the felt depths, clipped near the usual one, with those of a character in a pose."""
        want = self.predict(glyph[..., :1], pose)[:, 0]
        felt = np.clip(self.felt / self.usual, -0.5, 1.3)
        want, felt = want - want.mean(), felt - felt.mean()
        return float(want @ felt / math.sqrt((want @ want) * (felt @ felt) + 1e-9))

    def residuals(self, glyph: Glyph, pose: Floats) -> Floats:
        """(n,) predicted minus felt depth, in units of noise."""
        depth = math.exp(pose[DEEP]) * self.predict(glyph[..., :1], pose)[:, 0]
        land = pose[LEVEL] + pose[LEVEL + 1] * self.right + pose[LEVEL + 2] * self.down
        return np.asarray(self.usual * (depth + land) - self.felt)

    def slopes(self, glyph: Glyph, pose: Floats) -> Floats:
        depth, on, down = self.usual * math.exp(pose[DEEP]) * self.predict(glyph, pose).T
        along, across = self._inside(pose)
        cos, sin = math.cos(pose[TURN]), math.sin(pose[TURN])
        wide, tall = math.exp(-pose[WIDE]), math.exp(-pose[TALL])
        land = self.usual * np.ones_like(depth)
        return np.stack(
            [
                -on * cos * wide + down * sin * tall,
                -on * sin * wide - down * cos * tall,
                on * across / tall * wide - down * along / wide * tall,
                -on * along,
                -down * across,
                depth,
                land,
                land * self.right,
                land * self.down,
            ],
            axis=1,
        )

    def loss(self, squares: Floats) -> Floats:
        """(3, n) twice the negative log likelihood of squared residuals, and its derivatives by them."""
        outside = self.missed / (self.span * self.usual) * math.sqrt(2.0 * math.pi)
        inside = (1.0 - self.missed) * np.exp(-0.5 * squares)
        share = inside / (inside + outside)
        return np.stack([-2.0 * np.log(inside + outside), share, -0.5 * share * (1.0 - share)]) / self.alike

    def fit(
        self, glyph: Glyph, about: Floats, spread: Floats, start: Floats, *, most_steps: int = 12
    ) -> tuple[float, Floats]:
        from scipy.optimize import least_squares

        n = self.felt.size

        def residuals(pose: Floats) -> Floats:
            return np.concatenate([self.residuals(glyph, pose), (pose - about) / spread])

        def slopes(pose: Floats) -> Floats:
            return np.concatenate([self.slopes(glyph, pose), np.diag(1.0 / spread)])

        def loss(squares: Floats) -> Floats:
            expected = squares[n:]
            plain = np.stack([expected, np.ones_like(expected), np.zeros_like(expected)])
            return np.concatenate([self.loss(squares[:n]), plain], axis=1)

        fitted = least_squares(
            residuals,
            start,
            slopes,
            loss=loss,
            x_scale=spread,
            max_nfev=most_steps,
            xtol=1e-3,
            ftol=3e-3,
            gtol=1e-3,
        )
        return -float(fitted.cost), np.asarray(fitted.x)
