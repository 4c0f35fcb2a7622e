"""Mount a height map as on a stage: small gaps filled, square to the whiskers, level."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap, MapError
from glyphs.surface.orientation import draw_triangles, rotation_to_z
from whisker_array.simulation.surface import check_soil

Floats: TypeAlias = NDArray[np.float64]
# fewer heights show no character; share of known samples from which they cannot lie on one line
_LEAST_HEIGHTS, _SURFACE_SHARE = 16, 0.1
# samples, standard deviation of places across a line: two whole rows have half a sample
_LEAST_SPREAD = 0.49


def fill_gaps(
    height_map: HeightMap,
    *,
    reach_mm: float = 0.1,
    least_reach_px: float = 1.5,
    least_share: float = 0.4,
    rounds: int = 16,
) -> HeightMap:
    """Fill gaps narrower than a stroke from the samples around them; larger holes stay NaN.

    Optical instruments leave single samples of bright metal, and whole lines, without a height. The fill is harmonic:
    each filled sample is the mean of its neighbours, so planes and level walls are continued exactly.

    Args:
        reach_mm: greatest distance of a filled sample from a measured one; strokes are at least 0.2 mm wide.
        least_reach_px: the same in samples, for coarse maps: single samples, lines, and pairs of them.
        least_share: least share measured within three samples of a filled one; with less, strokes would be invented.
    """
    z = height_map.z_mm
    missing = np.isnan(z)
    if not missing.any():
        return height_map
    reach = max(reach_mm / height_map.pitch_mm, least_reach_px)
    far, (row, col) = ndimage.distance_transform_edt(missing, return_indices=True)
    measured = ndimage.uniform_filter((~missing).astype(np.float32), 7, mode="nearest")
    fill = missing & (far <= reach) & (measured >= least_share)
    if not fill.any():
        return height_map
    wide = np.pad(np.where(fill, z[row, col], z), 1, constant_values=np.nan)
    index = np.flatnonzero(np.pad(fill, 1))
    flat, step = wide.ravel(), wide.shape[1]
    around = index + np.array([[-step], [-1], [1], [step]])
    known = np.isfinite(flat[around])
    around, count = np.where(known, around, index), known.sum(axis=0)
    for _ in range(rounds):
        flat[index] = np.where(known, flat[around], 0.0).sum(axis=0) / np.maximum(count, 1)
    return HeightMap(wide[1:-1, 1:-1], height_map.pitch_mm)


def filled_note(measured: HeightMap, mounted: HeightMap, *, least_share: float = 0.02) -> tuple[str, ...]:
    """Say how many samples of a map were filled when it was levelled; the rim of a mesh has less than `least_share`."""
    missing, left = (float(np.isnan(surface.z_mm).mean()) for surface in (measured, mounted))
    if missing - left < least_share:
        return ()
    return (
        f"{missing - left:.1%} of the samples are missing here and there, and were filled from their neighbours",
    )


def square_to_plate(
    height_map: HeightMap, soil: Soil | None = None, *, level_deg: float = 2.0, most_deg: float = 70.0
) -> tuple[HeightMap, Soil | None]:
    """Resample a tilted map square to its plate. Raises MapError: a soil on another grid, or too large a map.

    At 30 degrees, depths along z are 15 % too large, and characters 13 % too narrow along the slope. A map stays
    as it is up to `level_deg`, where depths are 0.06 % too large, and from `most_deg`: no instrument sees so far aside.
    """
    if soil is not None:
        check_soil(soil, height_map.shape)
    pitch, slope = height_map.pitch_mm, _plate_slope(height_map)
    if not level_deg < math.degrees(math.atan(math.hypot(*slope))) < most_deg:
        return height_map, soil
    z = fill_gaps(height_map).z_mm
    turn = rotation_to_z(np.append(-slope, 1.0))
    row, col = np.indices(z.shape)
    places = np.stack([pitch * col, pitch * row, z], axis=-1) @ turn.T
    corner = np.nanmin(places[..., :2], axis=(0, 1))
    places[..., :2] = (places[..., :2] - corner) / pitch
    cols, rows = np.nanmax(places[..., :2], axis=(0, 1)).astype(int) + 1
    out = np.full((rows, cols), np.nan)
    for first in range(0, len(z) - 1, 64):
        block = places[first : first + 65]
        k = np.arange(block[..., 0].size).reshape(block.shape[:2])
        a, b, c, d = k[:-1, :-1], k[:-1, 1:], k[1:, :-1], k[1:, 1:]
        faces = np.concatenate(
            [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, c, b), (b, c, d))]
        )
        block = block.reshape(-1, 3)
        draw_triangles(out, block, faces[np.isfinite(block[faces, 2]).all(axis=1)])
    if soil is not None:
        v, u = np.indices(out.shape)
        back = np.stack([pitch * u + corner[0], pitch * v + corner[1], np.nan_to_num(out)], axis=-1) @ turn
        source = np.clip(np.rint(back[..., 1::-1] / pitch), 0, np.array(z.shape) - 1).astype(np.intp)
        below = tuple(np.moveaxis(source, -1, 0))
        soil = Soil(soil.thickness_mm[below], soil.hardness_mpa[below], soil.friction[below])
    return HeightMap(out - np.nanmedian(out), pitch), soil


def _plate_slope(height_map: HeightMap, *, fewest: int = 100, differ: float = 0.3) -> Floats:
    """(2,) slope of the plate along x and y, the median one, of the land; 0 if the mean one differs."""
    z = height_map.z_mm
    lag, step = max(1, min(z.shape) // 50), max(1, int(np.sqrt(z.size / 40_000)))
    rises = (z[::step, lag::step] - z[::step, :-lag:step], z[lag::step, ::step] - z[:-lag:step, ::step])
    known = [rise[np.isfinite(rise)] for rise in rises]
    if min(rise.size for rise in known) < fewest:
        return np.zeros(2)
    median, mean = (
        np.array([measure(rise) for rise in known], dtype=np.float64) / (lag * height_map.pitch_mm)
        for measure in (np.median, np.mean)
    )
    return median if np.linalg.norm(mean - median) <= differ * np.linalg.norm(median) else np.zeros(2)


def level(height_map: HeightMap, *, degree: int = 2, rounds: int = 12) -> HeightMap:
    """Remove the shape of the land; larger holes stay NaN. Raises MapError if the heights are few, or lie on one line.

    Iteratively reweighted least squares with Tukey's biweight at three robust standard deviations, on a thinned grid.
    Only the mounting is imitated; edges are not filtered.
    """
    _check_spread(np.isfinite(height_map.z_mm))
    z = fill_gaps(height_map).z_mm
    rows, cols = z.shape
    step = max(1, int(np.sqrt(z.size / 40_000)))
    if not np.isfinite(z[::step, ::step]).any():  # such as each second row
        step = 1
    thin = np.ascontiguousarray(z[::step, ::step], dtype=np.float64)
    row_terms, col_terms = np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, cols)
    terms = _Terms(col_terms[::step], row_terms[::step], degree)
    known = np.isfinite(thin)
    weight = known.astype(np.float64)
    weighted = np.where(known, thin, 0.0)
    for _ in range(rounds):
        normal = terms.normal(weight)
        normal[np.diag_indices_from(normal)] += 1e-10 * np.count_nonzero(known)
        coefficients = np.asarray(np.linalg.solve(normal, terms.right(weighted)))
        over = thin - terms.surface(coefficients)
        middle = float(np.median(over[known]))
        spread = 1.4826 * float(np.median(np.abs(over[known] - middle)))
        if spread <= 0.0:
            break
        weight, weighted = _tukey(thin, over, middle, 3.0 * spread)
    out = z.copy()
    out -= terms.form(coefficients, col_terms, row_terms)
    out.flags.writeable = False  # so that it is not copied
    return HeightMap(out, height_map.pitch_mm)


def _check_spread(known: NDArray[np.bool_]) -> None:
    count = int(np.count_nonzero(known))
    if count < _LEAST_HEIGHTS:
        raise MapError(f"only {count} heights are known", hint="measure the surface again")
    if count < _SURFACE_SHARE * known.size:
        spread = np.linalg.eigvalsh(np.cov(np.nonzero(known)))
        if spread[0] < _LEAST_SPREAD**2:
            raise MapError("all known heights lie on one line, as a profile", hint="measure a surface")


class _Terms:
    def __init__(self, u: NDArray[np.float64], v: NDArray[np.float64], degree: int) -> None:
        pairs = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        self.power_u, self.power_v = np.array(pairs).T
        self._u, self._v = (np.vander(a, 2 * degree + 1, increasing=True) for a in (u, v))
        self._n = degree + 1

    def normal(self, weight: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = self._v.T @ (weight @ self._u)
        i, j = self.power_u, self.power_v
        return np.asarray(sums[j[:, None] + j, i[:, None] + i])

    def right(self, weighted: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = self._v[:, : self._n].T @ (weighted @ self._u[:, : self._n])
        return np.asarray(sums[self.power_v, self.power_u])

    def surface(self, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        table = np.zeros((self._n, self._n))
        table[self.power_v, self.power_u] = coefficients
        return np.asarray(self._v[:, : self._n] @ (table @ self._u[:, : self._n].T))

    def form(self, coefficients: Floats, u: Floats, v: Floats) -> NDArray[np.float32]:
        out = np.zeros((v.size, u.size), dtype=np.float32)
        for c, i, j in zip(coefficients.astype(np.float32), self.power_u, self.power_v, strict=True):
            out += c * np.outer(v**j, u**i).astype(np.float32)
        return out


def _tukey(z: Floats, over: Floats, middle: float, cut: float) -> tuple[Floats, Floats]:
    off = (over - middle) / cut
    weight = np.fmax(1.0 - off * off, 0.0) ** 2  # 0 for NaN, too
    return weight, np.where(weight > 0.0, weight * z, 0.0)
