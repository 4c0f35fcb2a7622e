"""Whiskers: straight, L-shaped and any chain, and what contact needs to know of one: its TipModel.

World frame of the paper: x tracing direction, y up, z lateral. The base is ahead of and above the tip::

      y ^                              ,-o base (clamp; the sensor sits l3 below it)
        |                     l1    ,-'
        |                        ,-'   beta      r = tip - sensor = -(l1 c, l1 s + l2 - l3, 0)
        |                     ,-'- - - - - - -   m = e_z.(r x f)  = (l1 s + l2 - l3, -l1 c, 0).f
        |                  o-'
        |              l2  |                     the tip arm hangs vertically down from the end of l1
        |                  o tip  ---> traced in +x
        +-------------------------------> x

(The printed D11 and T1 agree with this reading only: (18) is the arm to a tip behind and below.)
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from whisker_array import enhancement
from whisker_array.beam import BeamError, Segment, chain_compliance, cross_matrix, split
from whisker_array.sections import MUSIC_WIRE, Material, Rectangle, Section, SectionLike, Taper

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class WhiskerError(ValueError):
    """A whisker that cannot be one: its message says what is wrong and how to mend it."""


def _positive(name: str, value: float) -> float:
    number = float(value)
    if not math.isfinite(number) or number <= 0.0:
        raise WhiskerError(f"{name} is {value}; it must be a positive number")
    return number


def _check_beta(beta_rad: float) -> None:
    if not abs(beta_rad) < math.pi / 2.0:
        raise WhiskerError(f"beta_rad is {beta_rad}; it must be within -pi/2 to pi/2 (radians, not degrees)")


@dataclass(frozen=True, eq=False)
class TipModel:
    """All that the contact has to know of a whisker: how its tip yields and what its sensor feels.

    Attributes:
        compliance_mm_per_n: (3, 3) float64, D11 in world axes, mm/N; symmetric positive definite, read-only.
        moment_arm_mm: (3,) float64, third row of T1: m = moment_arm_mm . f, N mm, read-only.

    Raises:
        WhiskerError: wrong shapes, not finite, not symmetric, not positive definite.
    """

    compliance_mm_per_n: Matrix
    moment_arm_mm: Vector

    def __post_init__(self) -> None:
        d = np.array(self.compliance_mm_per_n, dtype=np.float64)
        arm = np.array(self.moment_arm_mm, dtype=np.float64)
        if d.shape != (3, 3) or arm.shape != (3,):
            raise WhiskerError(f"D11 is {d.shape} and the arm {arm.shape}; they must be (3, 3) and (3,)")
        if not (np.isfinite(d).all() and np.isfinite(arm).all()):
            raise WhiskerError("D11 and the moment arm must be finite")
        if np.abs(d - d.T).max() > 1e-9 * np.abs(d).max():
            raise WhiskerError("D11 is not symmetric, so it would make energy of nothing; check its terms")
        d = (d + d.T) / 2.0
        eigen = np.linalg.eigvalsh(d)
        if not eigen[0] > 1e-14 * abs(eigen[-1]):
            raise WhiskerError(
                "D11 is not positive definite: no beam is so. Keep the axial term of a straight whisker "
                "(axial=True), and use the corrected A11 of physics.md instead of the printed one"
            )
        d.flags.writeable = False
        arm.flags.writeable = False
        object.__setattr__(self, "compliance_mm_per_n", d)
        object.__setattr__(self, "moment_arm_mm", arm)

    @property
    def stiffness_n_per_mm(self) -> Matrix:
        """(3, 3) float64 K = D11^-1, symmetric, N/mm."""
        k = np.linalg.inv(self.compliance_mm_per_n)
        return np.asarray((k + k.T) / 2.0)


def _model(segments: Sequence[Segment], lowered_mm: float, axial: bool) -> TipModel:
    r = segments[-1].end_mm - segments[0].start_mm + np.array([0.0, lowered_mm, 0.0])
    d11 = chain_compliance(segments, axial=axial)[:3, :3]
    return TipModel(d11, np.asarray(cross_matrix(r)[2]))


@dataclass(frozen=True)
class Straight:
    """A straight whisker, the profilometer of Sec. 3.5: F = 1 whatever the friction.

    Attributes:
        length_mm: l, mm.
        beta_rad: setting angle from the horizontal, rad, |beta| < pi/2.
        section: constant section, or a Taper from base to tip.
        material: what it is made of.

    Raises:
        WhiskerError: a length not positive, an angle out of range.
    """

    length_mm: float
    beta_rad: float
    section: SectionLike
    material: Material = MUSIC_WIRE

    def __post_init__(self) -> None:
        object.__setattr__(self, "length_mm", _positive("length_mm", self.length_mm))
        _check_beta(self.beta_rad)

    def segments(self) -> tuple[Segment, ...]:
        """The one segment, base at the origin."""
        tip = -self.length_mm * np.array([math.cos(self.beta_rad), math.sin(self.beta_rad), 0.0])
        return (Segment(np.zeros(3), tip, self.section, self.material),)

    def tip_model(self, *, axial: bool = True) -> TipModel:
        """D11 and moment arm. axial=False raises WhiskerError: inextensible, D11 is singular."""
        return _model(self.segments(), 0.0, axial)

    @property
    def k(self) -> float:
        """l2 / l1 = 0."""
        return 0.0

    @property
    def reach_mm(self) -> float:
        """The length against which Assumption 1 measures the deflection: l, mm."""
        return self.length_mm

    def describe(self) -> str:
        """One line for people."""
        return (
            f"straight whisker: l {self.length_mm:g} mm, beta {math.degrees(self.beta_rad):g} deg, "
            f"{self.section}, {self.material.name}"
        )


@dataclass(frozen=True)
class LShaped:
    """The L-shaped whisker of Fig. 3, the differentiator.

    Attributes:
        l1_mm: beam length, mm.
        l2_mm: tip-arm length, mm, >= 0; hangs vertically down from the end of l1 whatever beta is.
        l3_mm: how far the sensor base is lowered towards the tip, mm; None means l3 = l2.
        beta_rad: setting angle of l1 from the horizontal, rad.
        section: constant section of both arms, or a Taper over l1 (the tip arm then has its end section).
        material: what it is made of.

    Raises:
        WhiskerError: a length or angle out of range.
    """

    l1_mm: float
    l2_mm: float
    l3_mm: float | None
    beta_rad: float
    section: SectionLike
    material: Material = MUSIC_WIRE

    def __post_init__(self) -> None:
        object.__setattr__(self, "l1_mm", _positive("l1_mm", self.l1_mm))
        if not (math.isfinite(self.l2_mm) and self.l2_mm >= 0.0):
            raise WhiskerError(f"l2_mm is {self.l2_mm}; the tip arm's length is finite and not negative")
        if self.l3_mm is not None and not math.isfinite(self.l3_mm):
            raise WhiskerError(f"l3_mm is {self.l3_mm}; give a finite length, or None for l3 = l2")
        _check_beta(self.beta_rad)

    @property
    def lowered_mm(self) -> float:
        """l3, mm, with the default filled in."""
        return self.l2_mm if self.l3_mm is None else self.l3_mm

    def segments(self) -> tuple[Segment, ...]:
        """l1 and the tip arm, base at the origin."""
        elbow = -self.l1_mm * np.array([math.cos(self.beta_rad), math.sin(self.beta_rad), 0.0])
        beam = Segment(np.zeros(3), elbow, self.section, self.material)
        tip = elbow - np.array([0.0, self.l2_mm, 0.0])
        if self.l2_mm <= 1e-12 * self.l1_mm:  # no tip arm, or one lost in rounding
            return (beam,)
        return (beam, Segment(elbow, tip, beam.section_at(1.0), self.material))

    def tip_model(self, *, axial: bool = True) -> TipModel:
        """D11 and moment arm; axial=False gives the inextensible D11 of (19), (20) corrected."""
        return _model(self.segments(), self.lowered_mm, axial)

    @property
    def k(self) -> float:
        """l2 / l1."""
        return self.l2_mm / self.l1_mm

    @property
    def reach_mm(self) -> float:
        """The length against which Assumption 1 measures the deflection: l1, mm."""
        return self.l1_mm

    def describe(self) -> str:
        """One line for people."""
        return (
            f"L-shaped whisker: l1 {self.l1_mm:g} mm, l2 {self.l2_mm:g} mm (k = {self.k:.3f}), "
            f"l3 {self.lowered_mm:g} mm, beta {math.degrees(self.beta_rad):g} deg, "
            f"{self.section}, {self.material.name}"
        )


@dataclass(frozen=True, eq=False)
class Chain:
    """A whisker of any shape: straight segments between points (a curve is many short ones).

    Attributes:
        points_mm: (n + 1, 3) float64, base to tip, world frame (tip behind the base), mm; read-only.
        sections: one section (or Taper) for every segment: n of them; a single one is used throughout.
        material: what it is made of.
        l3_mm: how far the sensor base is lowered below the first point, mm.

    Raises:
        WhiskerError: fewer than two points, not finite, wrong number of sections, a tip ahead of its base.
    """

    points_mm: Matrix
    sections: SectionLike | tuple[SectionLike, ...]
    material: Material = MUSIC_WIRE
    l3_mm: float = 0.0

    def __post_init__(self) -> None:
        points = np.array(self.points_mm, dtype=np.float64)
        if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise WhiskerError(f"points_mm is {points.shape}; it needs at least two finite points (x, y, z)")
        n = len(points) - 1
        sections = self.sections
        if isinstance(sections, Sequence):
            sections = tuple(sections)
            if len(sections) != n:
                raise WhiskerError(f"{len(sections)} sections for {n} segments; give one for each, or one")
        if not points[-1, 0] < points[0, 0]:
            raise WhiskerError("the tip must lie behind the base (smaller x): a whisker is dragged along")
        if not math.isfinite(self.l3_mm):
            raise WhiskerError(f"l3_mm is {self.l3_mm}; it must be finite")
        points.flags.writeable = False
        object.__setattr__(self, "points_mm", points)
        object.__setattr__(self, "sections", sections)
        try:
            self.segments()
        except BeamError as error:
            raise WhiskerError(f"points_mm: {error}") from error

    def segments(self) -> tuple[Segment, ...]:
        """The segments, base to tip."""
        n = len(self.points_mm) - 1
        each = self.sections if isinstance(self.sections, tuple) else (self.sections,) * n
        return tuple(
            Segment(self.points_mm[i], self.points_mm[i + 1], each[i], self.material) for i in range(n)
        )

    def tip_model(self, *, axial: bool = True) -> TipModel:
        """D11 and moment arm."""
        return _model(self.segments(), self.l3_mm, axial)

    @property
    def k(self) -> float:
        """The l2 / l1 of an L-shaped whisker with l3 = l2 that has the same F as this one.

        By (16) F depends on A = -Dyx / Dyy and B = -arm_x / arm_y only; for the L with l3 = l2 they are
        tan(beta) + 1.5 k / c and tan(beta). Negative: this whisker dulls falling edges.
        """
        model = self.tip_model()
        row, arm = model.compliance_mm_per_n[1], model.moment_arm_mm
        a, b = -row[0] / row[1], -arm[0] / arm[1]
        return float((a - b) * 2.0 / 3.0 / math.hypot(1.0, b))

    @property
    def reach_mm(self) -> float:
        """The length against which Assumption 1 measures the deflection: from base to tip, mm."""
        return float(np.linalg.norm(self.points_mm[-1] - self.points_mm[0]))

    def describe(self) -> str:
        """One line for people."""
        return (
            f"chain of {len(self.points_mm) - 1} segments: reach {self.reach_mm:g} mm, felt k {self.k:.3f}, "
            f"{self.material.name}"
        )


Whisker: TypeAlias = Straight | LShaped | Chain
"""Any whisker: has tip_model(), segments(), k, reach_mm, material and describe()."""


def straight_compliance(length_mm: float, beta_rad: float, section: Section, material: Material) -> Matrix:
    """Eq. (17): D11 of an inextensible straight whisker, (3, 3) float64, mm/N; singular along the whisker.

    The print has a round section in mind; for others the lateral term is l^3 / (3 E I_lateral).
    """
    c, s = math.cos(beta_rad), math.sin(beta_rad)
    lateral = section.i_vertical_mm4 / section.i_lateral_mm4
    a = np.array([[s * s, -s * c, 0.0], [-s * c, c * c, 0.0], [0.0, 0.0, lateral]])
    return np.asarray(length_mm**3 / (3.0 * material.e_mpa * section.i_vertical_mm4) * a)


def straight_moment_arm(length_mm: float, beta_rad: float) -> Vector:
    """Eq. (18), third row of T1: l (s, -c, 0), (3,) float64, mm.

    The printed row is that of a tip behind and below the base: base ahead of and above the tip.
    """
    return length_mm * np.array([math.sin(beta_rad), -math.cos(beta_rad), 0.0])


def l_shaped_compliance(
    l1_mm: float, l2_mm: float, beta_rad: float, section: Section, material: Material
) -> Matrix:
    """Eqs. (19) and (20), corrected: D11 = l1^3 / (3 E I) A, inextensible L-shaped whisker, (3, 3), mm/N.

    The print is wrong in two terms (physics.md). Castigliano, with k = l2 / l1 and I, I' for
    vertical and lateral bending::

        A11 = s^2 + 3 k s + 3 k^2 + k^3                              printed: s^2 + 1.5 k s + k^3
        A12 = -s c - 1.5 k c                                         as printed
        A22 = c^2                                                    as printed
        A33 = I/I' (1 + 3 k s + 3 k^2 s^2 + k^3) + 3 k^2 c^2 EI/GJ   printed: without the two s terms, I = I'

    A lateral force at the tip has the arm u + l2 s about the in-plane axis across l1 and twists l1 by l2 c:
    hence the s terms. With the printed A11 the matrix is not positive definite at beta = 0. F is
    untouched: it uses row y only.
    """
    c, s = math.cos(beta_rad), math.sin(beta_rad)
    k = l2_mm / l1_mm
    ei = material.e_mpa * section.i_vertical_mm4
    gj = material.g_mpa * section.j_mm4
    a11 = s * s + 3.0 * k * s + 3.0 * k * k + k**3
    a12 = -s * c - 1.5 * k * c
    bend = 1.0 + 3.0 * k * s + 3.0 * k * k * s * s + k**3
    a33 = section.i_vertical_mm4 / section.i_lateral_mm4 * bend + 3.0 * k * k * c * c * ei / gj
    a = np.array([[a11, a12, 0.0], [a12, c * c, 0.0], [0.0, 0.0, a33]])
    return np.asarray(l1_mm**3 / (3.0 * ei) * a)


def l_shaped_moment_arm(l1_mm: float, l2_mm: float, l3_mm: float, beta_rad: float) -> Vector:
    """Eq. (21), third row of T1: (l1 s + l2 - l3, -l1 c, 0), (3,) float64, mm; frame as in eq. (18)."""
    return np.array([l1_mm * math.sin(beta_rad) + l2_mm - l3_mm, -l1_mm * math.cos(beta_rad), 0.0])


DEFAULT_K = 0.117
"""The strongest differentiator of the paper's experiments."""


