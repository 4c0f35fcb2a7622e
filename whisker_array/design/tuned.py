"""A whisker sensitive to one inclination, after the paper's last remark.

For *any* whisker, by (16), F is a ratio of two linear forms in sin and cos of alpha, hence a linear fraction of
tan(alpha - atan(mu)): between its poles it is monotone. So no whisker responds most to one inclination and less to
steeper ones, and only a profiler has F = 1 on a slope other than the land. Two kinds are possible::

    F                  |                 F  ___
            threshold  |                       `--.     null
      ________________/ jam              0 ........`o-------- alpha
                     alpha0                         alpha0 \\___ the sign separates steeper from gentler

*Threshold*: the pole is just beyond alpha0, so the response grows fastest there; steeper walls would jam. *Null*: the
sensor's axis lies on the line of the contact force at alpha0, 1 = B g(alpha0), B = axis height / (l1 c), so that the
moment vanishes there. Friction rotates that line, so both inclinations shift by atan(mu), whatever the whisker.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.design.checks import factors
from whisker_array.design.design import SEED, Design, describe_design, search
from whisker_array.design.limits import DesignError, Limits, Request
from whisker_array.design.search import Problem, SectionKind
from whisker_array.whisker.shapes import LShaped

NEIGHBOUR_RAD = math.radians(10.0)
"""Difference from alpha0 at which an inclination must give a different signal."""
AXIS_RAISE = 2.5
"""Greatest height of the sensor's axis of a null above the clamp, in l1."""
STEEPEST_RAD = math.radians(80.0)
_TABLE_DEG = tuple(range(0, 71, 5))
_STARTS = 4


class Kind(enum.Enum):
    """Kinds of sensitivity to one inclination."""

    NULL = "null"
    THRESHOLD = "threshold"


@dataclass(frozen=True, repr=False)
class Tuned(OneLine):
    """A whisker for one inclination, and its F, (inclinations, frictions), NaN where it jams.

    `selectivity` is the least change of F over all frictions, in land moments, if the wall is ten degrees gentler or
    steeper. At `place_rad` the moment vanishes (null) or F is singular (threshold), for the frictions of the table.
    """

    kind: Kind
    alpha_rad: float
    design: Design
    selectivity: float
    table_deg: tuple[int, ...]
    table_mu: tuple[float, float, float]
    table: Floats
    place_rad: tuple[float, float, float]


def middle_friction(mu: tuple[float, float]) -> float:
    """Friction whose angle is midway between those of the range."""
    return math.tan(0.5 * (math.atan(mu[0]) + math.atan(mu[1])))


def _with_neighbours(kind: Kind, alpha_rad: float, steepest_rad: float) -> Floats:
    slopes = [alpha_rad, alpha_rad - NEIGHBOUR_RAD]
    if kind is Kind.NULL and alpha_rad + NEIGHBOUR_RAD <= steepest_rad + 1e-9:
        slopes.append(alpha_rad + NEIGHBOUR_RAD)
    return np.array(slopes)


def _problem(kind: Kind, alpha_rad: float, request: Request, limits: Limits, section: SectionKind) -> Problem:
    low = min(request.alpha_rad[0], alpha_rad)
    if kind is Kind.THRESHOLD:
        # there are no walls steeper than alpha0
        request, lean = replace(request, alpha_rad=(low, alpha_rad)), None
    else:
        request = replace(request, alpha_rad=(low, max(request.alpha_rad[1], alpha_rad)))
        limits = replace(limits, axis_raise=max(limits.axis_raise, AXIS_RAISE))
        lean = alpha_rad - math.atan(middle_friction(request.mu))
        if not lean > 0.0:
            raise DesignError(
                f"a wall of {math.degrees(alpha_rad):g} degrees lies within the friction angle of "
                "these surfaces",
                hint="give a steeper one, or less friction",
            )
    mu = np.linspace(*request.mu, 3)
    slopes = _with_neighbours(kind, alpha_rad, request.alpha_rad[1])

    def step(whisker: LShaped, _preload_mm: float) -> Floats:
        f = factors(whisker, alpha_rad=slopes, mu=mu)
        return np.asarray(np.abs(f[1:] - f[0]))

    return Problem(request, limits, section, objective=step, axis_lean_rad=lean)


def tune(
    alpha_rad: float,
    request: Request,
    *,
    limits: Limits | None = None,
    kind: Kind | None = None,
    section: Literal["auto", "ribbon", "round"] = "auto",
    seed: int = SEED,
) -> Tuned:
    """Find the most selective whisker for one inclination within the limits of a design. Raises DesignError. A null
    must not jam on the walls of the request; a threshold may, on steeper ones. The default kind is a null if the
    request has steeper walls, otherwise the more selective one."""
    if not NEIGHBOUR_RAD < alpha_rad <= STEEPEST_RAD:
        raise DesignError(
            f"{math.degrees(alpha_rad):g} degrees cannot be singled out",
            hint=(
                f"give an inclination above {math.degrees(NEIGHBOUR_RAD):g} and up to "
                f"{math.degrees(STEEPEST_RAD):g} degrees"
            ),
        )
    kinds = (kind,) if kind is not None else tuple(Kind)
    if kind is None and alpha_rad < request.alpha_rad[1] - 1e-9:
        kinds = (Kind.NULL,)
    made_of: SectionKind = "round" if section == "round" else "ribbon"
    designs: list[Tuned] = []
    reasons: list[str] = []
    for each in kinds:
        try:
            designs.append(_tune_kind(each, alpha_rad, request, limits or Limits(), made_of, seed))
        except DesignError as error:
            reasons.append(str(error))
    if not designs:
        raise DesignError("; ".join(dict.fromkeys(reasons)))
    return max(designs, key=lambda t: t.selectivity)


def _tune_kind(
    kind: Kind, alpha_rad: float, request: Request, limits: Limits, section: SectionKind, seed: int
) -> Tuned:
    problem = _problem(kind, alpha_rad, request, limits, section)
    done = search(problem, n_starts=_STARTS, seed=seed)
    if done is None:
        raise DesignError(
            f"no {kind.value} at {math.degrees(alpha_rad):g} degrees within the limits",
            hint=(
                "give a steeper inclination or a narrower range of friction; if no walls are steeper, "
                "try a threshold"
            ),
        )
    problem, candidate = done
    whisker = candidate.whisker
    mus = (request.mu[0], middle_friction(request.mu), request.mu[1])
    table = factors(whisker, alpha_rad=np.radians(_TABLE_DEG), mu=np.array(mus))
    model = whisker.tip_model()
    row, arm = model.compliance_mm_per_n[1], model.moment_arm_mm
    # the force leans by alpha - atan(mu): no moment along arm_x tan + arm_y = 0, no lift along Dyx tan + Dyy = 0
    x, y = (arm[0], arm[1]) if kind is Kind.NULL else (row[0], row[1])
    lean = math.atan2(-y * math.copysign(1.0, x), abs(x))
    slopes = _with_neighbours(kind, alpha_rad, problem.request.alpha_rad[1])
    fine = factors(whisker, alpha_rad=slopes, mu=np.linspace(*request.mu, 33))
    return Tuned(
        kind=kind,
        alpha_rad=alpha_rad,
        design=describe_design(problem, candidate),
        selectivity=float(np.abs(fine[1:] - fine[0]).min()),
        table_deg=_TABLE_DEG,
        table_mu=mus,
        table=table,
        place_rad=(lean + math.atan(mus[0]), lean + math.atan(mus[1]), lean + math.atan(mus[2])),
    )
