"""Photographs as files: PNG, JPEG, BMP, TIFF, WebP, GIF and PGM in, PNG out; by Pillow, and OpenCV for 16 bit."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.camera.photo import Photo
from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.output_paths import check_writable
from pipeline.errors import DataError, reading
from pipeline.formats.grid import MM
from pipeline.formats.kinds import HEAD_BYTES, MOST_BYTES, kind_of, refusal
from pipeline.formats.picture_pieces import check_pieces, jpeg_scans
from pipeline.formats.raw_map import RawMap, check_size

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile


Decoded = NDArray[np.unsignedinteger[Any]]
Pixels = NDArray[np.uint8] | NDArray[np.uint16]

# samples of a picture for percentiles; more do not help
_SAMPLED = 1_000_000
# percentiles of 16 bit pictures: values far beyond are hot pixels or glints
_DARK_PERCENT, _BRIGHT_PERCENT = 1.0, 99.0
# range below and above the percentiles, in their distances: it holds the flanks of a small line, and 8 bit
# photographs fill about as much of their scale
_BELOW, _ABOVE = 1.0, 2.0
# range of the middle 99.8 % of a blank page, as a share of full scale
_BLANK = 2.0 / 255.0


def _turn_upright(pixels: Decoded, orientation: int) -> Decoded:
    turned = np.rot90(pixels, {3: 2, 4: 2, 5: 3, 6: 3, 7: 1, 8: 1}.get(orientation, 0))
    return turned[:, ::-1] if orientation in (2, 4, 5, 7) else turned


def flatten_opacity(pixels: Decoded) -> tuple[Decoded, str]:
    """(rows, cols, 3) opaque pixels, and the background that shows through: "white" if the opaque parts are dark, else
    "black"; "" if none does. Evenly opaque or transparent pictures keep their colours."""
    colours = pixels[..., :3]
    if pixels.shape[2] < 4:
        return colours, ""
    opacity = pixels[..., 3]
    if opacity.min() == opacity.max():
        return colours, ""
    full = np.float32(np.iinfo(pixels.dtype).max)
    share = opacity[..., None].astype(np.float32) / full
    seen = colours * share
    bright = float(seen.mean() / share.mean()) > 0.5 * full
    ground = np.float32(0.0) if bright else full
    opaque = np.rint(seen + ground * (1.0 - share)).astype(pixels.dtype)
    return opaque, "black" if bright else "white"


def stretch(pixels: Decoded) -> Pixels:
    """Stretch pixels of 16 bit from a little below to a little above the percentiles; 8 bit is unchanged."""
    if pixels.dtype == np.uint8:
        return pixels.view(np.uint8)
    some = _some(pixels)
    dark, bright = np.percentile(some, (_DARK_PERCENT, _BRIGHT_PERCENT))
    least, most = float(pixels.min()), float(pixels.max())
    if bright > dark:
        least = max(least, dark - _BELOW * (bright - dark))
        most = min(most, bright + _ABOVE * (bright - dark))
    gain = np.float32(65535.0 / max(most - least, 1.0))
    stretched = (pixels.astype(np.float32) - np.float32(least)) * gain
    return np.asarray(np.clip(np.rint(stretched), 0.0, 65535.0), dtype=np.uint16)


def _is_blank(pixels: Decoded) -> bool:
    opaque, _ = flatten_opacity(pixels)
    low, high = np.percentile(_some(opaque), (0.1, 99.9))
    return bool(high - low < _BLANK * np.iinfo(opaque.dtype).max)


def _some(pixels: Decoded) -> NDArray[np.float32]:
    flat = pixels.reshape(-1)
    return np.asarray(flat[:: max(1, flat.size // _SAMPLED)], dtype=np.float32)


_INCH_MM = 25.4
_LEAST_PITCH_MM, _MOST_PITCH_MM = 0.0002, 1.0
# of programs that do not know the scale
_MEANINGLESS_DPI = (72.0, 96.0)
# unit of the resolution in the description of a TIFF
_IMAGEJ_UNIT = re.compile(r"(?sm)\AImageJ=.*?^unit=(\S+)")
# tags of EXIF and TIFF; of the resolution along x and y
_ORIENTATION = 274
_COLUMNS, _ROWS, _BITS, _DESCRIPTION, _RESOLUTION = 256, 257, 258, 270, (282, 283)
# tag of a TIFF page, and its bit for a smaller copy of another page
_SUBFILE, _REDUCED = 254, 1
# compression of a BMP with runs of 8 or 4 bits
_PACKED_BMP = (1, 2)
# pages of a TIFF to search for one that is not blank; each is decoded
_MOST_PAGES = 24
# passes over a progressive JPEG that are always allowed (encoders write about 10), and pixels times passes beyond
_FREE_SCANS, _MOST_SCANNED = 16, 10 * MAX_PIXELS


def read_photo(path: Path, *, most: int = MAX_PIXELS) -> Photo:
    """Read a photograph as red, green and blue of 8 or 16 bit, turned upright by its EXIF data.

    Pictures of 16 bit are stretched between percentiles, so that neither a 12 bit camera nor a glint leaves the rest
    black. In a file of several pages the first that is not blank is read, in an animation the first frame. Transparent
    pixels are laid on white, or on black if the rest is bright. The photograph's notes say so. The pixel size is the
    file's, in metres or inches, unless it is a usual default (72 or 96 dpi). Raises FileError: the file cannot be used,
    has more than `most` pixels, or takes more work to decode than a photograph.
    """
    path = Path(path)
    with _open_image(path, most) as image:
        page, pages = _page(path, image) if image.format == "TIFF" else (0, getattr(image, "n_frames", 1))
        if min(image.size) < 8:
            raise DataError(f"has {_size(image)}, too few for characters", "take a larger photograph")
        pixels, pitch_mm = _decode(path, image, page), _pitch_mm(image)
    pixels, ground = flatten_opacity(pixels)
    notes = [] if image.format == "MPO" or pages < 2 else [_page_note(image.format, page, pages)]
    notes += [f"the picture is transparent in places; it was laid on {ground}"] if ground else []
    return Photo(stretch(pixels), pitch_mm=pitch_mm, notes=tuple(notes))


@contextlib.contextmanager
def _open_image(path: Path, most: int = MAX_PIXELS) -> Iterator[ImageFile]:
    with reading(path, kind="picture", most_bytes=MOST_BYTES["photo"]), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's limit of pixels warns where ours refuses
        from PIL import Image, UnidentifiedImageError

        data = path.read_bytes()
        if (kind := kind_of(data[:HEAD_BYTES])) is None:
            raise DataError(*refusal(data[:HEAD_BYTES]))
        check_pieces(data, kind.name)
        try:
            image = Image.open(path, formats=[kind.name])
        except UnidentifiedImageError:
            raise DataError(*refusal(data[:HEAD_BYTES])) from None
        except OSError as error:
            raise _damage(kind.name) from error
        except Image.DecompressionBombError:
            raise DataError(f"is over the limit of {most:,} pixels", "crop or shrink it") from None
        with image:
            _check_work(path, image, most)
            yield image


def _damage(kind: str | None) -> DataError:
    what = f"is a {kind} that is damaged, unusual or ends too soon"
    return DataError(what, "copy it again, or save it as PNG of 8 bit")


def _check_work(path: Path, image: ImageFile, most: int = MAX_PIXELS) -> None:
    pixels = image.width * image.height
    if pixels > most:
        raise DataError(f"has {_size(image)}, over the limit of {most:,}", "crop or shrink it")
    if image.format in ("JPEG", "MPO") and (scans := jpeg_scans(path.read_bytes())) * pixels > max(
        _MOST_SCANNED, _FREE_SCANS * pixels
    ):
        what = f"is a JPEG of {scans:,} passes over {_size(image)}"
        raise DataError(what, "save it as a usual JPEG or as PNG")


def _size(image: ImageFile) -> str:
    return f"{image.height:,} x {image.width:,} pixels"


def _pitch_mm(image: ImageFile) -> float | None:
    """Size of a pixel, if x and y agree to a hundredth and it is neither absurd nor a program's default."""
    # EXIF holds a camera's default resolution, not a scale; WebP has no other
    if image.format == "WEBP" or (image.format in ("JPEG", "MPO") and not image.info.get("jfif_unit")):
        return None
    unit_mm, (x_dpi, y_dpi) = _INCH_MM, (float(dpi) for dpi in image.info.get("dpi", (0.0, 0.0)))
    if image.format == "TIFF":
        tags = image.tag_v2  # type: ignore[attr-defined]
        if imagej := _IMAGEJ_UNIT.match(str(tags.get(_DESCRIPTION, ""))):
            unit_mm = MM.get(imagej[1].replace("\\u00B5", "µ"), 0.0)
            x_dpi, y_dpi = (float(tags.get(tag, 0.0)) for tag in _RESOLUTION)
    if not (x_dpi > 0.0 and y_dpi > 0.0) or (
        unit_mm == _INCH_MM and any(abs(x_dpi - dpi) < 0.5 for dpi in _MEANINGLESS_DPI)
    ):
        return None
    x_mm, y_mm = unit_mm / x_dpi, unit_mm / y_dpi
    plausible = _LEAST_PITCH_MM <= x_mm <= _MOST_PITCH_MM and abs(x_mm - y_mm) <= 0.01 * x_mm
    return x_mm if plausible else None