def default_whisker(character_height_mm: float) -> LShaped:
    """A ribbon L-shaped whisker for characters of this height H, every dimension in proportion to H.

    l1 = 6 H, k = 0.117, beta = 0, l3 = l2; music-wire ribbon 0.06 H thick and 0.9 H wide. The width
    is set by the lateral stiffness: what counts sideways is I/I' (1 + k^3) + 3 k^2 EI/GJ, and the twist of l1
    under the tip arm leaves a ratio Dyy/Dzz of at most 38 however wide the ribbon (17 at 6 thicknesses, 31 at
    15). Stress on the land is about 5 % of yield at every H; natural frequency goes as 1/H, moment as H^3.

    Raises:
        WhiskerError: a height that is not positive.
    """
    h = _positive("character_height_mm", character_height_mm)
    return LShaped(
        l1_mm=6.0 * h,
        l2_mm=6.0 * h * DEFAULT_K,
        l3_mm=None,
        beta_rad=0.0,
        section=Rectangle(thickness_mm=0.06 * h, width_mm=0.9 * h),
        material=MUSIC_WIRE,
    )


def default_preload_mm(character_height_mm: float) -> float:
    """Preload depth d0 = 0.2 H, mm: four to six times the usual mark depth."""
    return 0.2 * _positive("character_height_mm", character_height_mm)


