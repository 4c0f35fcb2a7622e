"""Photographs with Data Matrix and QR codes marked beside the serial, made by zxing-cpp's own writer."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import zxingcpp

from glyphs.camera.photo import Photo
from glyphs.fonts.outlines import load_font
from glyphs.part import Part
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.faces import default_die
from glyphs.stamping.stamp import stamp_line

GS1 = "(01)09501101530003(21)"
ENVELOPE = "[)>\x1e12\x1dMFR 0AB12\x1dSER {}\x1e\x04"
MARGIN_MM = 8.0
_FINE = 8


def stamped_photo(text: str) -> Photo:
    """A photograph of a stamped serial with room for a code below it."""
    font, rng = load_font("gothic"), np.random.default_rng(4)
    die = default_die(5.0, font=font)
    part = stamp_line(text, font, die, height_mm=5.0, margin_mm=MARGIN_MM, rng=rng)
    return Part(part, Soiling(), (4,)).photograph()


def with_code(
    photo: Photo,
    text: str,
    *,
    kind: zxingcpp.BarcodeFormat = zxingcpp.BarcodeFormat.DataMatrix,
    module_px: float = 4.0,
    contrast: float = 0.6,
    turn_deg: float = 0.0,
    blur_px: float = 0.7,
    dots: float | None = None,
    at: tuple[float, float] | None = None,
) -> Photo:
    """The photograph with a code marked dark into it, below the middle unless told where.

    Args:
        photo: of the part.
        text: of the code; one that begins with a bracketed number is written as GS1 code.
        kind: of the code.
        module_px: size of a module.
        contrast: share of the light that a module takes away; below 0 adds.
        turn_deg: against the clock.
        blur_px: of the modules' rims, standard deviation.
        dots: peened, a module is a dot so wide in parts of their distance; squares that touch unless given.
        at: x, y of its middle, pixels.
    """
    made = zxingcpp.create_barcode(text, kind, **({"gs1": True} if text.startswith("(") else {}))
    modules = np.array(made.to_image(scale=1, add_quiet_zones=False)) < 128
    y, x = np.mgrid[:_FINE, :_FINE] - 0.5 * (_FINE - 1)
    module = np.ones((_FINE, _FINE)) if dots is None else np.hypot(x, y) <= 0.5 * dots * _FINE
    fine = np.kron(modules, module).astype(np.float32)
    rows, cols = photo.shape
    height, width = fine.shape
    at_x, at_y = at or (0.5 * cols, rows - 0.5 * MARGIN_MM / (photo.pitch_mm or 1.0))
    if module_px < _FINE:  # light of a whole pixel
        fine = cv2.GaussianBlur(fine, (0, 0), 0.3 * _FINE / module_px)
    placed = cv2.getRotationMatrix2D((0.5 * width, 0.5 * height), turn_deg, module_px / _FINE)
    placed[:, 2] += [at_x - 0.5 * width, at_y - 0.5 * height]
    ink = cv2.GaussianBlur(cv2.warpAffine(fine, placed, (cols, rows)), (0, 0), blur_px)
    left = np.asarray(1.0 - contrast * ink)
    grey = photo.pixels * (left[..., None] if photo.pixels.ndim == 3 else left)
    return replace(photo, pixels=np.rint(np.clip(grey, 0, 255)).astype(np.uint8))