def _page(path: Path, image: ImageFile) -> tuple[int, int]:
    whole = []
    for number in range(_MOST_PAGES):
        try:
            image.seek(number)
        except EOFError:
            break
        if not int(image.tag_v2.get(_SUBFILE, 0)) & _REDUCED:  # type: ignore[attr-defined]
            whole.append(number)
    whole = whole or [0]

    def shows_something(number: int) -> bool:
        image.seek(number)
        _check_work(path, image)
        return not _is_blank(_decode(path, image, number))

    best = next(filter(shows_something, whole), whole[0]) if len(whole) > 1 else whole[0]
    image.seek(best)
    return best, len(whole)


def _page_note(kind: str | None, page: int, pages: int) -> str:
    if kind != "TIFF":
        return f"the first of the file's {pages} frames was read"
    return f"page {page + 1} of the file's {pages} was read" + ("; those before it are blank" if page else "")


def _decode(path: Path, image: ImageFile, page: int) -> Decoded:
    from PIL import Image

    by_opencv = _needs_opencv(path, image)
    if image.mode in ("I", "F") and not by_opencv:
        raise DataError(
            f"is a {image.format} of 32 bit numbers, not a photograph",
            "read heights with --height-image and --pitch-mm, or from .npz with z_mm and pitch_mm",
        )
    try:
        if image.format == "PNG":
            with Image.open(path, formats=("PNG",)) as again:
                again.verify()  # loading ignores damaged checksums
        if by_opencv:
            pixels = _decoded_by_opencv(path, page)
        else:
            image.load()
            opaque = "RGBA" if image.has_transparency_data else "RGB"
            pixels = np.asarray(image if image.mode in ("RGB", "RGBA") else image.convert(opaque))
    except (OSError, SyntaxError, ValueError) as error:
        raise _damage(image.format) from error
    # both libraries have turned a TIFF already
    turned = 1 if image.format == "TIFF" else image.getexif().get(_ORIENTATION, 1)
    return _turn_upright(pixels, turned)