def land_force_n(whisker: Whisker, *, preload_mm: float, mu: float) -> Vector:
    """Contact force on the tip sliding on the land, (3,) float64, N: eqs. (10) and (11) at h = 0."""
    f_n = enhancement.normal_force_n(whisker.tip_model(), lift_mm=preload_mm, mu=mu)
    return enhancement.contact_force(f_n, alpha_rad=0.0, mu=mu)


def preload_stress_mpa(whisker: Whisker, *, preload_mm: float, mu: float) -> float:
    """Peak bending stress M c / I on the land at this preload, MPa.

    Vertical and lateral bending are added (exact at the corners of a rectangle, on the safe side for round
    wire; a planar whisker has no lateral part). Looked at are both ends of every segment and 33 places of a
    taper.
    """
    force = land_force_n(whisker, preload_mm=preload_mm, mu=mu)
    segments = whisker.segments()
    tip = segments[-1].end_mm
    peak = 0.0
    for segment in segments:
        places = np.linspace(0.0, 1.0, 33 if isinstance(segment.section, Taper) else 2)
        _, lateral, vertical = segment.axes
        for t in places:
            section = segment.section_at(float(t))
            point = segment.start_mm + t * (segment.end_mm - segment.start_mm)
            moment = np.cross(tip - point, force)
            up_down = abs(float(moment @ lateral)) * section.c_vertical_mm / section.i_vertical_mm4
            sideways = abs(float(moment @ vertical)) * section.c_lateral_mm / section.i_lateral_mm4
            peak = max(peak, up_down + sideways)
    return peak


