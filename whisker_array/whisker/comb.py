"""Space in a comb: whiskers as bodies, bent and unbent, and the distance between rows at which none touch.

Seen from above, traced to the right; whisker i is in row i mod rows, each row one stagger behind the last::

    row 1        row 0                     lateral
    |==o 1=====] |                         neighbours in a row are rows x pitch apart, at least
                 |==o 0=====]                 width + sideways bend of both + gap
    |==o 3=====] |                         others overlap sideways: in the plane of tracing every two
                 |==o 2=====]                 must be clear, one bent and one unbent, clamps included
    '--stagger---'

Inclined whiskers (beta > 0) overlap like roof tiles: their l1 are parallel, stagger x sin(beta) apart. Level whiskers
(beta = 0) are all at one height, so that a row begins only behind the tips of the row in front.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np

from glyphs.ranges import NotNegative, Positive, Range, Validated, require_positive, require_range
from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.whisker.defaults import NOMINAL_FRICTION, default_preload_mm, default_whisker
from whisker_array.whisker.elastica import ElasticaError, large_deflection
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import TipModel, Whisker

GAP_MM = 0.15
"""Least gap between two bodies: several times the uncertainty of a clamped ribbon's position."""
BURR_PRELOADS = 0.1
"""Height of a burr that lifts the tip further than the land does, preloads."""
STEEPEST = math.sqrt(3.0)
"""Slope of the steepest wall along the trace, 60 degrees, down which a tip slides sideways."""
CLAMP_THICKNESSES = 4.0
"""Half the length of a clamp and half its height, thicknesses of the whisker."""
DEFAULT_BENT = Path(__file__).with_name("default_bent.json")
"""`bent_the_most` of the default whisker for characters 1 mm high."""


@dataclass(frozen=True, eq=False, repr=False)
class Body(OneLine, Validated, error=WhiskerError):
    """Space occupied by a whisker."""

    width_mm: Positive
    thickness_mm: Positive
    aside_mm: float
    # lines from clamp to tip, (n, 2), (x, y) from the clamp: at rest, and at the greatest bend
    shapes_mm: tuple[Floats, ...]
    clamp_mm: tuple[float, float]  # (length ahead of the base, half height)
    mass_g: float

    @property
    def side_room_mm(self) -> float:
        """Least pitch of whiskers side by side: both may bend towards each other."""
        return self.width_mm + 2.0 * self.aside_mm + GAP_MM

    @property
    def reach_mm(self) -> float:
        """Distance from the clamp's front to the furthest tip, along the trace."""
        return self.clamp_mm[0] - min(float(s[:, 0].min()) for s in self.shapes_mm)

    @property
    def full_stagger_mm(self) -> float:
        """Stagger at which rows are fully behind each other, for any shape of whisker."""
        return self.reach_mm + self.thickness_mm + GAP_MM

    def scaled(self, factor: float) -> Body:
        """Return the body enlarged by a factor; the clearance GAP_MM does not change."""
        return Body(
            width_mm=factor * self.width_mm,
            thickness_mm=factor * self.thickness_mm,
            aside_mm=factor * self.aside_mm,
            shapes_mm=tuple(factor * s for s in self.shapes_mm),
            clamp_mm=(factor * self.clamp_mm[0], factor * self.clamp_mm[1]),
            mass_g=factor**3 * self.mass_g,
        )

    @cached_property
    def _outlines(self) -> tuple[tuple[Floats, ...], Floats]:
        x, y = self.clamp_mm
        block = np.array([(0.0, -y), (0.0, y), (x, y), (x, -y), (0.0, -y)])
        return tuple(_dense(s, self.thickness_mm) for s in self.shapes_mm), _dense(block, self.thickness_mm)

    def clear_mm(self, behind_mm: float) -> float:
        """Least clearance, bent or unbent, in the plane of tracing to the same whisker behind it; <= 0: none."""
        lines, box = self._outlines
        half = 0.5 * self.thickness_mm
        shift, (length, high) = np.array([-behind_mm, 0.0]), self.clamp_mm
        for x, y in ((line - shift).T for line in lines):
            if ((x > 0.0) & (x < length) & (np.abs(y) < high)).any():
                return -half  # inside the clamp of the other
        worst = min(_distance(a, b + shift) for a in lines for b in lines) - self.thickness_mm
        to_clamps = min(min(_distance(box, a + shift), _distance(a, box + shift)) for a in lines) - half
        return min(worst, to_clamps, _distance(box, box + shift))