def _needs_opencv(path: Path, image: ImageFile) -> bool:
    if image.format == "BMP":
        return image.info.get("compression") in _PACKED_BMP
    if image.format == "TIFF":
        return 16 in image.tag_v2.get(_BITS, ())  # type: ignore[attr-defined]
    if image.format == "PPM":
        return image.mode == "I"
    with path.open("rb") as stream:
        return image.format == "PNG" and stream.read(25)[24:] == b"\x10"  # bit depth in the first chunk, IHDR


def _decoded_by_opencv(path: Path, page: int) -> Decoded:
    decoded = _by_opencv(path, page)
    if decoded is None or decoded.dtype not in (np.uint8, np.uint16):
        raise ValueError("OpenCV does not decode it")
    pixels = np.atleast_3d(decoded)
    colours = pixels[..., [0, 0, 0]] if pixels.shape[2] < 3 else pixels[..., 2::-1]
    return np.concatenate([colours, pixels[..., 1 if pixels.shape[2] < 3 else 3 :]], axis=2)


def _by_opencv(path: Path, page: int = 0) -> Any:
    from glyphs.opencv import cv2

    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # our own error says it
    pages: Any = ()
    with contextlib.suppress(cv2.error):
        data = np.fromfile(path, dtype=np.uint8)
        _, pages = cv2.imdecodemulti(data, cv2.IMREAD_UNCHANGED, range=(page, page + 1))
    cv2.utils.logging.setLogLevel(level)
    return np.asarray(pages[0]) if len(pages) == 1 else None


def read_height_image(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read heights from the pixels of a grey PNG or TIFF of 16 or 32 bits; the pitch is the pixel's size, if stated."""
    pitch_mm = None
    if (size := _size_of_doubles(path)) is not None:
        check_size(*size, most)
    else:
        with _open_image(path, most) as image:
            pitch_mm = _pitch_mm(image)
    z = _by_opencv(path)
    if z is None:
        raise DataError("is a damaged or unusual picture", "save it as TIFF of 32 bit floats")
    if z.ndim != 2:
        raise DataError("is a colour picture, no heights", "read it without --height-image")
    if z.dtype == np.uint8:
        raise DataError("has 8 bits, too few for heights", "export it with 16 bits, or as float TIFF")
    return RawMap(z, pitch_mm, pitch_mm, xy_mm=1.0, rows_stated=True)


def _size_of_doubles(path: Path) -> tuple[int, int] | None:
    """Rows and columns of a TIFF of 64 bit floats, which Pillow does not open; None for other files."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    data = path.read_bytes()
    if (kind := kind_of(data[:HEAD_BYTES])) is None or kind.name != "TIFF":
        return None
    check_pieces(data, "TIFF")
    with io.BytesIO(data) as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # damaged files are refused below
        directory = ImageFileDirectory_v2(data[:HEAD_BYTES] if b"+" in data[:4] else data[:8])
        stream.seek(directory.next)
        directory.load(stream)
    return (directory[_ROWS], directory[_COLUMNS]) if directory.get(_BITS) == (64,) else None


def write_photo(path: Path, photo: Photo) -> None:
    """Write a photograph as PNG of 8 bit with its pixel's size, if known, whole or not at all. Raises FileError."""
    from PIL import Image

    check_writable(path, (".png",))
    scale = {} if photo.pitch_mm is None else {"dpi": (_INCH_MM / photo.pitch_mm,) * 2}
    with replacing(path) as temporary:
        Image.fromarray(photo.eight_bit).save(temporary, "PNG", compress_level=1, **scale)
