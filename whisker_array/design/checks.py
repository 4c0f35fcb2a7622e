"""Check a whisker in one use against every limit of a design: forces, stress, slide, frequency, edge contrast."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.design.limits import Bound, Constraint, DesignError, Limits, Request
from whisker_array.whisker import enhancement
from whisker_array.whisker.sections import Material, Rectangle, Round, Section, Taper
from whisker_array.whisker.shapes import LShaped, TipModel
from whisker_array.whisker.validity import (
    DEFLECTION_LIMIT,
    PRELOAD_MARGIN,
    QUASI_STATIC_SHARE,
    first_bending_frequency_hz,
)

FINEST_WAVELENGTH_LINES = 4.0
"""Wavelength of the finest detail, in line pitches: a stroke of h/10 (as for `array.SAFE_SPEED_MM_S`)."""
_FREQUENCY_PARTS = 3
"""Parts of the beam in the frequency model; the result is within 1 % of that of many parts, and lower."""
_MOST = 1e6
"""Stress, MPa, and force, N, of a whisker that jams: finite, for the search."""


@dataclass(frozen=True, repr=False)
class Checked(OneLine):
    """A whisker in use compared with a request and limits, with all values as arrays for a search."""

    contrast: Floats
    # values, their limit, and whether it is the greatest allowed or the least
    table: Mapping[Bound, tuple[Floats, float, bool]]

    def reserve(self) -> dict[Bound, Floats]:
        """ln(limit / value) or ln(value / limit): positive if the limit is kept, linear far below a lower limit."""
        out = {}
        for bound, (value, limit, at_most) in self.table.items():
            share = value / limit
            out[bound] = -np.log(np.maximum(share, 1e-12)) if at_most else _log_or_line(share)
        return out

    def rows(self) -> tuple[Constraint, ...]:
        return tuple(
            Constraint(bound, float(value.max() if at_most else value.min()), limit, at_most)
            for bound, (value, limit, at_most) in self.table.items()
        )


def _log_or_line(share: Floats) -> Floats:
    return np.where(share > 0.1, np.log(np.maximum(share, 0.1)), math.log(0.1) + (share - 0.1) / 0.1)


def _section(whisker: LShaped) -> Section:
    if isinstance(whisker.section, Taper):
        raise DesignError("a design has one section throughout", hint="take a whisker that does not taper")
    return whisker.section


@functools.lru_cache(maxsize=128)
def _tip(whisker: LShaped) -> TipModel:
    return whisker.tip_model()


def _pushes(alpha_rad: Floats, mu: Floats) -> Floats:
    c, s = np.cos(alpha_rad)[:, None], np.sin(alpha_rad)[:, None]
    return np.stack([s - mu * c, c + mu * s, np.zeros((alpha_rad.size, mu.size))], axis=-1)


def factors(whisker: LShaped, *, alpha_rad: Floats, mu: Floats) -> Floats:
    """F by eq. (16), (n, m) for n slopes of walls and m frictions; NaN where the whisker jams."""
    tip, slope = _tip(whisker), -np.tan(alpha_rad)
    return np.stack([enhancement.moment_ratio(slope, float(m), tip) for m in mu], axis=1)


def edge_steps(factor: Floats, *, preload_mm: float, depth_mm: float) -> Floats:
    """Absolute steps of the signal at the top and bottom lips of walls, (2, n, m), over the land moment, from F (n, m).

    From m / m_land = (1 + h/d0) F: at the top lip, h = 0, the signal steps by F - 1; at the bottom lip, h = -depth, by
    (F - 1)(1 - depth/d0).
    """
    step = np.abs(factor - 1.0)
    return np.stack([step, step * (1.0 - depth_mm / preload_mm)])


def normal_forces_n(
    whisker: LShaped, *, preload_mm: float, alpha_rad: Floats, mu: Floats
) -> tuple[Floats, Floats]:
    """Normal force at full preload by (7) and (11), N, and e_y.D11 R'a over its land value (n, m); inf if jammed."""
    tip = _tip(whisker)
    push = _pushes(alpha_rad, mu)
    row = tip.compliance_mm_per_n[1]
    lift = push @ row
    land = row[1] - row[0] * mu
    with np.errstate(divide="ignore"):
        force = np.where(lift > 0.0, preload_mm / lift, np.inf)
    return force, lift / land


def bending_stress_mpa(whisker: LShaped, normal_n: Floats, *, alpha_rad: Floats, mu: Floats) -> Floats:
    """Bending stress M c / I at clamp and elbow under the normal forces (n, m), (2, n, m), MPa."""
    section = _section(whisker)
    sensor = _tip(whisker).moment_arm_mm  # (l1 s + l2 - l3, -l1 c, 0) = (-r_y, r_x, 0) seen from the sensor
    clamp_y = -sensor[0] - whisker.lowered_mm
    push = _pushes(alpha_rad, mu)
    arms = ((sensor[1], clamp_y), (0.0, -whisker.l2_mm))
    moment = np.stack([x * push[..., 1] - y * push[..., 0] for x, y in arms]) * normal_n
    return np.abs(moment) * section.c_vertical_mm / section.i_vertical_mm4


def sideways_slide_mm(whisker: LShaped, *, preload_mm: float, wall_rad: float) -> float:
    """Sideways slide of the tip down a wall that runs along the trace: d0 (Dzz / Dyy) tan(alpha), mm. Friction does not
    stop it. The contact solver gives less, by 1 + (Dzz/Dyy) tan^2(alpha) without friction."""
    d = _tip(whisker).compliance_mm_per_n
    return preload_mm * float(d[2, 2] / d[1, 1]) * math.tan(wall_rad)