def _dense(line: Floats, step: float) -> Floats:
    out = [line[:1]]
    for a, b in pairwise(line):
        n = max(1, math.ceil(float(np.hypot(*(b - a))) / step))
        out.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(out)


def _distance(points: Floats, line: Floats) -> float:
    starts, steps = line[:-1], np.diff(line, axis=0)
    length = np.maximum((steps**2).sum(axis=1), 1e-30)
    x, y = (points[:, k, None] - starts[:, k] for k in (0, 1))
    along = np.clip((x * steps[:, 0] + y * steps[:, 1]) / length, 0.0, 1.0)
    x -= along * steps[:, 0]
    y -= along * steps[:, 1]
    return math.sqrt(float((x * x + y * y).min()))


def bent_the_most(whisker: Whisker, *, preload_mm: float, mu: float = NOMINAL_FRICTION) -> Floats:
    """Line of the elastica on land, (n, 2) mm from the clamp, lifted by preload and burrs. Raises WhiskerError."""
    try:
        bent = large_deflection(whisker, lift_mm=preload_mm * (1.0 + BURR_PRELOADS), mu=mu).shape_mm
    except ElasticaError as error:
        raise WhiskerError(f"the bent whisker has no shape: {error.what}", hint=error.hint) from error
    return np.asarray(bent - bent[0])


def body_of(whisker: Whisker, *, preload_mm: float, mu: float = NOMINAL_FRICTION) -> Body:
    """Compute the body of a whisker, at rest and at the greatest bend. Raises WhiskerError.

    The steepest wall along the trace bends the tip sideways by f_n tan(60 deg) Dzz, f_n = d0 / Dyy (`TipModel`).
    """
    require_positive(WhiskerError, preload_mm=preload_mm)
    return _body(whisker, preload_mm, bent_the_most(whisker, preload_mm=preload_mm, mu=mu))


def _body(whisker: Whisker, preload: float, bent: Floats) -> Body:
    segments = whisker.segments()
    outline = np.array([segments[0].start_mm[:2], *(s.end_mm[:2] for s in segments)])
    sections = [s.section_at(t) for s in segments for t in (0.0, 1.0)]
    thick = 2.0 * max(s.c_vertical_mm for s in sections)
    tip: TipModel = whisker.tip_model()
    aside = preload * STEEPEST * float(tip.compliance_mm_per_n[2, 2] / tip.compliance_mm_per_n[1, 1])
    wide = 2.0 * max(s.c_lateral_mm for s in sections)
    clamp = (2.0 * CLAMP_THICKNESSES * thick, CLAMP_THICKNESSES * thick)
    steel = whisker.material.density_t_mm3
    tonnes = sum(s.material.density_t_mm3 * s.section_at(0.5).area_mm2 * s.length_mm for s in segments)
    tonnes += steel * wide * clamp[0] * 2.0 * clamp[1]
    return Body(
        width_mm=wide,
        thickness_mm=thick,
        aside_mm=aside,
        shapes_mm=(outline, bent),
        clamp_mm=clamp,
        mass_g=1e6 * tonnes,
    )


@cache
def _unit_body() -> Body:
    # from a file, because every reader needs it and the solver takes 0.25 s to load
    bent = np.array(json.loads(DEFAULT_BENT.read_text(encoding="utf-8"))["shape_mm"])
    return _body(default_whisker(1.0), default_preload_mm(1.0), bent)


def default_body(character_height_mm: float) -> Body:
    """Return the body of the default whisker, whose sizes scale with the character height. Raises WhiskerError."""
    require_positive(WhiskerError, character_height_mm=character_height_mm)
    return _unit_body().scaled(character_height_mm)


AtLeastOne = Annotated[int, Range(1, math.inf, "give at least one")]


