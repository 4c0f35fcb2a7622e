"""Material and cross-section of a whisker.

Directions of a section, looking along the whisker (the whisker bends in the vertical plane, y is up)::

            ^ vertical
            |              Rectangle: thickness_mm is the vertical side (thin, the soft direction),
       +---------+                    width_mm the lateral side (wide, the stiff direction):
       |    +----|--> lateral (z)     a ribbon lying flat, as soft up and down as it is stiff sideways.
       +---------+

Units are mm and N: moduli are in MPa = N/mm^2.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self, TypeAlias

from glyphs.errors import MarksError
from glyphs.ranges import require_positive, require_range
from glyphs.surface.display import OneLine

_SUM_ODD_FIFTH_POWERS = 1.0045237627951384
"""1 + 1/3^5 + 1/5^5 + ... = 31/32 zeta(5)."""


class WhiskerError(MarksError):
    """A whisker, array or use of one that is not possible."""


@dataclass(frozen=True)
class Material:
    """An isotropic, linearly elastic material.

    Attributes:
        name: what it is called.
        e_mpa: Young's modulus, MPa.
        poisson: Poisson's ratio, 0 <= nu < 0.5.
        density_g_cm3: density, g/cm^3.
        yield_mpa: yield stress in bending, MPa.

    Raises:
        WhiskerError: a constant that is not positive, or a Poisson's ratio outside 0 to 0.5.
    """

    name: str
    e_mpa: float
    poisson: float
    density_g_cm3: float
    yield_mpa: float

    def __post_init__(self) -> None:
        require_positive(WhiskerError, self, "e_mpa", "density_g_cm3", "yield_mpa")
        require_range(WhiskerError, 0.0, math.nextafter(0.5, 0.0), self, "poisson")

    @property
    def g_mpa(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)), MPa."""
        return self.e_mpa / (2.0 * (1.0 + self.poisson))

    @property
    def density_t_mm3(self) -> float:
        """Density in tonne/mm^3, the mass unit that goes with N, mm and s."""
        return self.density_g_cm3 * 1e-9


MUSIC_WIRE = Material("music wire", e_mpa=200_000.0, poisson=0.29, density_g_cm3=7.8, yield_mpa=2000.0)
"""Patented spring steel wire (physics.md: E 190 to 210 GPa, nu 0.29, 7.8 g/cm^3, about 2000 MPa)."""


class Section(ABC):
    """A cross-section; its dimensions are the fields of a frozen dataclass, mm."""

    @property
    @abstractmethod
    def area_mm2(self) -> float:
        """Area, mm^2."""

    @property
    @abstractmethod
    def i_vertical_mm4(self) -> float:
        """Second moment for bending in the vertical plane of the whisker (about the lateral axis), mm^4."""

    @property
    def i_lateral_mm4(self) -> float:
        """Second moment for bending sideways (about the in-plane axis across the beam), mm^4."""
        return self.i_vertical_mm4

    @property
    def j_mm4(self) -> float:
        """St. Venant torsion constant, mm^4; of a section with round symmetry the polar second moment."""
        return 2.0 * self.i_vertical_mm4

    @property
    @abstractmethod
    def c_vertical_mm(self) -> float:
        """Distance from the lateral axis to the outer fibre, mm."""

    @property
    def c_lateral_mm(self) -> float:
        """Half of the lateral extent, mm."""
        return self.c_vertical_mm

    def scaled(self, factor: float) -> Self:
        """The same shape with every dimension multiplied by the factor."""
        return type(self)(*(factor * value for value in vars(self).values()))

    def blend(self, other: Section, t: float) -> Self:
        """Mix the dimensions linearly: this section at t = 0, the other at t = 1.

        Raises:
            WhiskerError: the other is of another kind.
        """
        if type(other) is not type(self):
            raise WhiskerError(
                f"cannot taper from {type(self).__name__} to {type(other).__name__}",
                hint="both ends must be of the same kind",
            )
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return type(self)(*((1.0 - t) * a + t * b for a, b in pairs))


