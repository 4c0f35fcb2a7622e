"""Count the pieces of a picture file before a decoder works through them: millions of empty ones take minutes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import accumulate

from pipeline.errors import DataError

# chunks, segments, blocks or strips of a picture; Pillow takes some seconds for them
MOST_PIECES = 300_000
# next marker in a JPEG's compressed data; stuffed bytes and restart markers do not count
_NEXT_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
_START_OF_SCAN = 0xDA
_PGM_HEAD = re.compile(rb"P[56](?:(?:\s|#[^\n]*\n)+\d+){3}\s")
_MOST_PGM_HEAD_BYTES = 4096
# first and last tag of a TIFF whose values are read one by one, such as the places of strips and tiles
_TIFF_PLACES = (258, 339)
_MOST_DIRECTORIES = 64


def check_pieces(data: bytes, kind: str) -> None:
    """Refuse a picture of far more pieces than a photograph has (DataError); `kind` as Pillow names it."""
    if kind == "PPM" and not _PGM_HEAD.match(data[:_MOST_PGM_HEAD_BYTES]):
        raise DataError("is a PGM with a damaged head or long comments", "save it as PNG")
    pieces = {"PNG": _png_chunks, "JPEG": _jpeg_segments, "GIF": _gif_blocks}
    counts = _tiff_values(data) if kind == "TIFF" else (1 for _ in pieces.get(kind, lambda _: iter(()))(data))
    if any(total > MOST_PIECES for total in accumulate(counts)):
        raise DataError(f"is a {kind} of more than {MOST_PIECES:,} pieces", "save it as a usual JPEG or PNG")


def jpeg_scans(data: bytes) -> int:
    """Passes of a JPEG over its pixels: start-of-scan markers before the end of the picture."""
    return sum(marker == _START_OF_SCAN for marker in _jpeg_segments(data))


def _png_chunks(data: bytes) -> Iterator[int]:
    place = 8
    while place < len(data):
        yield place
        place += 12 + int.from_bytes(data[place : place + 4], "big")


def _jpeg_segments(data: bytes) -> Iterator[int]:
    place = 2
    while (match := _NEXT_MARKER.search(data, place)) is not None:
        marker, place = data[match.start() + 1], match.end()
        if marker == 0xD9:
            break
        yield marker
        if marker not in (0x01, 0xD8):
            place += max(2, int.from_bytes(data[place : place + 2], "big"))


def _gif_blocks(data: bytes) -> Iterator[int]:
    def colours(place: int) -> int:
        # bytes of the table of colours that the flags at a place declare
        flags = data[place] if place < len(data) else 0
        return 3 << (flags & 7) + 1 if flags & 0x80 else 0

    place = 13 + colours(10)
    while place < len(data):
        yield place
        if data[place] == 0x2C:
            place += 11 + colours(place + 9)
        elif data[place] == 0x21:
            place += 2
        elif data[place] == 0x3B:
            break
        else:
            place += 1
            continue
        while place < len(data) and data[place]:
            yield place
            place += data[place] + 1
        place += 1


def _tiff_values(data: bytes) -> Iterator[int]:
    order = "big" if data[:2] == b"MM" else "little"
    big = b"+" in data[2:4]
    width, size, entry = (8, 8, 20) if big else (4, 2, 12)

    def number(place: int, length: int) -> int:
        return int.from_bytes(data[place : place + length], order)  # type: ignore[arg-type]

    place = number(8 if big else 4, width)
    for _ in range(_MOST_DIRECTORIES):
        if not 0 < place < len(data):
            break
        entries = number(place, size)
        yield entries
        for field in range(place + size, min(place + size + entries * entry, len(data)), entry):
            if _TIFF_PLACES[0] <= number(field, 2) <= _TIFF_PLACES[1]:
                yield number(field + 4, width)
        place = number(place + size + entries * entry, width)
