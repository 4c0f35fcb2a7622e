"""Compliance of a chain of straight beam segments: D of the paper's eqs. (1) and (2) for any whisker shape.

    base                                   r(u) = tip - p(u), the arm of the tip force at the section u
     |=====o===== p(u) ====o               M(u) = r x f + m, the moment in the section (clamped base)
                 \\         |               kappa(u) = C(u) M(u), its bending and twist per length
                   \\ r(u)  |               delta = integral of kappa x r du,  theta = integral of kappa du
                     \\     |
                        `->o tip, f, m

so that D = sum over the segments of the integral of G^T C G du with G = ([r]x, I), plus the axial term
L/(EA) a a^T. Euler-Bernoulli beams: shear, rotary and warping terms are left out. Units: N, mm, rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import freeze_arrays
from glyphs.surface.display import OneLine
from whisker_array.whisker.sections import Material, Section, SectionLike, Taper, WhiskerError

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(8)
_TAPER_TOLERANCE = 1e-12
"""Panels are doubled until D changes by less than this share; the remaining error is far below 1e-10."""
_PANELS = tuple(2**k for k in range(10))
_WORLD_Z = np.array([0.0, 0.0, 1.0])
_WORLD_X = np.array([1.0, 0.0, 0.0])


def cross_matrix(r: Vector) -> Matrix:
    """[r]x of eq. (5): cross_matrix(r) @ f = r x f, for (3,) or (n, 3)."""
    return np.cross(np.eye(3), np.asarray(r, dtype=np.float64)[..., None, :])


@dataclass(frozen=True, eq=False, repr=False)
class Segment(OneLine):
    """One straight piece of a whisker, from the end nearer the base, mm, world frame. Raises WhiskerError."""

    start_mm: Vector
    end_mm: Vector
    section: SectionLike
    material: Material

    def __post_init__(self) -> None:
        freeze_arrays(WhiskerError, self, {"start_mm": (3,), "end_mm": (3,)})
        if not self.length_mm > 0.0:
            raise WhiskerError(
                f"segment at {self.start_mm} mm has no length", hint="remove it from the chain"
            )

    @cached_property
    def length_mm(self) -> float:
        return float(np.linalg.norm(self.end_mm - self.start_mm))

    @cached_property
    def axes(self) -> Matrix:
        """(3, 3) right-handed rows: along the segment, lateral (world z, or x, across it), vertical."""
        along = (self.end_mm - self.start_mm) / self.length_mm
        lateral = _WORLD_Z - along * along[2]
        if np.linalg.norm(lateral) < 1e-9:
            lateral = _WORLD_X - along * along[0]
        lateral = lateral / np.linalg.norm(lateral)
        return np.array([along, lateral, np.cross(along, lateral)])

    def section_at(self, t: float) -> Section:
        if isinstance(self.section, Taper):
            return self.section.start.blend(self.section.end, t)
        return self.section

    def section_compliances(self, fractions: Vector) -> Matrix:
        """(n, 3, 3) C of physics.md at the shares (n,) of the length: twist and curvature per moment, 1/(N mm^2)."""
        e, g = self.material.e_mpa, self.material.g_mpa
        sections = [self.section_at(float(t)) for t in fractions]
        about = np.array([(g * s.j_mm4, e * s.i_vertical_mm4, e * s.i_lateral_mm4) for s in sections])
        return np.stack([self.axes.T @ (self.axes / each[:, None]) for each in about])

    def points_mm(self, fractions: Vector) -> Matrix:
        return self.start_mm + fractions[:, None] * (self.end_mm - self.start_mm)


def _integrate(segment: Segment, tip: Vector, t: Vector, weight: Vector, axial: bool) -> Matrix:
    points = segment.points_mm(t)
    arms = np.concatenate([cross_matrix(tip - points), np.broadcast_to(np.eye(3), (t.size, 3, 3))], axis=2)
    c = segment.section_compliances(t)
    d = np.asarray((np.swapaxes(arms, 1, 2) @ c @ arms * weight[:, None, None]).sum(axis=0))
    if axial:
        ea = np.array([segment.material.e_mpa * segment.section_at(float(u)).area_mm2 for u in t])
        along = segment.axes[0]
        d[:3, :3] += (weight / ea).sum() * np.outer(along, along)
    return d * segment.length_mm


def _segment_compliance(segment: Segment, tip: Vector, axial: bool) -> Matrix:
    if not isinstance(segment.section, Taper):
        return _integrate(segment, tip, np.array([0.0, 0.5, 1.0]), np.array([1.0, 4.0, 1.0]) / 6.0, axial)
    previous: Matrix | None = None
    for panels in _PANELS:
        t = ((np.arange(panels)[:, None] + (1.0 + _GAUSS_X) / 2.0) / panels).ravel()
        d = _integrate(segment, tip, t, np.tile(_GAUSS_W / (2.0 * panels), panels), axial)
        if previous is not None:
            change, size = (np.abs(m).reshape(2, 3, 2, 3).max(axis=(1, 3)) for m in (d - previous, d))
            if (change <= _TAPER_TOLERANCE * size).all():  # in each block of D
                return d
        previous = d
    raise WhiskerError(
        "the taper is too steep to integrate", hint="make its thin end thicker or split the segment"
    )


def chain_compliance(segments: Sequence[Segment], *, axial: bool = True) -> Matrix:
    """Compliance D of eqs. (1) and (2) at the tip of a chain clamped at its base. Raises WhiskerError.

    Returns (6, 6), symmetric: [delta; theta] = D [f; m] in world axes. Blocks D11 mm/N, D12 1/N (mm per N mm), D21
    rad/N, D22 rad/(N mm). Exact for constant sections, within 1e-10 for tapers. `axial` includes the stretching term
    L/(EA) a a^T: the paper's closed forms leave it out, but without it a straight whisker's D11 is singular.
    """
    if not segments:
        raise WhiskerError("a chain needs at least one segment")
    total = sum(s.length_mm for s in segments)
    for i, (segment, following) in enumerate(pairwise(segments)):
        gap = float(np.linalg.norm(following.start_mm - segment.end_mm))
        if gap > 1e-9 * total:
            raise WhiskerError(
                f"segment {i + 1} starts {gap:.3g} mm away from the end of segment {i}",
                hint="list them base to tip",
            )
    tip = segments[-1].end_mm
    d = sum((_segment_compliance(segment, tip, axial) for segment in segments), np.zeros((6, 6)))
    return np.asarray((d + d.T) / 2.0)
