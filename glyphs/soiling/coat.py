"""A part's surface while dirt settles on it, and its optical properties.

Every kind of dirt is a function from one `Coat` to the next (`wear`, `films`, `grime`, `debris`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.ranges import Range, freeze_arrays, require_range
from glyphs.stamping.forms import PlateForm
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError
from glyphs.surface.noise import Field, bilinear, smooth_noise

STEEL_FRICTION = 0.2
STEEL_HARDNESS_MPA = 2000.0
"""Hardness of bare metal, which does not yield to the tip's load."""
_STEEL_ALBEDO = (0.20, 0.195, 0.185)
_STEEL_REFLECTANCE = 0.55
_STEEL_ROUGHNESS = 0.34


@dataclass(frozen=True, eq=False, repr=False)
class Look(OneLine):
    """Optical properties of a surface, sample by sample. Raises MapError.

    Attributes:
        albedo: (rows, cols, 3) float32, 0 to 1: share of red, green and blue light reflected diffusely.
        roughness: (rows, cols) float32, above 0 to 1: slope spread of its microfacets; small is glossy.
        reflectance: (rows, cols) float32, 0 to 1: share mirrored at normal incidence (oil, paint 0.04; steel 0.55).
    """

    albedo: NDArray[np.float32]
    roughness: NDArray[np.float32]
    reflectance: NDArray[np.float32]

    def __post_init__(self) -> None:
        grid = ("rows", "cols")
        shapes = {"roughness": grid, "albedo": (*grid, 3), "reflectance": grid}
        freeze_arrays(MapError, self, shapes, least=0.0, most=1.0, dtype=np.float32)
        require_range(MapError, Range(1e-3, 1.0), least_roughness=float(self.roughness.min()))


@dataclass(frozen=True, eq=False, repr=False)
class Coat(OneLine):
    """A surface while it is being soiled, (rows, cols) float32; up to `brim_mm`, the land, a hollow can be filled."""

    pitch_mm: float
    height_mm: float
    clean_mm: Field
    brim_mm: Field
    z_mm: Field
    soft_mm: Field
    hardness_mpa: Field
    friction: Field
    albedo: NDArray[np.float32]
    roughness: Field
    reflectance: Field

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return (self.z_mm.shape[0], self.z_mm.shape[1])

    @property
    def area_mm2(self) -> float:
        return self.z_mm.size * self.pitch_mm**2

    def hollow_mm(self) -> Field:
        """Depth of the top below the brim, at least 0."""
        return np.asarray(np.maximum(self.brim_mm - self.z_mm, 0.0), dtype=np.float32)

    def noise(self, length_mm: float, rng: np.random.Generator) -> Field:
        return smooth_noise(self.shape, pitch_mm=self.pitch_mm, length_mm=length_mm, rng=rng)

    def under_film(self, thickness_mm: Field, hardness_mpa: ArrayLike, friction: Field) -> Coat:
        """Cover the coat with a film; it is soft where it is thicker than 0.1 um."""
        lies = thickness_mm > 1e-4
        return replace(
            self,
            z_mm=self.z_mm + thickness_mm,
            soft_mm=np.where(lies, thickness_mm, self.soft_mm),
            hardness_mpa=np.where(lies, np.asarray(hardness_mpa, np.float32), self.hardness_mpa),
            friction=friction.astype(np.float32),
        )

    def shaded(
        self,
        cover: Field,
        *,
        albedo: ArrayLike | None = None,
        roughness: ArrayLike | None = None,
        reflectance: ArrayLike | None = None,
    ) -> Coat:
        """Mix another look into the coat, by the share `cover` (0 to 1)."""
        w = cover.astype(np.float32)
        changes: dict[str, NDArray[np.float32]] = {}
        if albedo is not None:
            new = np.asarray(albedo, dtype=np.float32)
            changes["albedo"] = np.clip(self.albedo + w[..., None] * (new - self.albedo), 0.0, 1.0)
        for name, value in (("roughness", roughness), ("reflectance", reflectance)):
            if value is not None:
                old = getattr(self, name)
                changes[name] = np.clip(old + w * (np.asarray(value, np.float32) - old), 0.02, 1.0)
        return replace(self, **changes)  # type: ignore[arg-type]


