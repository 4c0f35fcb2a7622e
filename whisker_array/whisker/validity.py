"""Whether a whisker may be used so: stress, deflection, frequency, and the paper's assumptions by them."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np

from glyphs.surface.display import one_line
from whisker_array.whisker import enhancement
from whisker_array.whisker.beam import cross_matrix, split
from whisker_array.whisker.elastica import ElasticaError, LinearError, linear_error
from whisker_array.whisker.sections import Taper, WhiskerError
from whisker_array.whisker.shapes import Matrix, Vector, Whisker, require_positive

DEFLECTION_LIMIT = 0.1
"""Largest tip deflection over l1 under Assumption 1."""
LINEAR_ERROR_LIMIT = 0.02
"""Largest share by which the linear beam may miss the exact force or moment. It is what the paper's own limit
allows its own whisker: a 0.3 mm wire with k = 1/12 bent by 10 % of l1 is wrong by 1.8 % in force. It is also
below the 3 % by which the gains of real whiskers differ, so the beam is not the worst of the sensor."""
PRELOAD_MARGIN = 1.2
"""Least preload over mark depth, so that contact is kept on the groove floor (Assumption 3)."""
QUASI_STATIC_SHARE = 0.1
"""Largest signal frequency over the first bending frequency (Assumption 5). A sine is then wrong by 1 %; the edge map
of a stamped groove of 45 degrees, whose corners hold higher frequencies, by 2 to 3 % and of 60 degrees by 6 to 9 %
(`whisker_array.simulation.dynamic_speed`). A search cannot simulate each of its whiskers, and this is quick."""
STEEPEST_BEVEL_RAD = math.pi / 3.0
"""The paper: the slopes given by dies are at most 60 degrees."""


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


@dataclass(frozen=True, eq=False)
class LumpedWhisker:
    """A whisker with its mass at joints.

    Attributes:
        joints_mm: (n, 3) ends of the pieces, base to tip, without the base.
        mass_t: (n,) of the joints, t (N s^2 / mm).
        strain: (6 (n - 1) ..., 3 n) weighted strain of every piece under unit forces on the joints.
    """

    joints_mm: Matrix
    mass_t: Vector
    strain: Matrix

    __repr__ = one_line

    @property
    def flexibility_mm_per_n(self) -> Matrix:
        """(3 n, 3 n) shifts of the joints under unit forces on them."""
        return np.asarray(self.strain.T @ self.strain)


def lumped_whisker(whisker: Whisker, *, parts: int, tip_mass_g: float = 0.0) -> LumpedWhisker:
    """The whisker in pieces: half the mass of each on either end, the flexibility between the joints exact.

    strain^T strain is the flexibility: two Gauss points a piece, M = r x f linear between its ends.
    """
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
    return LumpedWhisker(joints, mass[1:], strain.reshape(6 * n, 3 * n))


def first_bending_frequency_hz(
    whisker: Whisker, *, tip_mass_g: float = 0.0, tip_held: bool = False, parts: int = 24
) -> float:
    """Lowest natural frequency of the whisker in any direction, Hz, for Assumption 5.

    Mass is lumped at the joints of `parts` pieces a segment; the flexibility between the joints is exact.
    Within 0.2 % of 3.516 / (2 pi l^2) sqrt(EI / rho A) for a straight whisker. Rotary inertia is left out.

    Args:
        whisker: the whisker, clamped at its base.
        tip_mass_g: mass of a ball at the tip, g.
        tip_held: the tip is held in height by contact, which is 4.4 times faster for a straight whisker (a
            round one is as slow sideways as it was). So it is while tracing; see `check_validity`.
        parts: pieces a segment.

    Raises:
        WhiskerError: a negative tip mass.
    """
    if not (math.isfinite(tip_mass_g) and tip_mass_g >= 0.0):
        raise WhiskerError(f"tip_mass_g is {tip_mass_g}", hint="it must be finite and not negative")
    lumped = lumped_whisker(whisker, parts=parts, tip_mass_g=tip_mass_g)
    weighted = lumped.strain * np.repeat(np.sqrt(lumped.mass_t), 3)
    if tip_held:
        reaction = lumped.strain[:, -2]
        weighted -= np.outer(reaction, reaction @ weighted) / (reaction @ reaction)
    slowest = float(np.linalg.norm(weighted, 2)) ** 2
    return 1.0 / (2.0 * math.pi * math.sqrt(slowest))


class Validity(enum.Flag):
    """What stands against a whisker and its use; empty when nothing does."""

    NONE = 0
    DEFLECTION_OVER_10_PERCENT = enum.auto()
    STRESS_OVER_YIELD = enum.auto()
    PRELOAD_BELOW_MARK_DEPTH = enum.auto()
    NOT_QUASI_STATIC = enum.auto()
    JAMMING = enum.auto()
    LINEAR_BEAM_STRAINED = enum.auto()


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
        "the finest detail passes at more than a tenth of the first natural frequency of the whisker with its "
        "tip held on the surface (Assumption 5): scan slower, or take a shorter or thicker whisker"
    ),
    Validity.JAMMING: (
        "on the steepest bevel, or on the land, the contact force cannot lift the tip and the whisker jams: "
        "take a smaller k, less friction or another setting angle"
    ),
    Validity.LINEAR_BEAM_STRAINED: (
        "linear beam theory (Assumption 1) misses the exact force or moment of the bent whisker by more than "
        "2 %: lower the preload, or take a longer whisker or a smaller k"
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
    exact: bool = False,
) -> Validity:
    """Check the paper's assumptions for one whisker in one use.

    Quasi-static (Assumption 5) is judged with the tip held in height: the surface drives the tip, which stays on
    it as long as contact is kept (Assumption 3, checked too), so the modes that can ring are those between two
    held ends. The free whisker, several times slower, would be on the safe side, but it is not what is
    scanned; it is what rings when contact is lost, and then the signal is void anyway. `SAFE_SPEED_MM_S` of
    the raster rests on the same reading.

    Args:
        whisker: the whisker.
        preload_mm: preload depth d0, mm.
        mu: friction coefficient.
        mark_depth_mm: deepest mark expected, mm.
        speed_mm_s: scan speed, mm/s.
        finest_wavelength_mm: shortest spatial period that the signal must carry, mm.
        steepest_bevel_rad: steepest groove wall, falling or rising, rad.
        exact: also solve for the exact bent shape on the land (some 10 ms) and set LINEAR_BEAM_STRAINED where
            the linear beam misses its force or moment by more than `LINEAR_ERROR_LIMIT`, or it has none.

    Returns:
        Flags of all that is violated. Where the whisker jams on the land itself, stress and deflection have
        no value and are not flagged.

    Raises:
        WhiskerError: a length or speed that is not positive (mark depth may be 0).
        WhiskerError: friction negative or not finite.
    """
    preload = require_positive("preload_mm", preload_mm)
    speed = require_positive("speed_mm_s", speed_mm_s)
    wavelength = require_positive("finest_wavelength_mm", finest_wavelength_mm)
    if not (math.isfinite(mark_depth_mm) and mark_depth_mm >= 0.0):
        raise WhiskerError(f"mark_depth_mm is {mark_depth_mm}", hint="it is a depth, finite and not negative")
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
        if exact and _is_strained(_judge(whisker, lift_mm=preload, mu=mu)):
            flags |= Validity.LINEAR_BEAM_STRAINED
    if preload < PRELOAD_MARGIN * mark_depth_mm:
        flags |= Validity.PRELOAD_BELOW_MARK_DEPTH
    if speed / wavelength > QUASI_STATIC_SHARE * first_bending_frequency_hz(whisker, tip_held=True):
        flags |= Validity.NOT_QUASI_STATIC
    return flags


def validity_messages(flags: Validity) -> tuple[str, ...]:
    """One sentence for each flag that is set: what is wrong and how to correct it."""
    return tuple(message for flag, message in _MESSAGES.items() if flag in flags)


def _judge(whisker: Whisker, *, lift_mm: float, mu: float) -> LinearError | ElasticaError:
    """The linear beam's error on the land, or why the exact one has no answer."""
    try:
        return linear_error(whisker, lift_mm=lift_mm, mu=mu)
    except ElasticaError as error:
        return error


