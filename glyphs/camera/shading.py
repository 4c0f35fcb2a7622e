"""Light reflected towards a camera straight above, computed from heights and a `Look`.

The sum of a directional light and a dome of ambient light, each reflected diffusely (Lambert) and by microfacets
(Trowbridge-Reitz, also called GGX, with Schlick's Fresnel factor)::

         light   normal   camera (0, 0, 1)
             \\     |     /
      l       \\    n    /  v          h = (l + v) / |l + v|
               \\   |   /
        ________\\__|__/________ surface
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import Range, Share, Validated
from glyphs.soiling.coat import Look
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError
from glyphs.surface.noise import Field


@dataclass(frozen=True, repr=False)
class Light(OneLine, Validated, error=MapError):
    """Light on a part. Raises MapError.

    Attributes:
        azimuth_deg: azimuth of the lamp in the plate frame: 0 at the right (+x), 90 below (+y), 270 above.
        ambient: light from all round, as a share of all light that falls on a flat plate, 0..1.
        size_deg: angular radius of the lamp, 0.1 to 60; a large lamp gives soft glints and soft shadows.
        gradient: share by which mirrored ambient light is brighter towards the lamp, 0..1.
    """

    azimuth_deg: Annotated[float, Range(-1e6, 1e6)] = 315.0
    elevation_deg: Annotated[float, Range(1.0, 90.0)] = 45.0
    ambient: Share = 0.35
    size_deg: Annotated[float, Range(0.1, 60.0)] = 8.0
    gradient: Share = 0.4
    shadows: bool = True
    colour: Annotated[tuple[float, float, float], Range(1e-3, 1e3)] = (1.0, 1.0, 1.0)

    @property
    def towards(self) -> tuple[float, float, float]:
        """Unit vector from the plate to the lamp: x right, y down, z towards the camera."""
        az, el = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        return (math.cos(el) * math.cos(az), math.cos(el) * math.sin(az), math.sin(el))


def radiance(height_map: HeightMap, look: Look, light: Light) -> NDArray[np.float32]:
    """Linear radiance towards a camera above, (rows, cols, 3) float32; 1 is a flat, white plate. Raises MapError."""
    z, pitch = height_map.z_mm, height_map.pitch_mm
    if look.roughness.shape != z.shape:
        raise MapError(f"a look of {look.roughness.shape} does not fit heights of {z.shape}")
    if np.isnan(z).any():
        raise MapError("the height map has dropouts", hint="fill them before taking its picture")
    nx, ny, nz = _normals(z, pitch)
    lx, ly, lz = light.towards
    facing = np.maximum(nx * lx + ny * ly + nz * lz, 0.0)
    seen = lit_share(z, light, pitch_mm=pitch) if light.shadows else np.float32(1.0)
    sky = openness(z, pitch_mm=pitch)

    # a flat plate gets (1 - ambient) from the lamp and ambient from the dome
    lamp = np.float32((1.0 - light.ambient) / lz)
    direct, around = lamp * facing * seen, np.float32(light.ambient) * sky
    fallen = direct + around

    hx, hy, hz = lx, ly, lz + 1.0
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    nh = np.clip((nx * hx + ny * hy + nz * hz) / length, 0.0, 1.0)
    # the lamp's size widens the glint by half its angle, because the half vector turns by half the angle
    alpha = np.hypot(look.roughness, math.tan(math.radians(light.size_deg) / 2)).astype(np.float32)
    fresnel = look.reflectance + (1.0 - look.reflectance) * np.float32((1.0 - length / 2) ** 5)
    glint = fresnel * _trowbridge_reitz(nh, alpha) * (direct > 0.0) * seen * lamp * np.pi / (4.0 * nz)

    # mirror image of the dome: the camera looks down, so the reflected ray leaves along 2 nz n - v
    rx, ry, rz = 2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1.0
    lateral = (rx * lx + ry * ly) / max(math.hypot(lx, ly), 1e-6)
    dome = (
        light.ambient * (1.0 + light.gradient * lateral) * (0.55 + 0.45 * np.clip(1.6 * (1.0 - rz), 0.0, 1.0))
    )
    mirror = look.reflectance * dome * sky
    # one channel at a time: numpy is slow along an axis of length three
    shine, scene = glint + mirror, np.empty((3, *z.shape), dtype=np.float32)
    for channel, colour in enumerate(np.asarray(light.colour, dtype=np.float32)):
        scene[channel] = (look.albedo[..., channel] * fallen + shine) * colour
    return np.moveaxis(scene, 0, -1)


def _normals(z: Field, pitch_mm: float) -> tuple[Field, Field, Field]:
    down, right = np.gradient(z, np.float32(pitch_mm))
    scale = 1.0 / np.sqrt(1.0 + down * down + right * right)
    return -right * scale, -down * scale, scale


def _trowbridge_reitz(cosine: Field, alpha: Field) -> Field:
    a2 = alpha * alpha
    below = cosine * cosine * (a2 - 1.0) + 1.0
    return np.asarray(a2 / (np.pi * below * below), dtype=np.float32)


def lit_share(z: Field, light: Light, *, pitch_mm: float) -> Field:
    """Visible share of the lamp at every sample, 0..1, by the horizon below it: ridges towards the lamp hide it."""
    lx, ly, _ = light.towards
    across = math.hypot(lx, ly)
    elevation = math.radians(light.elevation_deg)
    relief = float(np.quantile(z, 0.999) - np.quantile(z, 0.001))
    reach = relief / math.tan(elevation) if across > 1e-6 else 0.0
    steps = min(40, math.ceil(reach / pitch_mm))
    if steps < 1:
        return np.ones_like(z)
    rows, cols = z.shape
    room = steps + 1
    wide = np.pad(z, room, mode="edge")
    rise = np.full(z.shape, -np.inf, dtype=np.float32)
    for k in range(1, steps + 1):
        dr, dc = round(k * ly / across), round(k * lx / across)
        if dr == 0 and dc == 0:
            continue
        there = wide[room + dr : room + dr + rows, room + dc : room + dc + cols]
        np.maximum(rise, (there - z) / np.float32(math.hypot(dr, dc) * pitch_mm), out=rise)
    half = math.radians(light.size_deg)
    return np.asarray(np.clip((elevation + half - np.arctan(rise)) / (2 * half), 0.0, 1.0), dtype=np.float32)


def openness(z: Field, *, pitch_mm: float) -> Field:
    """Visible share of the dome at every sample, 0..1, from the sample's depth below its surroundings."""
    from glyphs.surface.blur import gaussian_blur

    share = np.ones_like(z)
    for reach_mm in (0.15, 0.45):
        below = gaussian_blur(z, reach_mm / pitch_mm, truncate=3.0) - z
        share /= 1.0 + (np.maximum(below, 0.0) * np.float32(1.4 / reach_mm)) ** 2
    return np.asarray(share, dtype=np.float32)