@dataclass(frozen=True)
class Tube(Section):
    """Round tube, e.g. hypodermic tubing.

    Attributes:
        outer_mm: outer diameter, mm.
        inner_mm: inner diameter, mm, 0 <= inner < outer.
    """

    outer_mm: float
    inner_mm: float

    def __post_init__(self) -> None:
        require_positive(WhiskerError, self, "outer_mm")
        require_range(WhiskerError, 0.0, math.nextafter(self.outer_mm, 0.0), self, "inner_mm")

    @property
    def area_mm2(self) -> float:
        """pi (D^2 - d^2) / 4, mm^2."""
        return math.pi * (self.outer_mm**2 - self.inner_mm**2) / 4.0

    @property
    def i_vertical_mm4(self) -> float:
        """pi (D^4 - d^4) / 64, mm^4."""
        return math.pi * (self.outer_mm**4 - self.inner_mm**4) / 64.0

    @property
    def c_vertical_mm(self) -> float:
        """D / 2, mm."""
        return self.outer_mm / 2.0


@dataclass(frozen=True)
class Round(Section):
    """Solid round wire.

    Attributes:
        diameter_mm: wire diameter, mm.
    """

    diameter_mm: float

    def __post_init__(self) -> None:
        require_positive(WhiskerError, self)

    @property
    def area_mm2(self) -> float:
        """pi d^2 / 4, mm^2."""
        return math.pi * self.diameter_mm**2 / 4.0

    @property
    def i_vertical_mm4(self) -> float:
        """pi d^4 / 64, mm^4."""
        return math.pi * self.diameter_mm**4 / 64.0

    @property
    def c_vertical_mm(self) -> float:
        """d / 2, mm."""
        return self.diameter_mm / 2.0


@dataclass(frozen=True)
class Rectangle(Section):
    """Rectangular section; with width_mm well above thickness_mm it is a ribbon.

    Attributes:
        thickness_mm: side in the bending plane of the whisker (vertical), mm.
        width_mm: lateral side, mm.
    """

    thickness_mm: float
    width_mm: float

    def __post_init__(self) -> None:
        require_positive(WhiskerError, self)

    @property
    def area_mm2(self) -> float:
        """t w, mm^2."""
        return self.thickness_mm * self.width_mm

    @property
    def i_vertical_mm4(self) -> float:
        """w t^3 / 12, mm^4."""
        return self.width_mm * self.thickness_mm**3 / 12.0

    @property
    def i_lateral_mm4(self) -> float:
        """t w^3 / 12, mm^4."""
        return self.thickness_mm * self.width_mm**3 / 12.0

    @property
    def j_mm4(self) -> float:
        """Torsion constant by St. Venant's series (Timoshenko and Goodier, Theory of Elasticity, art. 109).

        J = a b^3 / 3 [1 - 192 b / (pi^5 a) sum over odd n of tanh(n pi a / 2b) / n^5], a >= b, mm^4.
        The sum is taken as its limit for a long section less a remainder that falls as exp(-n pi a / b):
        exact to rounding.
        """
        b, a = sorted((self.thickness_mm, self.width_mm))
        remainder = sum(
            2.0 / (math.exp(min(n * math.pi * a / b, 700.0)) + 1.0) / n**5 for n in range(1, 16, 2)
        )
        total = _SUM_ODD_FIFTH_POWERS - remainder
        return a * b**3 / 3.0 * (1.0 - 192.0 * b / (math.pi**5 * a) * total)

    @property
    def c_vertical_mm(self) -> float:
        """t / 2, mm."""
        return self.thickness_mm / 2.0

    @property
    def c_lateral_mm(self) -> float:
        """w / 2, mm."""
        return self.width_mm / 2.0


@dataclass(frozen=True, repr=False)
class Taper(OneLine):
    """A section whose dimensions vary linearly along a segment.

    Attributes:
        start: section at the end nearer the base.
        end: section at the end nearer the tip, of the same kind.

    Raises:
        WhiskerError: the two ends are of different kinds.
    """

    start: Section
    end: Section

    def __post_init__(self) -> None:
        self.start.blend(self.end, 0.5)


SectionLike: TypeAlias = Section | Taper
"""A constant section or a tapering one."""
