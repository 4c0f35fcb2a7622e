"""Kinds of picture files, known by their first bytes: those that are read, and those that are only recognised."""

from __future__ import annotations

import re
from dataclasses import dataclass

HEAD_BYTES = 16
"""First bytes of a file that tell its kind."""


@dataclass(frozen=True)
class PhotoKind:
    """A kind of picture that is read.

    Attributes:
        name: as Pillow has it.
        suffix: of a file of this kind.
        media_type: for browsers.
        magic: its first bytes.
    """

    name: str
    suffix: str
    media_type: str
    magic: re.Pattern[bytes]


READ = (
    PhotoKind("PNG", ".png", "image/png", re.compile(rb"\x89PNG\r\n\x1a\n")),
    PhotoKind("JPEG", ".jpg", "image/jpeg", re.compile(rb"\xff\xd8")),
    PhotoKind("BMP", ".bmp", "image/bmp", re.compile(rb"BM")),
    PhotoKind("TIFF", ".tif", "image/tiff", re.compile(rb"II\*\0|MM\0\*|II\+\0|MM\0\+")),
    PhotoKind("WEBP", ".webp", "image/webp", re.compile(rb"RIFF....WEBP", re.DOTALL)),
    PhotoKind("GIF", ".gif", "image/gif", re.compile(rb"GIF8[79]a")),
)
READ_NAMES = "PNG, JPEG, BMP, TIFF, WebP or GIF"
_RECOGNISED = (
    ("HEIC", re.compile(rb"....ftyp(?:hei[cfmsx]|hev[cmsx]|mif1|msf1)", re.DOTALL)),
    ("AVIF", re.compile(rb"....ftypavi[fs]", re.DOTALL)),
    ("JPEG 2000", re.compile(rb"\0\0\0\x0cjP  |\xff\x4f\xff\x51")),
    ("JPEG XL", re.compile(rb"\xff\x0a|\0\0\0\x0cJXL ")),
    ("Photoshop", re.compile(rb"8BPS")),
    ("PDF", re.compile(rb"%PDF-")),
)


def kind_of(head: bytes) -> PhotoKind | None:
    """The kind of a picture that is read, by its first `HEAD_BYTES`; None of any other file."""
    return next((kind for kind in READ if kind.magic.match(head)), None)


def refusal(head: bytes) -> tuple[str, str]:
    """A sentence on a file that is none of these pictures, and a hint."""
    name = next((name for name, magic in _RECOGNISED if magic.match(head)), None)
    if name is None:
        return "is not a picture that can be read", f"copy it again, or save it as {READ_NAMES}"
    return (
        f"is a {name} file, which is not read",
        f"photographs must be {READ_NAMES}; export it as one of these",
    )
