"""Material and cross-section of a whisker.

Directions of a section, looking along the whisker (the whisker bends in the vertical plane, y is up)::

            ^ vertical
            |              Rectangle: thickness_mm is the vertical side (thin, the soft direction),
       +---------+                    width_mm the lateral side (wide, the stiff direction):
       |    +----|--> lateral (z)     a flat ribbon, soft up and down and stiff sideways.
       +---------+

Units are mm and N: moduli are in MPa = N/mm^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Annotated, ClassVar, Self, TypeAlias

from glyphs.errors import MarksError
from glyphs.ranges import Positive, Range, Validated, require_range
from glyphs.surface.display import OneLine

_SUM_ODD_FIFTH_POWERS = 1.0045237627951384
"""1 + 1/3^5 + 1/5^5 + ... = 31/32 zeta(5)."""


UPRIGHT = Range(
    math.nextafter(-0.5 * math.pi, 0.0),
    math.nextafter(0.5 * math.pi, 0.0),
    "it must lie between -pi/2 and pi/2 (radians, not degrees)",
)
"""Range of slopes of surfaces and whiskers, rad."""


class WhiskerError(MarksError):
    """An impossible whisker or array, or an impossible use of one."""


@dataclass(frozen=True)
class Material(Validated, error=WhiskerError):
    """An isotropic, linearly elastic material; raises WhiskerError for an impossible constant."""

    # whisker files contain this class; unknown keys are errors
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    name: str
    e_mpa: Positive
    poisson: Annotated[float, Range(0.0, math.nextafter(0.5, 0.0))]
    density_g_cm3: Positive
    yield_mpa: Positive

    @property
    def g_mpa(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)), MPa."""
        return self.e_mpa / (2.0 * (1.0 + self.poisson))

    @property
    def density_t_mm3(self) -> float:
        """Density, tonne/mm^3: tonnes are the mass unit consistent with N, mm and s."""
        return self.density_g_cm3 * 1e-9


MUSIC_WIRE = Material("music wire", e_mpa=200_000.0, poisson=0.29, density_g_cm3=7.8, yield_mpa=2000.0)
"""Patented spring steel wire (docs/pages/physics.md: E 190 to 210 GPa, nu 0.29, 7.8 g/cm^3, about 2000 MPa)."""


@dataclass(frozen=True)
class Section(Validated, error=WhiskerError):
    """A cross-section: its dimensions and the values derived from them."""

    area_mm2: float = field(init=False, repr=False, compare=False)
    i_vertical_mm4: float = field(init=False, repr=False, compare=False)
    i_lateral_mm4: float = field(init=False, repr=False, compare=False)
    j_mm4: float = field(init=False, repr=False, compare=False)
    c_vertical_mm: float = field(init=False, repr=False, compare=False)
    c_lateral_mm: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        names = (each.name for each in fields(self) if not each.init)
        for name, value in zip(names, self._derived(), strict=True):
            object.__setattr__(self, name, value)

    def _derived(self) -> tuple[float, ...]:
        raise NotImplementedError

    @property
    def dimensions_mm(self) -> tuple[float, ...]:
        return tuple(getattr(self, each.name) for each in fields(self) if each.init)

    def blend(self, other: Section, t: float) -> Self:
        """Mix the dimensions linearly: this section at t = 0, one of its kind at t = 1. Raises WhiskerError."""
        if type(other) is not type(self):
            raise WhiskerError(
                f"cannot taper from {type(self).__name__} to {type(other).__name__}",
                hint="both ends must be of the same kind",
            )
        pairs = zip(self.dimensions_mm, other.dimensions_mm, strict=True)
        return type(self)(*((1.0 - t) * a + t * b for a, b in pairs))


@dataclass(frozen=True)
class Tube(Section):
    """Round tube, e.g. hypodermic tubing."""

    outer_mm: Positive
    inner_mm: float

    def _derived(self) -> tuple[float, ...]:
        require_range(WhiskerError, Range(0.0, math.nextafter(self.outer_mm, 0.0)), inner_mm=self.inner_mm)
        return _round_section(self.outer_mm, self.inner_mm)


@dataclass(frozen=True)
class Round(Section):
    """Solid round wire."""

    diameter_mm: Positive

    def _derived(self) -> tuple[float, ...]:
        return _round_section(self.diameter_mm, 0.0)


def _round_section(outer_mm: float, inner_mm: float) -> tuple[float, ...]:
    i, c = math.pi * (outer_mm**4 - inner_mm**4) / 64.0, outer_mm / 2.0
    return math.pi * (outer_mm**2 - inner_mm**2) / 4.0, i, i, 2.0 * i, c, c


@dataclass(frozen=True)
class Rectangle(Section):
    """Rectangular section; with width_mm, its lateral side, well above thickness_mm it is a ribbon."""

    thickness_mm: Positive
    width_mm: Positive

    def _derived(self) -> tuple[float, ...]:
        t, w = self.thickness_mm, self.width_mm
        return t * w, w * t**3 / 12.0, t * w**3 / 12.0, _rectangle_torsion_mm4(t, w), t / 2.0, w / 2.0


def _rectangle_torsion_mm4(thickness_mm: float, width_mm: float) -> float:
    """Compute the torsion constant by St. Venant's series (Timoshenko and Goodier, Theory of Elasticity, art. 109).

    J = a b^3 / 3 [1 - 192 b / (pi^5 a) sum over odd n of tanh(n pi a / 2b) / n^5], a >= b, mm^4.
    The sum is computed as its limit for a long section minus a remainder that falls as exp(-n pi a / b). The result
    is exact to rounding.
    """
    b, a = sorted((thickness_mm, width_mm))
    remainder = sum(2.0 / (math.exp(min(n * math.pi * a / b, 700.0)) + 1.0) / n**5 for n in range(1, 16, 2))
    total = _SUM_ODD_FIFTH_POWERS - remainder
    return a * b**3 / 3.0 * (1.0 - 192.0 * b / (math.pi**5 * a) * total)


@dataclass(frozen=True, repr=False)
class Taper(OneLine):
    """A section whose dimensions vary linearly along a segment to its `end`. Raises WhiskerError."""

    start: Section
    end: Section

    def __post_init__(self) -> None:
        self.start.blend(self.end, 0.5)


SectionLike: TypeAlias = Section | Taper
"""A constant or a tapered section."""
