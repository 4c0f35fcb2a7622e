"""What the speed of the stage adds to the moment of a slow one: the whisker rings.

                            s²/w²
    - m_land/d0 gain ------------------- h     w = 2 pi held_hz, z: damping, h: profile under the tip, d0: preload
                     1 + 2 z s/w + s²/w²

A small model of the whisker with mass (docs/pages/physics.md shows both): it has one mode of three, with the same
frequency on land and walls, and its tip does not fly.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from whisker_array.whisker.touch import Touch

BLOCK = 256
"""Lines at a time, for the memory."""


def added_at_speed(
    height_mm: NDArray[np.float32], touch: Touch, *, sample_rate_hz: float
) -> NDArray[np.float32]:
    """Moments to add, N mm, at heights (lines, samples) that are linear between samples; each line begins at rest. They
    are means over each sample, and 0 without a known ringing."""
    added, ringing = np.zeros_like(height_mm), touch.ringing
    if ringing is None:
        return added
    w, drag = 2.0 * math.pi * ringing.held_hz, 2.0 * ringing.damping
    # the integral over time of s²/w² / (1 + 2 z s/w + s²/w²), in half samples
    b, a, _ = cont2discrete(([1.0, 0.0], [1.0, drag * w, w**2]), 0.5 / sample_rate_hz, method="foh")
    share = -ringing.gain * touch.land_moment_n_mm() / touch.preload_mm * sample_rate_hz
    for first in range(0, len(height_mm), BLOCK):
        lines = np.maximum(height_mm[first : first + BLOCK], -touch.preload_mm)
        profile = np.pad(lines, ((0, 0), (1, 1)), mode="edge")
        halves = np.empty((len(lines), 2 * lines.shape[1] + 1))
        halves[:, ::2], halves[:, 1::2] = 0.5 * (profile[:, 1:] + profile[:, :-1]), lines
        whole, _ = lfilter(b.ravel(), a, halves, zi=lfilter_zi(b.ravel(), a) * halves[:, :1])
        added[first : first + BLOCK] = share * np.diff(whole[:, ::2], axis=1)
    return added
