"""Photographs as files: PNG, JPEG, BMP and TIFF in, PNG out."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.atomic import replacing
from pipeline.common.errors import FileProblem, damage_reported, require_file
from pipeline.files.photo_header import PNG_MAGIC, PhotoHeader, read_header

MAX_PHOTO_BYTES = 500_000_000
_IHDR_END = len(PNG_MAGIC) + 25


def read_photo(path: Path) -> Photo:
    """The photograph in a file as 8 bit red, green and blue, upright as its EXIF says.

    Deeper pictures are brought to 8 bit by the depth that their brightest pixel needs (a 12 bit camera's file
    of 16 bit is not black). Transparency is ignored. The pixel's size is taken from the file
    where it says one in metres or inches that is none of the usual defaults (72, 96 dpi).

    Raises:
        FileProblem: no file, none of these kinds, damaged, cut short, or too large.
    """
    path = Path(path)
    require_file(path, most_bytes=MAX_PHOTO_BYTES)
    with damage_reported(path, kind="picture"):
        data = path.read_bytes()
        header = read_header(data)
        if header is None:
            raise FileProblem(path, "is no picture that can be read", "save it as PNG, JPEG, BMP or TIFF")
        _check(path, header)
        pixels = _eight_bit(path, _decoded(path, data, header))
        return Photo(pixels, pitch_mm=header.pitch_mm)


def _check(path: Path, header: PhotoHeader) -> None:
    size = f"{header.rows:,} x {header.cols:,} pixels"
    if header.rows * header.cols > MAX_PIXELS:
        raise FileProblem(path, f"has {size}, over the limit of {MAX_PIXELS:,}", "crop or shrink it")
    if min(header.rows, header.cols) < 8:
        raise FileProblem(path, f"has {size}, which shows no characters", "take it larger")
    if not header.whole:
        raise FileProblem(path, f"is a {header.kind} that ends too soon", "copy it again")


def _decoded(path: Path, data: bytes, header: PhotoHeader) -> NDArray[np.generic]:
    import cv2

    told = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # the problem is told below
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH)
    finally:
        cv2.utils.logging.setLogLevel(told)
    if image is None:
        raise FileProblem(
            path, f"is a damaged or unusual {header.kind}", "copy it again or save it as PNG of 8 bit"
        )
    return np.asarray(image)


def _eight_bit(path: Path, image: NDArray[np.generic]) -> NDArray[np.uint8]:
    if image.dtype == np.uint8:
        return image.view(np.uint8)
    if image.dtype != np.uint16:
        raise FileProblem(path, f"holds pixels of type {image.dtype}", "save it with 8 or 16 bit")
    bits = max(8, int(image.max()).bit_length())
    return np.asarray(image.astype(np.uint16) >> np.uint16(bits - 8), dtype=np.uint8)


def write_photo(path: Path, photo: Photo) -> None:
    """Write a photograph as PNG, with its pixel's size if that is known; whole or not at all.

    Raises:
        FileProblem: another suffix, or it cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise FileProblem(path, "is no photograph that can be written", "end it in .png")
    data = _png(photo)
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def _png(photo: Photo) -> bytes:
    import cv2

    pixels = photo.pixels if photo.pixels.ndim == 2 else photo.pixels[..., ::-1]
    done, encoded = cv2.imencode(".png", np.ascontiguousarray(pixels))
    if not done:
        raise RuntimeError("the picture could not be encoded")
    data = bytes(encoded)
    if photo.pitch_mm is None:
        return data
    # the chunk of physical pixel size goes between the header and the pixels
    per_metre = max(1, round(1000.0 / photo.pitch_mm))
    body = b"pHYs" + struct.pack(">IIB", per_metre, per_metre, 1)
    chunk = struct.pack(">I", 9) + body + struct.pack(">I", zlib.crc32(body))
    return data[:_IHDR_END] + chunk + data[_IHDR_END:]
