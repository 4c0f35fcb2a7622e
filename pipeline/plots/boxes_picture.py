"""A picture with the boxes of the characters drawn in, for whoever has no page to lay them over it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pipeline.common.reading_records import ReadingRecord

_ORANGE_BGR = (46, 87, 228)
_WHITE_BGR = (255, 255, 255)


def boxes_picture(path: Path, meta: Mapping[str, float], reading: ReadingRecord) -> bytes:
    """The picture as PNG, with each character's box and what was read there.

    Args:
        path: of a picture made by the service.
        meta: x0_mm, y0_mm of the middle of its pixel (0, 0), and mm_per_pixel.
        reading: its boxes are in the picture's frame.
    """
    import numpy as np

    from glyphs.opencv import cv2

    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise RuntimeError(f"the picture {path.name} of the service's own making cannot be read")
    x0, y0, pitch = meta["x0_mm"], meta["y0_mm"], meta["mm_per_pixel"]
    thick = max(1, image.shape[1] // 600)
    for character in reading.characters:
        left, top, right, bottom = character.box
        corners = np.array([[left - x0, top - y0], [right - x0, bottom - y0]]) / pitch
        a, b = (tuple(round(v) for v in corner) for corner in np.clip(corners, -1e6, 1e6).tolist())
        cv2.rectangle(image, a, b, _ORANGE_BGR, thick, cv2.LINE_AA)
        at = (a[0] + thick, a[1] - 3 * thick)
        for colour, width in ((_WHITE_BGR, 4 * thick), (_ORANGE_BGR, 2 * thick)):
            cv2.putText(
                image,
                character.char,
                at,
                cv2.FONT_HERSHEY_SIMPLEX,
                0.9 * thick,
                colour,
                width,
                cv2.LINE_AA,
            )
    done, encoded = cv2.imencode(".png", image)
    if not done:
        raise RuntimeError("the picture could not be encoded")
    return bytes(encoded)
