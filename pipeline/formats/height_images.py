"""Heights in the pixels of a PNG or TIFF of 16 or 32 bits, where the user says that they are (`--height-image`)."""

from __future__ import annotations

from pathlib import Path

from glyphs.errors import FileError, damage_reported
from pipeline.formats.grids import check_size
from pipeline.formats.raw_map import RawMap


def read_height_image(path: Path) -> RawMap:
    """The heights of a picture, one number a pixel; the pitch is the pixel's size where the file says one.

    Raises:
        FileError: a colour picture, or one of 8 bits.
    """
    import numpy as np

    from glyphs.opencv import cv2
    from pipeline.formats.photos import read_header

    header = read_header(path)
    check_size(path, header.rows, header.cols)
    with damage_reported(path, kind="picture"):
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            z = cv2.imdecode(np.fromfile(path, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
        finally:
            cv2.utils.logging.setLogLevel(level)
        if z is None:
            raise FileError(
                path, f"is a damaged or unusual {header.kind}", "save it as TIFF of 32 bit floats"
            )
        if z.ndim != 2:
            raise FileError(path, "is a colour picture, no heights", "read it without --height-image")
        if z.dtype == np.uint8:
            raise FileError(
                path, "has 8 bits, too few for heights", "export it with 16 bits, or as float TIFF"
            )
        return RawMap(z, header.pitch_mm, header.pitch_mm, xy_mm=1.0, rows_stated=True)