def deflection_ratio(whisker: Whisker, *, preload_mm: float, mu: float) -> float:
    """Tip deflection |D11 f| on the land over l1 (other whiskers: their reach), for Assumption 1."""
    force = land_force_n(whisker, preload_mm=preload_mm, mu=mu)
    return float(np.linalg.norm(whisker.tip_model().compliance_mm_per_n @ force)) / whisker.reach_mm


def first_bending_frequency_hz(
    whisker: Whisker, *, tip_mass_g: float = 0.0, tip_held: bool = False, parts: int = 24
) -> float:
    """Lowest natural frequency of the whisker in any direction, Hz, for Assumption 5.

    Mass is lumped at the joints of `parts` pieces a segment; the flexibility between the joints is exact.
    Within 0.2 % of 3.516 / (2 pi l^2) sqrt(EI / rho A) for a straight whisker. Rotary inertia is left out.

    Args:
        whisker: the whisker, clamped at its base.
        tip_mass_g: mass of a ball at the tip, g.
        tip_held: the tip is held in height by contact, which is 4.4 times faster for a straight whisker. The
            free whisker is on the safe side.
        parts: pieces a segment.

    Raises:
        WhiskerError: a negative tip mass.
    """
    if not (math.isfinite(tip_mass_g) and tip_mass_g >= 0.0):
        raise WhiskerError(f"tip_mass_g is {tip_mass_g}; it must be finite and not negative")
    pieces = [piece for segment in whisker.segments() for piece in split(segment, parts)]
    n = len(pieces)
    joints = np.stack([piece.end_mm for piece in pieces])
    mass = np.zeros(n + 1)
    strain = np.zeros((2 * n, 3, n, 3))
    for e, piece in enumerate(pieces):
        share = piece.material.density_t_mm3 * piece.section_at(0.5).area_mm2 * piece.length_mm / 2.0
        mass[e : e + 2] += share
        for g, t in enumerate((0.5 - math.sqrt(1.0 / 12.0), 0.5 + math.sqrt(1.0 / 12.0))):
            root = np.linalg.cholesky(piece.section_compliance(t) * (piece.length_mm / 2.0)).T
            point = piece.start_mm + t * (piece.end_mm - piece.start_mm)
            strain[2 * e + g, :, e:, :] = np.moveaxis(root @ cross_matrix(joints[e:] - point), 0, 1)
    mass[-1] += tip_mass_g * 1e-6
    weighted = (strain * np.sqrt(mass[1:])[:, None]).reshape(6 * n, 3 * n)
    if tip_held:
        reaction = strain[:, :, -1, 1].ravel()
        weighted -= np.outer(reaction, reaction @ weighted) / (reaction @ reaction)
    slowest = float(np.linalg.norm(weighted, 2)) ** 2
    return 1.0 / (2.0 * math.pi * math.sqrt(slowest))


