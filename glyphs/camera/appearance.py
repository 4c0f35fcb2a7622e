"""Photograph a part: its surface, lit by a lamp and seen by a camera above it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.camera.pose import Camera, apply_homography
from glyphs.camera.shading import Light, radiance
from glyphs.soiling.soiled import SoiledPart

_MEDIUM_GREY = 0.2
"""Mean linear brightness of a picture; 0.48 when encoded for a screen."""


def draw_light(
    rng: np.random.Generator, *, azimuth_deg: float | None = None, elevation_deg: float | None = None
) -> Light:
    """Draw a random light; default: from any side, 25 to 65 degrees above the plate."""
    azimuth, elevation = rng.uniform(0.0, 360.0), rng.uniform(25.0, 65.0)
    warm = 0.05 * float(np.clip(rng.standard_normal(), -2.0, 2.0))
    return Light(
        azimuth_deg=float(azimuth if azimuth_deg is None else azimuth_deg),
        elevation_deg=float(elevation if elevation_deg is None else elevation_deg),
        ambient=float(rng.uniform(0.25, 0.55)),
        size_deg=float(rng.uniform(3.0, 14.0)),
        gradient=float(rng.uniform(0.1, 0.6)),
        colour=(1.0 + warm, 1.0, 1.0 - warm),
    )


def photograph(soiled: SoiledPart, light: Light, camera: Camera, *, rng: np.random.Generator) -> Photo:
    """Take a picture of a part: the light of the surface is blurred by the lens, projected, exposed, given noise,
    clipped and encoded in 8 bit (a power of 1/2.2). Beyond its map the plate is mirrored."""
    from glyphs.surface.blur import gaussian_blur, sample_bilinear

    part = soiled.height_map
    shape, centre = camera.frame(part)
    scene = radiance(part, soiled.look, light)
    # a pixel also averages the light over its own width
    blur = np.hypot(camera.defocus_mm, 0.35 * camera.pitch_mm) / part.pitch_mm
    col, row = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
    x, y = apply_homography(camera.to_plate(part), col, row)
    row_of, col_of = y / part.pitch_mm, x / part.pitch_mm
    image = np.empty((*shape, 3), dtype=np.float32)
    for channel in range(3):
        image[..., channel] = sample_bilinear(
            gaussian_blur(scene[..., channel], blur, truncate=3.0), row_of, col_of
        )
    image *= _exposure(image, camera)
    if camera.bloom > 0.0:
        glare = np.maximum(image - 1.0, 0.0).clip(max=20.0)
        wide = 0.35 / camera.pitch_mm
        for channel in range(3):
            if glare[..., channel].any():
                image[..., channel] += camera.bloom * gaussian_blur(glare[..., channel], wide)
    image *= _falloff(shape, camera.vignetting)[..., None]
    spread = np.sqrt(camera.noise**2 * np.clip(image, 0.0, 1.0) + camera.dark_noise**2)
    image += spread * rng.standard_normal(image.shape, dtype=np.float32)
    encoded = np.clip(image, 0.0, 1.0) ** (1.0 / 2.2)
    return Photo(np.rint(255.0 * encoded).astype(np.uint8), pitch_mm=camera.pitch_mm, centre_mm=centre)


def _exposure(image: NDArray[np.float32], camera: Camera) -> np.float32:
    green = image[..., 1]
    middle = max(float(np.minimum(green, np.quantile(green, 0.98)).mean()), 1e-6)
    return np.float32(_MEDIUM_GREY / middle * 2.0**camera.exposure_ev)


def _falloff(shape: tuple[int, int], loss: float) -> NDArray[np.float32]:
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    return np.asarray(1.0 - loss * (u * u + v * v) / 2.0, dtype=np.float32)
