"""Data Matrix and QR codes in a photograph: what they say and where they stand.

pixels --zxing-cpp--> Code                 decoded, its checksum right
pixels, Code --filled from around--> pixels without it: its modules are no strokes of characters

        p0 +--------+ p1
           | # ## # |          corners of a code as it is written, in the photo frame
        p3 +--------+ p2
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.language.box import Box
from recognition.views.photo_frame import photo_origin_mm, photo_pitch_mm

DOT_GAPS, DOTS_AT = (5, 9), 1_000_000
"""Pixels over which dots grow together, in a photograph of so many pixels at most. Of drawn codes, 4 to 10 pixels a
module, all of dots from 0.6 of that across are decoded so, dark or bright; of 0.7 and less none without."""
_PICTURES = {k: chr(0x2400 + k) for k in range(0x20)} | {0x2420: " "}


@dataclass(frozen=True)
class Code:
    """A code that was decoded.

    Attributes:
        kind: "Data Matrix" or "QR Code".
        text: what it says: of GS1 codes with identifiers in brackets, control characters as their pictures (␝).
        corners: x, y of all four in the photo frame, mm; of a photograph of unknown scale its pixels as taken; empty
            where another frame is spoken of.
    """

    kind: str
    text: str
    corners: tuple[tuple[float, float], ...] = ()

    def __repr__(self) -> str:
        return f"Code({self.kind!r}, {self.text[:80]!r}, {self.box})"

    @property
    def box(self) -> Box | None:
        """Axis-parallel hull; None where its place is not known."""
        if not self.corners:
            return None
        x, y = zip(*self.corners, strict=True)
        return Box(min(x), min(y), max(x), max(y))


def codes_of(photo: Photo) -> tuple[Code, ...]:
    """The codes of a photograph, as they stand in the first of several that shows them; each text once.

    Several are looked at one after the other until one shows a code: another light may.
    """
    for one in (photo, *photo.others):
        found = next((codes for look in _looks(one) if (codes := _decode(*look, photo))), ())
        if found:
            return found
    return ()


def _looks(photo: Photo) -> Iterator[tuple[NDArray[Any], bool]]:
    """A photograph's grey values as they are, then with dots grown together: those of a peened code do not touch.

    With each, whether a code may be bright on dark there; one of bright dots is turned to dark ones.
    """
    from glyphs.opencv import cv2

    pixels = photo.eight_bit
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY) if pixels.ndim == 3 else np.array(pixels)
    yield grey, True
    scale = (DOTS_AT / grey.size) ** 0.5
    if scale < 1.0:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    for dark_dots in (grey, 255 - grey):
        for size in DOT_GAPS:
            yield cv2.morphologyEx(dark_dots, cv2.MORPH_OPEN, np.ones((size, size), dtype=np.uint8)), False


def _decode(grey: NDArray[Any], either_way: bool, frame: Photo) -> tuple[Code, ...]:
    import zxingcpp

    kinds = (
        zxingcpp.BarcodeFormat.DataMatrix,
        zxingcpp.BarcodeFormat.QRCode,
        zxingcpp.BarcodeFormat.MicroQRCode,
    )
    found = zxingcpp.read_barcodes(grey, formats=zxingcpp.BarcodeFormats(kinds), try_invert=either_way)
    pitch_mm, (x0, y0) = photo_pitch_mm(frame) * frame.shape[1] / grey.shape[1], photo_origin_mm(frame)
    codes: dict[str, Code] = {}
    for one in found:
        at = one.position
        points = (at.top_left, at.top_right, at.bottom_right, at.bottom_left)
        corners = tuple((x0 + p.x * pitch_mm, y0 + p.y * pitch_mm) for p in points)
        text = one.text.translate(_PICTURES)
        if text:
            codes.setdefault(text, Code(str(one.format), text, corners))
    return tuple(codes.values())


def without_codes(
    photo: Photo, codes: Sequence[Code], *, quiet: float = 0.06, fill_radius: float = 4.0
) -> Photo:
    """The photograph and its others with the land drawn over the codes; itself without any.

    Args:
        photo: at any size, in the frame that the codes stand in.
        codes: decoded.
        quiet: margin filled around a code, as a share of its size: the blurred rim of its modules.
        fill_radius: pixels that a filled one is made from.
    """
    if not codes:
        return photo
    from glyphs.opencv import cv2

    mask = np.zeros(photo.shape, dtype=np.uint8)
    pitch_mm, origin_mm = photo_pitch_mm(photo), np.array(photo_origin_mm(photo))
    for code in codes:
        corners = np.array(code.corners)
        middle = corners.mean(axis=0)
        wider = middle + (1.0 + 2.0 * quiet) * (corners - middle)
        cv2.fillConvexPoly(mask, np.rint((wider - origin_mm) / pitch_mm).astype(np.int32), 255)

    def filled(one: Photo) -> Photo:
        pixels = np.atleast_3d(one.pixels)
        # of 16 bit OpenCV fills one channel at a time
        layers = [
            cv2.inpaint(np.array(pixels[..., k]), mask, fill_radius, cv2.INPAINT_TELEA)
            for k in range(pixels.shape[2])
        ]
        made: Any = np.stack(layers, axis=-1).reshape(one.pixels.shape).astype(one.pixels.dtype)
        return replace(one, pixels=made, others=tuple(map(filled, one.others)))

    return filled(photo)