DEFLECTION_LIMIT = 0.1
"""Largest tip deflection over l1 under Assumption 1."""
PRELOAD_MARGIN = 1.2
"""Least preload over mark depth, so that contact is kept on the groove floor (Assumption 3)."""
QUASI_STATIC_SHARE = 0.1
"""Largest signal frequency over the first bending frequency: resonance then adds about 1 % (Assumption 5)."""
STEEPEST_BEVEL_RAD = math.pi / 3.0
"""The paper: the slopes given by dies are at most 60 degrees."""


class Validity(enum.Flag):
    """What stands against a whisker and its use; empty when nothing does."""

    NONE = 0
    DEFLECTION_OVER_10_PERCENT = enum.auto()
    STRESS_OVER_YIELD = enum.auto()
    PRELOAD_BELOW_MARK_DEPTH = enum.auto()
    NOT_QUASI_STATIC = enum.auto()
    JAMMING = enum.auto()


_MESSAGES = {
    Validity.DEFLECTION_OVER_10_PERCENT: (
        "the tip bends by more than 10 % of l1, so linear beam theory (Assumption 1) no longer holds: "
        "lower the preload or lengthen the whisker"
    ),
    Validity.STRESS_OVER_YIELD: (
        "the preload strains the whisker beyond its yield stress and would leave it bent: "
        "lower the preload, or take a thinner or longer whisker"
    ),
    Validity.PRELOAD_BELOW_MARK_DEPTH: (
        "the preload is less than 1.2 times the mark depth, so the tip may leave the groove floor "
        "(Assumption 3): raise the preload"
    ),
    Validity.NOT_QUASI_STATIC: (
        "the finest detail passes at more than a tenth of the whisker's first natural frequency "
        "(Assumption 5): scan slower, or take a shorter or thicker whisker"
    ),
    Validity.JAMMING: (
        "on the steepest bevel, or on the land, the contact force cannot lift the tip and the whisker jams: "
        "take a smaller k, less friction or another setting angle"
    ),
}


