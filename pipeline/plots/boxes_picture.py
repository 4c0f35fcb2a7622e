"""A picture with the boxes of its characters, for clients that cannot overlay them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pipeline.common.reading_records import ReadingRecord

_ORANGE_BGR, _WHITE_BGR = (46, 87, 228), (255, 255, 255)


def boxes_picture(path: Path, meta: Mapping[str, float], reading: ReadingRecord) -> bytes:
    """Draw each character's box and the character read there, as PNG, on a picture made by the service; `meta` holds
    x0_mm, y0_mm of the middle of its pixel (0, 0), and mm_per_pixel."""
    import numpy as np

    from glyphs.opencv import cv2

    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise RuntimeError(f"the service's own picture {path.name} cannot be read")
    thick = max(1, image.shape[1] // 600)
    for character in reading.characters:
        corners_mm = np.reshape(character.box, (2, 2)) - (meta["x0_mm"], meta["y0_mm"])
        first, last = np.rint(np.clip(corners_mm / meta["mm_per_pixel"], -1e6, 1e6)).astype(int).tolist()
        cv2.rectangle(image, first, last, _ORANGE_BGR, thick, cv2.LINE_AA)
        corner, font = (first[0] + thick, first[1] - 3 * thick), cv2.FONT_HERSHEY_SIMPLEX
        for colour, width in ((_WHITE_BGR, 4 * thick), (_ORANGE_BGR, 2 * thick)):
            cv2.putText(image, character.char, corner, font, 0.9 * thick, colour, width, cv2.LINE_AA)
    done, encoded = cv2.imencode(".png", image)
    if not done:
        raise RuntimeError("the picture could not be encoded")
    return bytes(encoded)
