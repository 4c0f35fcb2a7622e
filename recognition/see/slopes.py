"""Slopes of a surface from photographs under several lights at unknown positions, as one more view.

    n lights --divide by local brightness, subtract mean--> changes --two main components--> slopes --size--> view

A flat plate is equally bright under every light; a flank is bright under one and dark under another. The logarithm of
brightness changes from light to light about linearly with the two slopes, so two components contain nearly all of the
change. As the lamps' positions are unknown, these are the slopes turned and stretched. But flat ground stays flat, so
their size shows the flanks, drawn dark. Stains are equally dark under all lights and drop out; glints are clipped.
Sources: R. Woodham, Opt. Eng. 19 (1980) 139; H. Hayakawa, JOSA A 11 (1994) 3079 (lights that are not known).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
LEAST_LIGHTS = 4
_DARK, _CUT = 0.02, (0.1, 3.0)
"""Brightness added before the ratio; ratios to the local brightness at which shadows and glints are clipped."""
_FOCUS, _FULL_PERCENT = 1.0, 99.0
"""Blur, pixels; percentile of the size of slopes that is drawn black."""


def slope_picture(
    photographs: Sequence[Floats], *, near: float = 1 / 50, least_share: float = 0.75
) -> Floats | None:
    """Picture of the slopes, dark on light, (rows, cols) 0 to 1; None for too few photographs or only one light.

    Local brightness is blurred by `near` of the longer side. If the light changed, two components hold `least_share` of
    all changes; of noise they hold 2 / (n - 1).
    """
    from glyphs.opencv import cv2

    if len(photographs) < LEAST_LIGHTS:
        return None
    shape = photographs[0].shape
    reach = near * max(shape)
    ratios = [
        cv2.GaussianBlur(photograph, (0, 0), _FOCUS) / (cv2.GaussianBlur(photograph, (0, 0), reach) + _DARK)
        for photograph in photographs
    ]
    changes = np.log(np.clip(np.stack(ratios).reshape(len(ratios), -1), *_CUT))
    changes -= changes.mean(axis=0)
    power, directions = np.linalg.eigh(changes @ changes.T)
    share = float(power[-2:].sum() / max(float(power.sum()), 1e-12))
    if share < least_share or power[-2] <= 0.0 or _is_exposure(photographs, power, directions[:, -1]):
        return None
    slopes = directions[:, -2:].T @ changes
    slopes /= slopes.std(axis=1, keepdims=True)
    size = np.hypot(*slopes).reshape(shape)
    full = max(float(np.percentile(size, _FULL_PERCENT)), 1e-6)
    return np.asarray(1.0 - np.clip(size / full, 0.0, 1.0), dtype=np.float32)


def _is_exposure(
    photographs: Sequence[Floats],
    power: Floats,
    first: Floats,
    *,
    # for exposures under one lamp, greatest ratio of the second change's power to the first's. Simulated
    # parts have 0.02 to 0.2, under different lights 0.6 to 0.9, but 0.1 if all grooves run one way.
    one_change: float = 0.4,
    exposed: float = 0.15,  # least spread of log brightness
    # least correlation of the first change with log brightness: 0.94 to 1.00, for those grooves 0.07
    along: float = 0.9,
) -> bool:
    """Whether nearly all differences come from one change that follows the brightness of the photographs."""
    gains = np.log([float(photograph.mean()) + _DARK for photograph in photographs])
    if power[-2] > one_change * power[-1] or gains.std() < exposed:
        return False
    return abs(float(np.corrcoef(first, gains)[0, 1])) > along