@functools.lru_cache(maxsize=4096)
def _frequency_number(k: float, beta_rad: float, aspect: float, material: Material) -> float:
    section = Rectangle(1.0, aspect) if aspect else Round(1.0)
    model = LShaped(100.0, 100.0 * k, None, beta_rad, section, material)
    return 1e4 * first_bending_frequency_hz(model, tip_held=True, parts=_FREQUENCY_PARTS)


def first_frequency_hz(whisker: LShaped) -> float:
    """First bending frequency with the tip held on the surface; fast, and at most 1 % too low."""
    section = _section(whisker)
    thickness = 2.0 * section.c_vertical_mm
    aspect = section.c_lateral_mm / section.c_vertical_mm if isinstance(section, Rectangle) else 0.0
    number = _frequency_number(whisker.k, whisker.beta_rad, aspect, whisker.material)
    return number * thickness / whisker.l1_mm**2


def linear_force_error(whisker: LShaped, *, lift_mm: float, mu: float) -> float:
    """First-order error of the linear beam's force on the land, (linear - exact) / exact by the elastica.

    (lift / l1 c) [0.6 tan(beta) + 1.2 tan(beta - atan(mu))] + 3.375 k lift / l1: the beam shortens as
    it bends, the pull along it stiffens it, and the tip arm swings out (a term exact for beta = 0, mu = 0).
    """
    lean = math.tan(whisker.beta_rad - math.atan(mu))
    bent = lift_mm / whisker.l1_mm / math.cos(whisker.beta_rad)
    swing = 3.375 * whisker.k * lift_mm / whisker.l1_mm
    return bent * (0.6 * math.tan(whisker.beta_rad) + 1.2 * lean) + swing


def check(
    whisker: LShaped,
    request: Request,
    limits: Limits,
    *,
    preload_mm: float,
    linear_error: float | None = None,
    error_scale: float = 1.0,
    n_mu: int = 5,
) -> Checked:
    """Check one whisker in one use against all limits, at the corners of the ranges of slope and friction, in which all
    bounds are monotone (eq. (16) is a linear fraction of tan(alpha - atan(mu)) for any whisker) but contrast in
    friction. `linear_error` is by default its first order times `error_scale`."""
    low, high = request.alpha_rad
    mus = np.array(request.mu)
    corners = np.array([0.0, high, -high])
    force, share = normal_forces_n(whisker, preload_mm=preload_mm, alpha_rad=corners, mu=mus)
    with np.errstate(invalid="ignore"):
        stress = bending_stress_mpa(whisker, force, alpha_rad=corners, mu=mus)
    factor = factors(whisker, alpha_rad=np.array([low, -low]), mu=np.linspace(*request.mu, n_mu))
    contrast = edge_steps(factor, preload_mm=preload_mm, depth_mm=request.depth_mm)
    tip = _tip(whisker)
    d, arm = tip.compliance_mm_per_n, tip.moment_arm_mm
    land_n = force[0]
    land = np.stack([-mus * land_n, land_n, np.zeros_like(mus)])
    section = _section(whisker)
    beam = whisker.material.e_mpa * section.i_vertical_mm4
    half = section.c_vertical_mm / math.cos(whisker.beta_rad)
    clamp = whisker.l1_mm * math.sin(whisker.beta_rad) + whisker.l2_mm
    axis = clamp - whisker.lowered_mm
    errors = (
        error_scale * np.abs([linear_force_error(whisker, lift_mm=preload_mm, mu=float(m)) for m in mus])
        if linear_error is None
        else np.array([linear_error])
    )
    detail_hz = request.least_speed_mm_s / (FINEST_WAVELENGTH_LINES * request.line_pitch_mm)
    room = limits.clearance_depths * request.depth_mm
    table: dict[Bound, tuple[Floats | float, float, bool]] = {
        Bound.JAMMING: (share[1:], limits.lift_share, False),
        Bound.STRESS: (np.fmin(stress, _MOST), whisker.material.yield_mpa / limits.safety, True),
        Bound.FORCE: (np.fmin(force, _MOST), limits.force_n, True),
        Bound.GROOVE_FLOOR: (preload_mm, PRELOAD_MARGIN * request.depth_mm, False),
        Bound.DEFLECTION: (np.linalg.norm(d @ land, axis=0) / whisker.l1_mm, DEFLECTION_LIMIT, True),
        Bound.LINEAR_BEAM: (errors, limits.linear_error, True),
        Bound.SLIDE: (
            sideways_slide_mm(whisker, preload_mm=preload_mm, wall_rad=high),
            limits.slide_lines * request.line_pitch_mm,
            True,
        ),
        Bound.SPEED: (detail_hz / first_frequency_hz(whisker), QUASI_STATIC_SHARE, True),
        Bound.SIGNAL: (1e6 * np.abs(arm @ land) * section.c_vertical_mm / beam, 1e6 * limits.strain, False),
        Bound.ELBOW: (whisker.l2_mm - half, request.depth_mm + room, False),
        Bound.CLAMP: (clamp - half - preload_mm, room, False),
        Bound.AXIS: (axis, preload_mm + limits.axis_clearance_mm, False),
        Bound.LOWERED: (axis, clamp + limits.axis_raise * whisker.l1_mm, True),
    }
    if isinstance(section, Rectangle):
        table[Bound.WIDTH] = (section.width_mm, limits.width_heights * request.character_height_mm, True)
    return Checked(
        contrast,
        {
            bound: (np.ravel(np.asarray(value, dtype=np.float64)), limit, at_most)
            for bound, (value, limit, at_most) in table.items()
        },
    )