@dataclass(frozen=True)
class WhiskerArray(Validated, error=WhiskerError):
    """A comb of equal whiskers, or several; without a `body` whiskers are points. Raises WhiskerError."""

    n_whiskers: AtLeastOne
    pitch_mm: Positive  # lateral distance between neighbouring whiskers
    rows: int = 1
    stagger_mm: NotNegative = 0.0
    # number of combs, each with one kind of whisker; all run on the same lines, and every sample is labelled
    # with the position of its own tip
    kinds: AtLeastOne = 1
    body: Body | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_range(WhiskerError, Range(1, self.n_whiskers), rows=self.rows)
        if self.body is not None:
            points = replace(self, body=None)
            if touching := collisions(self.body, points):
                what = f"the comb cannot be built: {touching}"
                raise WhiskerError(what, hint=room_hint(self.body, points))

    @property
    def offset_mm(self) -> tuple[float, ...]:
        """Distance of each whisker behind the foremost row along the trace, the first comb's whiskers first."""
        return tuple(
            (kind * self.rows + i % self.rows) * self.stagger_mm
            for kind in range(self.kinds)
            for i in range(self.n_whiskers)
        )

    @property
    def mass_g(self) -> float:
        """Mass of whiskers and clamps without their carrier; 0 if whiskers are points."""
        return 0.0 if self.body is None else self.kinds * self.n_whiskers * self.body.mass_g


def least_rows(body: Body, *, pitch_mm: float, n_whiskers: int) -> int:
    """Smallest number of rows at which the whiskers of a row do not touch."""
    return min(n_whiskers, max(1, math.ceil(body.side_room_mm / pitch_mm - 1e-9)))


def collisions(body: Body, comb: WhiskerArray) -> str:
    """Describe the first two whiskers that would touch; empty if none do."""
    in_row, several = comb.rows * comb.pitch_mm, comb.n_whiskers > comb.rows
    if several and in_row < body.side_room_mm:
        return (
            f"whiskers {body.width_mm:.3g} mm wide cannot stand {in_row:.3g} mm apart in a row, "
            f"they need {body.side_room_mm:.3g} mm"
        )
    for apart in range(1, comb.rows * comb.kinds):
        # rows that are a whole comb apart run on the same lines
        beside, behind_mm = apart % comb.rows, apart * comb.stagger_mm
        lateral = min(beside, comb.rows - beside if several else beside) * comb.pitch_mm
        if lateral >= body.side_room_mm or behind_mm >= body.full_stagger_mm:
            continue
        air = body.clear_mm(behind_mm)
        if air < GAP_MM:
            return (
                f"rows {behind_mm:.3g} mm one behind the other leave {max(air, 0.0):.2g} mm of air between "
                f"a bent whisker and one that is not; {GAP_MM:g} mm are needed"
            )
    return ""


def least_stagger_mm(body: Body, comb: WhiskerArray, *, step_mm: float) -> float:
    """Smallest distance of neighbouring rows, in whole steps, at which none touch. Raises WhiskerError."""
    if comb.n_whiskers > comb.rows and comb.rows * comb.pitch_mm < body.side_room_mm:
        enough = least_rows(body, pitch_mm=comb.pitch_mm, n_whiskers=comb.n_whiskers)
        raise WhiskerError(
            f"{comb.rows} rows of whiskers {comb.pitch_mm:.3g} mm apart leave no room sideways",
            hint=f"take {enough} rows",
        )
    if comb.rows * comb.kinds == 1:
        return 0.0
    most = math.ceil(body.full_stagger_mm / step_mm)
    tried = (k * step_mm for k in range(1, most))
    return next((mm for mm in tried if not collisions(body, replace(comb, stagger_mm=mm))), most * step_mm)


def room_hint(body: Body, comb: WhiskerArray) -> str:
    """Suggest a wider pitch, or more rows and their distance."""
    rows = least_rows(body, pitch_mm=comb.pitch_mm, n_whiskers=comb.n_whiskers)
    stagger = least_stagger_mm(body, replace(comb, rows=rows), step_mm=0.25 * body.thickness_mm)
    built = f"take {rows} row{'s' if rows > 1 else ''}"
    if rows * comb.kinds > 1:
        built += f" {stagger:.4g} mm behind each other"
    return built + f", a pitch of {body.side_room_mm:.3g} mm or more, or narrower whiskers"
