"""What the first bytes of a picture say: its size, its pixels' size, and whether the rest is there.

PNG, JPEG, BMP and TIFF, as their specifications have them (ISO/IEC 15948, ITU-T T.81 and T.871, TIFF 6.0).
Looked at before decoding, so that what is too large is refused without taking the memory.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

_INCH_MM = 25.4
_LEAST_PITCH_MM, _MOST_PITCH_MM = 0.0002, 1.0
_MEANINGLESS_DPI = (72.0, 96.0)
"""Written by programs that know nothing of the scale."""
PNG_MAGIC = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class PhotoHeader:
    """The head of a picture file.

    Attributes:
        kind: PNG, JPEG, BMP or TIFF.
        rows: of pixels.
        cols: of pixels.
        pitch_mm: size of a pixel, if the file says so in metres or inches, and plausibly.
        whole: whether the file reaches to its declared end (always so for TIFF, which does not say).
    """

    kind: str
    rows: int
    cols: int
    pitch_mm: float | None
    whole: bool


def read_header(data: bytes) -> PhotoHeader | None:
    """The head of a picture, or None if it is no picture of a known kind.

    Raises:
        ValueError, struct.error, IndexError: a head that is itself cut short or damaged.
    """
    if data.startswith(PNG_MAGIC):
        return _png(data)
    if data.startswith(b"\xff\xd8"):
        return _jpeg(data)
    if data.startswith(b"BM"):
        return _bmp(data)
    if data[:4] in (b"II*\0", b"MM\0*"):
        return _tiff(data)
    return None


def _plausible(x_mm: float, y_mm: float) -> float | None:
    """One pitch out of two, if they agree to a hundredth and are neither absurd nor a program's default."""
    if not (_LEAST_PITCH_MM <= x_mm <= _MOST_PITCH_MM and abs(x_mm - y_mm) <= 0.01 * x_mm):
        return None
    if any(abs(_INCH_MM / x_mm - dpi) < 0.5 for dpi in _MEANINGLESS_DPI):
        return None
    return x_mm


def _png(data: bytes) -> PhotoHeader:
    cols, rows = struct.unpack(">II", data[16:24])
    pitch, at, whole = None, 8, False
    while at + 8 <= len(data):
        (length,), name = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        if name == b"pHYs" and length == 9:
            x, y, unit = struct.unpack(">IIB", data[at + 8 : at + 17])
            pitch = _plausible(1000.0 / x, 1000.0 / y) if unit == 1 and x and y else None
        at += 12 + length
        if name == b"IEND":
            whole = at <= len(data)
            break
    return PhotoHeader("PNG", rows, cols, pitch, whole)


def _jpeg(data: bytes) -> PhotoHeader:
    size, pitch, at = None, None, 2
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            raise ValueError("a marker is missing")
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        (length,) = struct.unpack(">H", data[at + 2 : at + 4])
        if marker == 0xE0 and data[at + 4 : at + 9] == b"JFIF\0":
            unit, x, y = struct.unpack(">BHH", data[at + 11 : at + 16])
            per_mm = {1: _INCH_MM, 2: 10.0}.get(unit)
            pitch = _plausible(per_mm / x, per_mm / y) if per_mm and x and y else None
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            size = struct.unpack(">HH", data[at + 5 : at + 9])
        at += 2 + length
        if marker == 0xDA:
            break
    if size is None:
        raise ValueError("it says no size")
    # what follows the end marker (a phone's film, say) is no concern; a thumbnail's own end stands before SOS
    return PhotoHeader("JPEG", size[0], size[1], pitch, data.rfind(b"\xff\xd9") >= at)


def _bmp(data: bytes) -> PhotoHeader:
    (length,) = struct.unpack("<I", data[2:6])
    (head,) = struct.unpack("<I", data[14:18])
    if head == 12:  # of OS/2, which knows no resolution
        cols, rows = struct.unpack("<HH", data[18:22])
        return PhotoHeader("BMP", rows, cols, None, length <= len(data))
    cols, rows = struct.unpack("<ii", data[18:26])
    x, y = struct.unpack("<ii", data[38:46])
    pitch = _plausible(1000.0 / x, 1000.0 / y) if x > 0 and y > 0 else None
    return PhotoHeader("BMP", abs(rows), abs(cols), pitch, length <= len(data))


def _tiff(data: bytes) -> PhotoHeader:
    order = "<" if data[:2] == b"II" else ">"
    (start,) = struct.unpack(order + "I", data[4:8])
    (count,) = struct.unpack(order + "H", data[start : start + 2])
    found: dict[int, float] = {}
    for k in range(count):
        entry = data[start + 2 + 12 * k : start + 14 + 12 * k]
        tag, kind, _ = struct.unpack(order + "HHI", entry[:8])
        if kind == 3:
            (found[tag],) = struct.unpack(order + "H", entry[8:10])
        elif kind == 4:
            (found[tag],) = struct.unpack(order + "I", entry[8:12])
        elif kind == 5:
            (where,) = struct.unpack(order + "I", entry[8:12])
            above, below = struct.unpack(order + "II", data[where : where + 8])
            found[tag] = above / below if below else 0.0
    cols, rows = int(found[256]), int(found[257])
    per_mm = {2: _INCH_MM, 3: 10.0}.get(int(found.get(296, 2)))
    x, y = found.get(282, 0.0), found.get(283, 0.0)
    pitch = _plausible(per_mm / x, per_mm / y) if per_mm and x and y else None
    return PhotoHeader("TIFF", rows, cols, pitch, True)
