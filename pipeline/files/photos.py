"""Photographs as files: PNG, JPEG, BMP and TIFF in, PNG out.

Pillow reads the head (size, scale, whether the rest is there); OpenCV decodes, because it keeps 16 bit colours.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.errors import FileError, damage_reported, require_file
from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.atomic import replacing

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

MAX_PHOTO_BYTES = 500_000_000
_KINDS = ("PNG", "JPEG", "BMP", "TIFF")
_INCH_MM = 25.4
_LEAST_PITCH_MM, _MOST_PITCH_MM = 0.0002, 1.0
_MEANINGLESS_DPI = (72.0, 96.0)
"""Written by programs that know nothing of the scale."""


@dataclass(frozen=True)
class PhotoHeader:
    """The head of a picture file.

    Attributes:
        kind: PNG, JPEG, BMP or TIFF.
        rows: of pixels.
        cols: of pixels.
        pitch_mm: size of a pixel, if the file says so in metres or inches, and plausibly.
    """

    kind: str
    rows: int
    cols: int
    pitch_mm: float | None


def read_header(path: Path, *, most: int = MAX_PIXELS) -> PhotoHeader:
    """The head of a picture; nothing is decoded.

    Args:
        path: the file.
        most: pixels that it may have.

    Raises:
        FileError: no file, none of these kinds, damaged, or too large.
    """
    with _opened(Path(path), most=most) as (_, header):
        return header


def read_photo(path: Path) -> Photo:
    """The photograph in a file as 8 bit red, green and blue, upright as its EXIF says.

    Deeper pictures are brought to 8 bit by the depth that their brightest pixel needs (a 12 bit camera's file
    of 16 bit is not black). Transparency is ignored. The pixel's size is taken from the file
    where it says one in metres or inches that is none of the usual defaults (72, 96 dpi).

    Raises:
        FileError: no file, none of these kinds, damaged, cut short, or too large.
    """
    path = Path(path)
    with _opened(path) as (image, header):
        if min(header.rows, header.cols) < 8:
            raise FileError(path, f"has {_size(header)}, which shows no characters", "take it larger")
        _check_whole(path, image)
        pixels = _eight_bit(path, _decoded(path, header.kind))
        return Photo(pixels, pitch_mm=header.pitch_mm)


@contextlib.contextmanager
def _opened(path: Path, *, most: int = MAX_PIXELS) -> Iterator[tuple[ImageFile, PhotoHeader]]:
    """The picture, not yet decoded, and its head."""
    require_file(path, most_bytes=MAX_PHOTO_BYTES)
    with damage_reported(path, kind="picture"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's limit of pixels warns where ours refuses
        from PIL import Image, UnidentifiedImageError

        try:
            image = Image.open(path, formats=_KINDS)
        except UnidentifiedImageError:
            hint = "copy it again, or save it as PNG, JPEG, BMP or TIFF"
            raise FileError(path, "is not a picture that can be read", hint) from None
        except Image.DecompressionBombError:
            raise FileError(path, f"is over the limit of {most:,} pixels", "crop or shrink it") from None
        with image:
            kind = "JPEG" if image.format == "MPO" else str(image.format)
            header = PhotoHeader(kind, image.height, image.width, _pitch_mm(image))
            if header.rows * header.cols > most:
                raise FileError(path, f"has {_size(header)}, over the limit of {most:,}", "crop or shrink it")
            yield image, header


def _size(header: PhotoHeader) -> str:
    return f"{header.rows:,} x {header.cols:,} pixels"


def _pitch_mm(image: ImageFile) -> float | None:
    """Size of a pixel, if x and y agree to a hundredth and it is neither absurd nor a program's default."""
    if image.format in ("JPEG", "MPO") and not image.info.get("jfif_unit"):
        return None  # what EXIF says is a camera's habit, no scale
    x_dpi, y_dpi = (float(dpi) for dpi in image.info.get("dpi", (0.0, 0.0)))
    if not (x_dpi > 0.0 and y_dpi > 0.0) or any(abs(x_dpi - dpi) < 0.5 for dpi in _MEANINGLESS_DPI):
        return None
    x_mm, y_mm = _INCH_MM / x_dpi, _INCH_MM / y_dpi
    plausible = _LEAST_PITCH_MM <= x_mm <= _MOST_PITCH_MM and abs(x_mm - y_mm) <= 0.01 * x_mm
    return x_mm if plausible else None


def _check_whole(path: Path, image: ImageFile) -> None:
    """Refuse a file cut short; of a TIFF OpenCV sees it itself."""
    try:
        if image.format == "PNG":
            image.verify()
        elif image.format != "TIFF":
            image.draft(
                "L", (1, 1)
            )  # of a JPEG an eighth of the size is decoded: all of the file, little work
            image.load()
    except (OSError, SyntaxError, ValueError) as error:
        raise FileError(
            path, f"is a {image.format} that is damaged or ends too soon", "copy it again"
        ) from error


def _decoded(path: Path, kind: str) -> NDArray[np.generic]:
    from glyphs.opencv import cv2

    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # the error below says it
    try:
        data = np.fromfile(path, dtype=np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH)
    finally:
        cv2.utils.logging.setLogLevel(level)
    if image is None:
        raise FileError(path, f"is a damaged or unusual {kind}", "copy it again or save it as PNG of 8 bit")
    return np.asarray(image)


def _eight_bit(path: Path, image: NDArray[np.generic]) -> NDArray[np.uint8]:
    if image.dtype == np.uint8:
        return image.view(np.uint8)
    if image.dtype != np.uint16:
        raise FileError(path, f"holds pixels of type {image.dtype}", "save it with 8 or 16 bit")
    bits = max(8, int(image.max()).bit_length())
    return np.asarray(image.astype(np.uint16) >> np.uint16(bits - 8), dtype=np.uint8)


def write_photo(path: Path, photo: Photo) -> None:
    """Write a photograph as PNG, with its pixel's size if that is known; whole or not at all.

    Raises:
        FileError: another suffix, or it cannot be written.
    """
    from PIL import Image

    if path.suffix.lower() != ".png":
        raise FileError(path, "is not a photograph that can be written", "end it in .png")
    scale = {} if photo.pitch_mm is None else {"dpi": (_INCH_MM / photo.pitch_mm,) * 2}
    with replacing(path) as temporary:
        Image.fromarray(photo.pixels).save(temporary, "PNG", compress_level=1, **scale)
