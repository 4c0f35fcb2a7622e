"""Spots on a photograph: a glint, a drop, ink or a hole at one character, much brighter or darker than all the others.

A character that is covered so may look like one that was never stamped, often a 0, and surely so.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.language.box import Box
from recognition.see.photo_frame import photo_origin_mm, photo_pitch_mm

DARKEST_TENTH, BRIGHTEST_TENTH = 0.1, 0.9


def spots_on(
    photo: Photo, boxes: Sequence[Box], *, times: float = 3.0, least: float = 0.1, fewest: int = 3
) -> NDArray[np.bool_]:
    """(places,) whether a tenth of a place is much further from the line's middle grey than at the other places.

    `boxes` are in the photo frame, `least` is a share of white. `times` the median of the other places was 3 at most at
    46 accepted serials of 250 photographs, and 3 and more at 26 glints, blobs and rings taken for a character.
    """
    if len(boxes) < fewest:
        return np.zeros(len(boxes), dtype=np.bool_)
    grey, pitch_mm, (x_mm, y_mm) = photo.grey(), photo_pitch_mm(photo), photo_origin_mm(photo)
    cells = []
    for box in boxes:
        left, right = np.clip(np.divide((box.x0_mm - x_mm, box.x1_mm - x_mm), pitch_mm), 0, grey.shape[1] - 1)
        top, bottom = np.clip(np.divide((box.y0_mm - y_mm, box.y1_mm - y_mm), pitch_mm), 0, grey.shape[0] - 1)
        cells.append(grey[int(top) : int(bottom) + 1, int(left) : int(right) + 1].ravel())
    middle = np.median(np.concatenate(cells))
    tenths = np.array([np.quantile(cell, (DARKEST_TENTH, BRIGHTEST_TENTH)) for cell in cells])
    far = np.maximum(middle - tenths[:, 0], tenths[:, 1] - middle)
    usual = np.array([np.median(np.delete(far, place)) for place in range(far.size)])
    return np.asarray((far > times * usual) & (far > usual + least))
