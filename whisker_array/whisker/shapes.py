"""Straight, L-shaped and chain whiskers, and the tip model that contact mechanics needs.

World frame of the paper: x tracing direction, y up, z lateral. The base is ahead of and above the tip::

      y ^                              ,-o base (clamp; the sensor sits l3 below it)
        |                     l1    ,-'
        |                        ,-'   beta      r = tip - sensor = -(l1 c, l1 s + l2 - l3, 0)
        |                     ,-'- - - - - - -   m = e_z.(r x f)  = (l1 s + l2 - l3, -l1 c, 0).f
        |                  o-'
        |              l2  |                     the tip arm hangs vertically down from the end of l1
        |                  o tip  ---> traced in +x
        +-------------------------------> x

Only this geometry agrees with the printed D11 and T1: (18) is the arm to a tip behind and below the base.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, repeat
from typing import Annotated, TypeAlias

import numpy as np

from glyphs.ranges import Finite, NotNegative, Positive, Validated, freeze_arrays
from glyphs.surface.display import OneLine
from whisker_array.whisker.beam import Matrix, Segment, Vector, chain_compliance, cross_matrix
from whisker_array.whisker.sections import MUSIC_WIRE, UPRIGHT, Material, SectionLike, WhiskerError


@dataclass(frozen=True, eq=False, repr=False)
class TipModel(OneLine):
    """Compliance D11, mm/N, of the tip in world axes, and moment arm of the sensor: all that contact needs.

    `moment_arm_mm` (3,) is the third row of T1: m = moment_arm_mm . f. Raises WhiskerError.
    """

    compliance_mm_per_n: Matrix
    moment_arm_mm: Vector

    def __post_init__(self) -> None:
        freeze_arrays(WhiskerError, self, {"compliance_mm_per_n": (3, 3), "moment_arm_mm": (3,)})
        d = self.compliance_mm_per_n
        if np.abs(d - d.T).max() > 1e-9 * np.abs(d).max():
            raise WhiskerError(
                "D11 is not symmetric, so it would create energy from nothing", hint="check its terms"
            )
        d = (d + d.T) / 2.0
        eigen = np.linalg.eigvalsh(d)
        if not eigen[0] > 1e-14 * abs(eigen[-1]):
            raise WhiskerError(
                "D11 is not positive definite, unlike that of every beam. Keep the axial term of a straight whisker "
                "(axial=True), and use the corrected A11 of physics.md instead of the printed one"
            )
        d.flags.writeable = False
        object.__setattr__(self, "compliance_mm_per_n", d)

    def pushed(self) -> TipModel:
        """The same whisker pushed backwards, in the frame of travel: x is mirrored, and mu changes sign."""
        mirror = np.array([-1.0, 1.0, 1.0])
        return TipModel(self.compliance_mm_per_n * np.outer(mirror, mirror), self.moment_arm_mm * mirror)

    @property
    def stiffness_n_per_mm(self) -> Matrix:
        """(3, 3) float64 K = D11^-1, symmetric, N/mm."""
        k = np.linalg.inv(self.compliance_mm_per_n)
        return np.asarray((k + k.T) / 2.0)


def _model(segments: Sequence[Segment], lowered_mm: float, axial: bool) -> TipModel:
    r = segments[-1].end_mm - segments[0].start_mm + np.array([0.0, lowered_mm, 0.0])
    d11 = chain_compliance(segments, axial=axial)[:3, :3]
    return TipModel(d11, np.asarray(cross_matrix(r)[2]))


@dataclass(frozen=True, repr=False)
class LShaped(OneLine, Validated, error=WhiskerError):
    """The L-shaped whisker of Fig. 3, the differentiator. Raises WhiskerError.

    The tip arm, l2 >= 0, hangs vertically from the end of l1 at any beta. The sensor base is lowered towards the tip by
    l3; None means l3 = l2. A Taper is that of l1; the tip arm then has its end section.
    """

    l1_mm: Positive
    l2_mm: NotNegative
    l3_mm: Finite | None
    beta_rad: Annotated[float, UPRIGHT]
    section: SectionLike
    material: Material = MUSIC_WIRE

    @property
    def lowered_mm(self) -> float:
        return self.l2_mm if self.l3_mm is None else self.l3_mm

    @property
    def is_straight(self) -> bool:
        """Whether the whisker has no tip arm and its sensor sits on the clamp."""
        return self.l2_mm == self.lowered_mm == 0.0

    def segments(self) -> tuple[Segment, ...]:
        elbow = -self.l1_mm * np.array([math.cos(self.beta_rad), math.sin(self.beta_rad), 0.0])
        beam = Segment(np.zeros(3), elbow, self.section, self.material)
        tip = elbow - np.array([0.0, self.l2_mm, 0.0])
        if self.l2_mm <= 1e-12 * self.l1_mm:  # no tip arm, or one lost in rounding
            return (beam,)
        return (beam, Segment(elbow, tip, beam.section_at(1.0), self.material))

    def tip_model(self, *, axial: bool = True) -> TipModel:
        """Compute D11 and the moment arm; axial=False gives the inextensible D11 of (19) and (20), corrected."""
        return _model(self.segments(), self.lowered_mm, axial)

    @property
    def k(self) -> float:
        return self.l2_mm / self.l1_mm

    @property
    def reach_mm(self) -> float:
        """Reference length for the deflection in Assumption 1: l1, mm."""
        return self.l1_mm

    def describe(self) -> str:
        arm = f"l2 {self.l2_mm:g} mm (k = {self.k:.3f}), l3 {self.lowered_mm:g} mm"
        lengths = f"L-shaped whisker: l1 {self.l1_mm:g} mm, {arm}"
        if self.is_straight:
            lengths = f"straight whisker: l {self.l1_mm:g} mm"
        return f"{lengths}, beta {math.degrees(self.beta_rad):g} deg, {self.section}, {self.material.name}"


def straight_whisker(
    length_mm: float, beta_rad: float, section: SectionLike, material: Material = MUSIC_WIRE
) -> LShaped:
    """Make a straight whisker, the profiler of Sec. 3.5; without axial term D11 is singular. Raises WhiskerError."""
    return LShaped(length_mm, 0.0, 0.0, beta_rad, section, material)


@dataclass(frozen=True, eq=False, repr=False)
class Chain(OneLine, Validated, error=WhiskerError):
    """A whisker of straight segments between points; many short ones make a curve. Raises WhiskerError.

    `points_mm` (n + 1, 3), read-only, run from base to tip in the world frame (tip behind the base).
    """

    points_mm: Matrix
    sections: SectionLike | tuple[SectionLike, ...]
    material: Material = MUSIC_WIRE
    l3_mm: Finite = 0.0

    def __post_init__(self) -> None:
        freeze_arrays(WhiskerError, self, {"points_mm": ("n", 3)})
        points, n = self.points_mm, len(self.points_mm) - 1
        if n < 1:
            raise WhiskerError(f"points_mm has {n + 1} points", hint="it needs at least two")
        sections = self.sections
        if isinstance(sections, Sequence):
            sections = tuple(sections)
            if len(sections) != n:
                raise WhiskerError(
                    f"{len(sections)} sections for {n} segments",
                    hint="give one for each segment, or a single one",
                )
        if not points[-1, 0] < points[0, 0]:
            raise WhiskerError("the tip must lie behind the base (smaller x): a whisker is dragged along")
        super().__post_init__()
        object.__setattr__(self, "sections", sections)
        try:
            self.segments()
        except WhiskerError as error:
            raise WhiskerError(error.what, where="points_mm", hint=error.hint) from error

    def segments(self) -> tuple[Segment, ...]:
        sections = self.sections if isinstance(self.sections, tuple) else repeat(self.sections)
        pairs = zip(pairwise(self.points_mm), sections, strict=False)
        return tuple(Segment(start, end, section, self.material) for (start, end), section in pairs)

    def tip_model(self, *, axial: bool = True) -> TipModel:
        return _model(self.segments(), self.l3_mm, axial)

    @property
    def k(self) -> float:
        """Ratio l2 / l1 of the L-shaped whisker with l3 = l2 that has the same F.

        By (16) F depends only on A = -Dyx / Dyy and B = -arm_x / arm_y. For an L-shaped whisker with l3 = l2 they are
        tan(beta) + 1.5 k / c and tan(beta). If k is negative, the whisker weakens falling edges.
        """
        model = self.tip_model()
        row, arm = model.compliance_mm_per_n[1], model.moment_arm_mm
        a, b = -row[0] / row[1], -arm[0] / arm[1]
        return float((a - b) * 2.0 / 3.0 / math.hypot(1.0, b))

    @property
    def reach_mm(self) -> float:
        """Reference length for the deflection in Assumption 1: distance from base to tip, mm."""
        return float(np.linalg.norm(self.points_mm[-1] - self.points_mm[0]))

    def describe(self) -> str:
        return (
            f"chain of {len(self.points_mm) - 1} segments: reach {self.reach_mm:g} mm, effective k {self.k:.3f}, "
            f"{self.material.name}"
        )


Whisker: TypeAlias = LShaped | Chain
"""Any whisker; it has tip_model(), segments(), k, reach_mm, material and describe()."""
