"""A photograph of a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import Positive, Validated
from glyphs.surface.display import OneLine, picture_html
from glyphs.surface.maps import MAX_PIXELS, MapError, read_only_copy


@dataclass(frozen=True, eq=False, repr=False)
class Photo(OneLine, Validated, error=MapError):
    """A photograph, row 0 at the top. Raises MapError.

    Attributes:
        pixels: (rows, cols) or (rows, cols, 3) red, green, blue; uint8 or uint16, read-only.
        pitch_mm: size of a pixel on the part, if known.
        centre_mm: plate-frame (x, y) under the middle of the picture, if the stage knows it.
        shrunk: width of a pixel in pixels of the original photograph, if it was reduced and the pitch is unknown.
        others: further photographs of the part from the same place, under other lights or at other exposures.
    """

    pixels: NDArray[np.uint8] | NDArray[np.uint16]
    pitch_mm: Positive | None = None
    centre_mm: tuple[float, float] | None = None
    shrunk: float = 1.0
    others: tuple[Photo, ...] = ()
    notes: tuple[str, ...] = ()

    def _repr_html_(self) -> str:
        return picture_html(self, self.grey())

    def __post_init__(self) -> None:
        p = np.ascontiguousarray(self.pixels)
        if p.dtype not in (np.uint8, np.uint16) or not (p.ndim == 2 or (p.ndim == 3 and p.shape[2] == 3)):
            raise MapError(
                f"pixels are {p.dtype} of shape {p.shape}", hint="give grey or RGB pixels of 8 or 16 bit"
            )
        if min(p.shape[:2]) < 8:
            raise MapError(
                f"the photograph is {p.shape[0]} x {p.shape[1]} pixels", hint="give at least 8 x 8 pixels"
            )
        if p.shape[0] * p.shape[1] > MAX_PIXELS:
            raise MapError(
                f"{p.shape[0]} x {p.shape[1]} pixels exceed the limit of {MAX_PIXELS:,}", hint="crop it"
            )
        super().__post_init__()
        for other in self.others:
            if other.shape != p.shape[:2] or other.others:
                raise MapError(
                    f"photographs of one part are {p.shape[0]} x {p.shape[1]} and "
                    f"{other.shape[0]} x {other.shape[1]} pixels",
                    hint="take them from one place, with one camera",
                )
        object.__setattr__(self, "pixels", read_only_copy(p, p.dtype))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return (self.pixels.shape[0], self.pixels.shape[1])

    @property
    def eight_bit(self) -> NDArray[np.uint8]:
        """The pixels as uint8, for screens and for libraries that accept no other type."""
        if self.pixels.dtype == np.uint8:
            return self.pixels.view(np.uint8)
        return np.asarray(self.pixels >> np.uint16(8), dtype=np.uint8)

    def grey(self) -> NDArray[np.float32]:
        """Brightness, (rows, cols) float32 0 to 1 (colours weighted by ITU-R BT.601)."""
        values = self.pixels.astype(np.float32) / np.float32(np.iinfo(self.pixels.dtype).max)
        if values.ndim == 2:
            return values
        return np.asarray(values @ np.array([0.299, 0.587, 0.114], dtype=np.float32))