def check_validity(
    whisker: Whisker,
    *,
    preload_mm: float,
    mu: float,
    mark_depth_mm: float,
    speed_mm_s: float,
    finest_wavelength_mm: float,
    steepest_bevel_rad: float = STEEPEST_BEVEL_RAD,
) -> Validity:
    """Check the paper's assumptions for one whisker in one use.

    Args:
        whisker: the whisker.
        preload_mm: preload depth d0, mm.
        mu: friction coefficient.
        mark_depth_mm: deepest mark expected, mm.
        speed_mm_s: scan speed, mm/s.
        finest_wavelength_mm: shortest spatial period that the signal must carry, mm.
        steepest_bevel_rad: steepest groove wall, falling or rising, rad.

    Returns:
        Flags of all that is violated. Where the whisker jams on the land itself, stress and deflection have
        no value and are not flagged.

    Raises:
        WhiskerError: a length or speed that is not positive (mark depth may be 0).
        EnhancementError: friction negative or not finite.
    """
    preload = _positive("preload_mm", preload_mm)
    speed = _positive("speed_mm_s", speed_mm_s)
    wavelength = _positive("finest_wavelength_mm", finest_wavelength_mm)
    if not (math.isfinite(mark_depth_mm) and mark_depth_mm >= 0.0):
        raise WhiskerError(f"mark_depth_mm is {mark_depth_mm}; it is a depth, finite and not negative")
    flags = Validity.NONE
    wall = math.tan(steepest_bevel_rad)
    jams = enhancement.is_jammed([0.0, -wall, wall], mu, whisker.tip_model())
    if jams.any():
        flags |= Validity.JAMMING
    if not jams[0]:
        if deflection_ratio(whisker, preload_mm=preload, mu=mu) > DEFLECTION_LIMIT:
            flags |= Validity.DEFLECTION_OVER_10_PERCENT
        if preload_stress_mpa(whisker, preload_mm=preload, mu=mu) > whisker.material.yield_mpa:
            flags |= Validity.STRESS_OVER_YIELD
    if preload < PRELOAD_MARGIN * mark_depth_mm:
        flags |= Validity.PRELOAD_BELOW_MARK_DEPTH
    if speed / wavelength > QUASI_STATIC_SHARE * first_bending_frequency_hz(whisker):
        flags |= Validity.NOT_QUASI_STATIC
    return flags


def validity_messages(flags: Validity) -> tuple[str, ...]:
    """One sentence for each flag that is set: what is wrong and how to mend it."""
    return tuple(message for flag, message in _MESSAGES.items() if flag in flags)