def bare_coat(part: StampedPart, *, rng: np.random.Generator) -> Coat:
    """A clean part, with the look of machined steel. Raises MapError if the map has dropouts."""
    z = part.height_map.z_mm
    if np.isnan(z).any():
        raise MapError("the height map has dropouts", hint="soil a part without dropouts")
    pitch = part.height_map.pitch_mm
    shape = part.height_map.shape
    tint = np.array(_STEEL_ALBEDO) * rng.uniform(0.8, 1.25) * (1.0 + 0.03 * rng.standard_normal(3))
    mottle = smooth_noise(shape, pitch_mm=pitch, length_mm=0.6 * part.height_mm, rng=rng)
    shine = rng.uniform(0.8, 1.3)
    bright = np.float32(1.0) + 0.04 * mottle
    return Coat(
        pitch_mm=pitch,
        height_mm=part.height_mm,
        clean_mm=z,
        brim_mm=_brim_mm(part),
        z_mm=z,
        soft_mm=np.zeros(shape, np.float32),
        hardness_mpa=np.full(shape, STEEL_HARDNESS_MPA, np.float32),
        friction=np.full(shape, STEEL_FRICTION, np.float32),
        albedo=np.stack([np.clip(bright * t, 0.02, 0.9) for t in tint.astype(np.float32)], axis=-1),
        roughness=np.clip(np.float32(_STEEL_ROUGHNESS * shine) * (np.float32(1.0) + 0.05 * mottle), 0.1, 0.8),
        reflectance=np.full(shape, _STEEL_REFLECTANCE, np.float32),
    )


def _brim_mm(part: StampedPart) -> Field:
    from scipy.ndimage import gaussian_filter

    from glyphs.surface.blur import gaussian_blur

    z, pitch, size = part.height_map.z_mm, part.height_map.pitch_mm, part.height_mm
    rows, cols = z.shape
    if not part.form.flat:
        bent = part.form.height_mm(*((np.arange(n) - (n - 1) / 2) * pitch for n in (cols, rows)))
        flat = replace(part, height_map=HeightMap(z - bent, pitch), form=PlateForm())
        return np.asarray(_brim_mm(flat) + bent, dtype=np.float32)
    land = np.ones(z.shape, dtype=bool)
    rim = 0.12 * size
    for x0, y0, x1, y1 in part.inked_mm:
        columns = slice(max(0, int((x0 - rim) / pitch)), max(0, int((x1 + rim) / pitch) + 1))
        lines = slice(max(0, int((y0 - rim) / pitch)), max(0, int((y1 + rim) / pitch) + 1))
        land[lines, columns] = False
    if land.mean() < 0.05:
        return gaussian_blur(z, 0.5 * size / pitch)
    # a plane through the land, plus its residual averaged over about a character, on a thinned grid
    step = max(1, int(0.04 * size / pitch))
    v, u = np.linspace(-1, 1, rows)[:, None], np.linspace(-1, 1, cols)[None, :]
    terms = np.stack(np.broadcast_arrays(1.0, u[:, ::step], v[::step]), axis=-1)
    seen, weight = z[::step, ::step], land[::step, ::step]
    plane, *_ = np.linalg.lstsq(terms[weight], seen[weight], rcond=None)
    uneven = np.where(weight, seen - terms @ plane, 0.0)
    sigma = 0.35 * size / (pitch * step)
    near = gaussian_filter(weight.astype(np.float64), sigma, mode="nearest")
    wave = gaussian_filter(uneven, sigma, mode="nearest") / np.maximum(near, 1e-3)
    where = (np.linspace(0, (rows - 1) / step, rows), np.linspace(0, (cols - 1) / step, cols))
    brim = plane[0] + plane[1] * u + plane[2] * v + bilinear(wave, *where)
    inked = ~land
    if inked.any() and float((z - brim)[inked].mean()) > 0.0:
        return gaussian_blur(z, 0.15 * size / pitch)
    return np.asarray(brim, dtype=np.float32)
