"""Data Matrix and QR codes in a photograph: text and position.

pixels --zxing-cpp--> Code                        decoded, with a correct checksum
pixels, Code --inpainting--> pixels without it    a code's modules must not look like strokes

        p0 +--------+ p1
           | # ## # |          corners of a code in its reading direction, in the photo frame
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
from recognition.see.photo_frame import photo_origin_mm, photo_pitch_mm

DOT_GAPS = (5, 9)
"""Gaps over which dots are joined, px. All simulated codes of 4 to 10 pixels per module are then decoded, with dots of
0.6 of a module and more, dark or bright. Without joining, none with dots of 0.7 or less is."""
DOTS_AT = 1_000_000
"""Most pixels of a photograph in which dots are joined; a larger one is shrunk first."""
_PICTURES = {k: chr(0x2400 + k) for k in range(0x20)} | {0x2420: " "}


@dataclass(frozen=True)
class Code:
    """A decoded code; in its text, GS1 identifiers are in brackets, control characters are shown as pictures (␝).

    `corners` are x, y of all four in the photo frame, mm (pixels of the original photograph if its scale is unknown);
    empty if they are not known in the frame of the reading.
    """

    kind: str
    text: str
    corners: tuple[tuple[float, float], ...] = ()

    def __repr__(self) -> str:
        return f"Code({self.kind!r}, {self.text[:80]!r}, {self.box})"

    @property
    def box(self) -> Box | None:
        """Axis-parallel hull; None if its position is unknown."""
        if not self.corners:
            return None
        x, y = zip(*self.corners, strict=True)
        return Box(min(x), min(y), max(x), max(y))


def codes_of(photo: Photo) -> tuple[Code, ...]:
    """Decode the codes of a photograph, each text once; of several, those are tried until one shows a code."""
    for picture in (photo, *photo.others):
        decoded = next((codes for variant in _variants(picture) if (codes := _decode(*variant, photo))), ())
        if decoded:
            return decoded
    return ()


def _variants(photo: Photo) -> Iterator[tuple[NDArray[Any], bool]]:
    """Grey values unchanged, then with the dots of peened codes joined; each with whether to try it inverted too."""
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


def _decode(grey: NDArray[Any], try_inverted: bool, frame: Photo) -> tuple[Code, ...]:
    import zxingcpp

    kinds = (
        zxingcpp.BarcodeFormat.DataMatrix,
        zxingcpp.BarcodeFormat.QRCode,
        zxingcpp.BarcodeFormat.MicroQRCode,
    )
    barcodes = zxingcpp.read_barcodes(grey, formats=zxingcpp.BarcodeFormats(kinds), try_invert=try_inverted)
    pitch_mm, (x0, y0) = photo_pitch_mm(frame) * frame.shape[1] / grey.shape[1], photo_origin_mm(frame)
    codes: dict[str, Code] = {}
    for barcode in barcodes:
        position = barcode.position
        points = (position.top_left, position.top_right, position.bottom_right, position.bottom_left)
        corners = tuple((x0 + p.x * pitch_mm, y0 + p.y * pitch_mm) for p in points)
        text = barcode.text.translate(_PICTURES)
        if text:
            codes.setdefault(text, Code(str(barcode.format), text, corners))
    return tuple(codes.values())


def without_codes(
    photo: Photo, codes: Sequence[Code], *, quiet: float = 0.06, fill_radius: float = 4.0
) -> Photo:
    """Paint the land over the codes, and the blurred rim of their modules, in a photograph and its others."""
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

    def fill(picture: Photo) -> Photo:
        pixels = np.atleast_3d(picture.pixels)
        # OpenCV fills 16-bit images one channel at a time
        layers = [
            cv2.inpaint(np.array(pixels[..., k]), mask, fill_radius, cv2.INPAINT_TELEA)
            for k in range(pixels.shape[2])
        ]
        filled: Any = np.stack(layers, axis=-1).reshape(picture.pixels.shape).astype(picture.pixels.dtype)
        return replace(picture, pixels=filled, others=tuple(map(fill, picture.others)))

    return fill(photo)
