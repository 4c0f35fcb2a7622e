"""Request and limits of a design, and the distance of a whisker from each limit.

constraint            quantity                                              limit
jamming               e_y.D11 (n - mu t) on the steepest wall / on land     a fifth (fivefold force)
stress, force         bending stress, normal force on the steepest wall     half of yield, 0.5 N
groove floor          preload                                               1.2 depths (Assumption 3)
deflection, linear    |D11 f| / l1, elastica against linear beam            10 %, 2 % (Assumption 1)
sideways slide        d0 Dzz/Dyy tan(alpha), on a wall along the trace      half a line pitch
quasi-static          speed / four line pitches / first frequency           a tenth (Assumption 5)
signal                strain at the base on the land                        200 microstrain
elbow, clamp          heights above the land                                clear of the plate
axis                  height of the sensor's axis above the land            1.5 mm
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from glyphs.errors import MarksError
from glyphs.ranges import Positive, Validated
from glyphs.surface.display import OneLine
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAMPLES_PER_LINE_PITCH, usual_speed_mm_s
from whisker_array.whisker.sections import MUSIC_WIRE, Material
from whisker_array.whisker.validity import LINEAR_ERROR_LIMIT

NARROWEST_STROKE_HEIGHTS = 1.0 / 14.0
"""ISO 3098, lettering A."""
_TOUCHING = 5e-3


class DesignError(MarksError):
    """A request or design that is not possible."""


class Bound(enum.Enum):
    """The constraints of a design; see the module's docstring."""

    JAMMING = "jamming"
    STRESS = "stress"
    FORCE = "force"
    GROOVE_FLOOR = "groove floor"
    DEFLECTION = "deflection"
    LINEAR_BEAM = "linear beam"
    SLIDE = "slide"
    SPEED = "speed"
    SIGNAL = "signal"
    ELBOW = "elbow"
    CLAMP = "clamp"
    AXIS = "axis"
    LOWERED = "lowered"
    WIDTH = "width"
    LENGTH = "length"
    K = "k"
    BETA = "beta"
    THICKNESS = "thickness"
    ASPECT = "aspect"


@dataclass(frozen=True, repr=False)
class Request(OneLine, Validated, error=DesignError):
    """Use of a whisker: gentlest and steepest wall, rad, friction, marks and speed. Raises DesignError."""

    alpha_rad: tuple[float, float]
    mu: tuple[float, float]
    depth_mm: Positive
    character_height_mm: Positive
    speed_mm_s: Positive | None = None
    material: Material = MUSIC_WIRE

    def __post_init__(self) -> None:
        low, high = self.alpha_rad
        if not 0.0 < low <= high < math.pi / 2.0:
            raise DesignError(
                f"walls of {math.degrees(low):g} to {math.degrees(high):g} degrees are impossible: give the "
                "gentlest and the steepest, above 0 and below 90 degrees"
            )
        if not 0.0 <= self.mu[0] <= self.mu[1] < 2.0:
            raise DesignError(
                f"friction of {self.mu[0]:g} to {self.mu[1]:g} is impossible: give 0 <= low <= high < 2"
            )
        super().__post_init__()
        if self.depth_mm > 0.5 * self.character_height_mm:
            raise DesignError(
                f"marks {self.depth_mm:g} mm deep with characters {self.character_height_mm:g} mm high are impossible: "
                "the depth is at most half the height"
            )

    @property
    def least_speed_mm_s(self) -> float:
        return self.speed_mm_s or usual_speed_mm_s(self.character_height_mm)

    @property
    def line_pitch_mm(self) -> float:
        """Forty lines per character height, as in `array.default_plan`."""
        return self.character_height_mm / LINES_PER_HEIGHT

    @property
    def narrowest_wall_mm(self) -> float:
        return self.depth_mm / math.tan(self.alpha_rad[1])

    @property
    def sample_pitch_mm(self) -> float:
        """Half a line pitch, as in `array.default_plan`, but at least two samples on the steepest wall."""
        return min(self.line_pitch_mm / SAMPLES_PER_LINE_PITCH, self.narrowest_wall_mm / 2.0)

    @property
    def tip_radius_mm(self) -> float:
        """Radius of the largest ball (against wear) that shows the steepest slope on half a wall and fits a stroke: at
        the foot of the wall it rounds off r sin(alpha) of the slope, and its diameter is at most half of h/14."""
        by_wall = 0.5 * self.narrowest_wall_mm / math.sin(self.alpha_rad[1])
        return min(by_wall, 0.25 * NARROWEST_STROKE_HEIGHTS * self.character_height_mm)


@dataclass(frozen=True, repr=False)
class Limits(OneLine):
    """Limits of manufacture and use; see the module's docstring.

    Attributes:
        width_heights: widest ribbon in character heights; whiskers are a height apart, or in staggered rows.
        lift_share: least e_y.D11 (n - mu t) on a wall over its land value; the contact solver reports a jam at a
            tenth (`contact_kernel.JAM_FORCE`).
        clearance_depths: least room between the land and the clamp or elbow, in depths of the marks.
        axis_raise: greatest height of the sensor's axis above the clamp, in l1; 0: it is only lowered, as in the paper.
        axis_clearance_mm: least height of the sensor's axis above the land: room for a foil gauge on its carrier, with
            its cable.
    """

    l1_mm: tuple[float, float] = (5.0, 80.0)
    thickness_mm: tuple[float, float] = (0.05, 1.0)
    aspect: tuple[float, float] = (1.0, 40.0)
    width_heights: float = 0.9
    k: tuple[float, float] = (0.001, 0.5)
    beta_rad: tuple[float, float] = (0.0, math.pi / 4.0)
    lift_share: float = 0.2
    safety: float = 2.0
    force_n: float = 0.5
    linear_error: float = LINEAR_ERROR_LIMIT
    slide_lines: float = 0.5
    strain: float = 200e-6
    clearance_depths: float = 1.0
    axis_raise: float = 0.0
    axis_clearance_mm: float = 1.5


@dataclass(frozen=True)
class Constraint:
    """One line of the table."""

    bound: Bound
    value: float
    limit: float
    at_most: bool

    @property
    def slack(self) -> float:
        """Room left, relative to the limit (beta >= 0: in rad); negative where violated."""
        room = self.limit - self.value if self.at_most else self.value - self.limit
        return room / abs(self.limit) if self.limit else room

    @property
    def binding(self) -> bool:
        """Whether the limit is reached, within half a percent."""
        return self.slack < _TOUCHING