def _is_strained(found: LinearError | ElasticaError) -> bool:
    return isinstance(found, ElasticaError) or found.worst > LINEAR_ERROR_LIMIT


def linear_beam_messages(
    whisker: Whisker, *, preload_mm: float, mark_height_mm: float, mu: float
) -> tuple[str, ...]:
    """What the exact bent shape says against the linear beam (Assumption 1), in sentences with numbers.

    Judged on level surface at the largest lift in use, preload + mark height: grooves only relieve the whisker.
    Costs the solution of a boundary value problem, some 10 ms.

    Args:
        whisker: a whisker that lies in the plane of tracing.
        preload_mm: preload depth d0, mm.
        mark_height_mm: how far marks or burrs stand above the land, mm; 0 for grooves.
        mu: friction coefficient.

    Returns:
        One sentence, or none where force and moment are right within `LINEAR_ERROR_LIMIT` and the tip bends by
        no more than 10 % of l1.

    Raises:
        WhiskerError: the preload not positive, the mark height negative or not finite.
        WhiskerError: friction negative or not finite.
    """
    preload = require_positive("preload_mm", preload_mm)
    if not (math.isfinite(mark_height_mm) and mark_height_mm >= 0.0):
        raise WhiskerError(
            f"mark_height_mm is {mark_height_mm}", hint="it is a height, finite and not negative"
        )
    lift = preload + mark_height_mm
    found = _judge(whisker, lift_mm=lift, mu=mu)
    if isinstance(found, ElasticaError):
        return (f"linear beam theory (Assumption 1) cannot be checked at a lift of {lift:.3g} mm: {found}",)
    ratio = deflection_ratio(whisker, preload_mm=lift, mu=mu)
    if not _is_strained(found) and ratio <= DEFLECTION_LIMIT:
        return ()
    return (
        f"at the largest lift, {lift:.3g} mm, the tip bends by {100 * ratio:.1f} % of l1, and linear beam "
        f"theory (Assumption 1) is wrong by {100 * found.force:+.1f} % in force and "
        f"{100 * found.moment:+.1f} % in moment: lower the preload, or take a longer whisker or a smaller k",
    )
