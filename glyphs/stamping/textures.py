"""Textures that tools leave on a plate, coarser than the fine lay of `PlateVariation`. Depths and feeds are from ISO
1302 and workshop tables (Ra of rough milling and turning 3 to 6 um, coarse belts 1 to 3, blasted or cast skins 6 to
25)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import NotNegative, Positive, Share, Validated
from glyphs.stamping.errors import StampError
from glyphs.surface.noise import Field, smooth_noise

Axis = NDArray[np.float64]


class Texture(Protocol):
    """The texture of one finishing process, with a mean of about zero."""

    def __call__(self, x_mm: Axis, y_mm: Axis, *, rng: np.random.Generator) -> Field:
        """Heights (rows, cols) float32, mm, at evenly spaced x (cols,) and y (rows,); only `rng` is random."""


@dataclass(frozen=True)
class Milling(Validated, error=StampError):
    """Arcs of the teeth of a face mill, whose depth varies by the share `chatter`. Raises StampError."""

    depth_um: NotNegative = 16.0
    feed_mm: Positive = 0.35
    radius_mm: Positive = 25.0
    chatter: Share = 0.6
    chatter_mm: Positive = 1.6

    def __call__(self, x_mm: Axis, y_mm: Axis, *, rng: np.random.Generator) -> Field:
        phase = rng.uniform(0.0, 2 * math.pi, 2)
        middle = float(y_mm.mean()) + rng.uniform(-0.3, 0.3) * self.radius_mm
        dy = (y_mm - middle)[:, None]
        # the mill moves along x: an arc is the path of one tooth
        bend = np.sqrt(np.maximum(self.radius_mm**2 - dy**2, 0.01 * self.radius_mm**2))
        turn = (x_mm[None, :] - bend) / self.feed_mm
        swing = np.sin(2 * math.pi * dy / self.chatter_mm + phase[0] + 0.7 * turn + phase[1])
        return _cusps(turn, 1.0 + self.chatter * swing, self.depth_um)


@dataclass(frozen=True)
class Turning(Validated, error=StampError):
    """Grooves of a lathe's tool: parallel (`ring_radius_mm` 0), or parts of rings. Raises StampError."""

    depth_um: NotNegative = 14.0
    feed_mm: Positive = 0.25
    ring_radius_mm: NotNegative = 0.0
    unevenness: Share = 0.3

    def __call__(self, x_mm: Axis, y_mm: Axis, *, rng: np.random.Generator) -> Field:
        across = x_mm[None, :] + 0.0 * y_mm[:, None]
        if self.ring_radius_mm > 0.0:
            dy = y_mm - y_mm.mean() - self.ring_radius_mm
            across = np.hypot((x_mm - x_mm.mean())[None, :], dy[:, None])
        turn = (across - across.min()) / self.feed_mm + rng.uniform()
        each = 1.0 + self.unevenness * rng.uniform(-1.0, 1.0, int(turn.max()) + 2)
        return _cusps(turn, each[turn.astype(int)], self.depth_um)


@dataclass(frozen=True)
class Grinding(Validated, error=StampError):
    """Many fine lines of different depth and length, as a belt or a wheel leaves them. Raises StampError."""

    ra_um: NotNegative = 3.0
    line_mm: Positive = 0.06
    length_mm: Positive = 6.0
    along_x: bool = True

    def __call__(self, x_mm: Axis, y_mm: Axis, *, rng: np.random.Generator) -> Field:
        from scipy.ndimage import gaussian_filter

        pitch = float(x_mm[1] - x_mm[0])
        white = rng.standard_normal((y_mm.size, x_mm.size), dtype=np.float32)
        widths = (self.line_mm / 2 / pitch, self.length_mm / 2 / pitch)
        lines = gaussian_filter(white, widths if self.along_x else widths[::-1], mode="wrap", truncate=3.0)
        # grains cut scratches rather than raise ridges: the distribution has its longer tail on the deep side
        lines = lines / np.float32(max(float(lines.std()), 1e-12))
        return _scale_to_ra(
            np.minimum(lines, np.float32(0.8)) + np.float32(0.4) * np.minimum(lines, 0.0), self.ra_um
        )


@dataclass(frozen=True)
class Sand(Validated, error=StampError):
    """A blasted or sand-cast skin: isotropic grains, the fine ones a third of the coarse. Raises StampError."""

    ra_um: NotNegative = 9.0
    grain_mm: Positive = 0.25

    def __call__(self, x_mm: Axis, y_mm: Axis, *, rng: np.random.Generator) -> Field:
        shape, pitch = (y_mm.size, x_mm.size), float(x_mm[1] - x_mm[0])
        coarse = smooth_noise(shape, pitch_mm=pitch, length_mm=self.grain_mm, rng=rng)
        fine = smooth_noise(shape, pitch_mm=pitch, length_mm=self.grain_mm / 3, rng=rng)
        # grains press round hollows and leave sharp crests between them
        return _scale_to_ra(np.abs(coarse) ** np.float32(1.3) + np.float32(0.35) * fine, self.ra_um)


def _cusps(turn: NDArray[np.float64], share: NDArray[np.float64], depth_um: float) -> Field:
    t = 2.0 * (turn - np.floor(turn)) - 1.0
    return np.asarray(depth_um * 1e-3 * share * (t * t - 1.0 / 3.0), dtype=np.float32)


def _scale_to_ra(z: Field, ra_um: float) -> Field:
    level = z - np.float32(z.mean(dtype=np.float64))
    ra = float(np.abs(level).mean(dtype=np.float64))
    return np.asarray(level * np.float32(ra_um * 1e-3 / max(ra, 1e-12)), dtype=np.float32)
