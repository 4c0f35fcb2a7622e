"""Contact with friction against MuJoCo: whiskers of links and springs dragged over wedges, straight and banked.

MuJoCo knows nothing of compliance matrices, of eq. (16) or of our minimiser: it integrates joints in time, with a
contact solver of its own, and large rotations. Where the two agree, the mechanics is right.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TypeAlias

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("mujoco", reason="an independent contact solver: pip install 'tactile-marks[proof]'")

from glyphs.surface.maps import HeightMap
from tests.support.mujoco_whisker import Drag, Wedge, drag
from tests.support.trace_frame import trace_contact
from whisker_array.simulation.contact import land_lag_mm
from whisker_array.simulation.surface import TouchSurface, prepare_surface
from whisker_array.simulation.traces import SampleFlag, Traces
from whisker_array.whisker.enhancement import land_moment_n_mm, moment_ratio
from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped, straight_whisker

Vector = NDArray[np.float64]
Whisker: TypeAlias = LShaped

D0 = 0.25
"""Small against l1 = 30 mm: MuJoCo's whisker turns as it bends, which is worth D0 / l1 or 1 % at the most."""
RADIUS_D0, PITCH_D0 = 0.05, 0.01
LEAD_D0 = 1.0
"""Travel on the land before the seam; a tip set down at rest slides steadily after a third of it."""

LAND, RAMP = 0.005, 0.02
"""Of the land's moment. What is left: large rotation, of the order of D0 / l1; the give of MuJoCo's contact,
0.4 % of d0 + h, and the steeper the ramp the more; the midpoint rule of 15 links, 0.11 %."""
MEAN = 0.01
"""Mean of the whole run's absolute deviation, corner and all."""
APART, APART_MM = 0.02, 0.04
"""Travel over which the two are further apart than that. At a corner the moment goes up to 35 % within a tenth of d0
and where the tip snaps within less, so that a small shift is a great difference; but it must be over soon."""
FACTOR = 0.01
"""Of F by eq. (16), tip height taken from MuJoCo; and this share of F's departure from 1:"""
FACTOR_EFFECT = 0.12

WIRE = LShaped(30.0, 30.0 * 0.117, None, 0.0, Round(0.4))
SHORT_ARM = LShaped(30.0, 30.0 * 0.05, None, 0.0, Round(0.4))
RIBBON = LShaped(30.0, 30.0 * 0.117, None, 0.0, Rectangle(0.3, 4.5))
LEANING = LShaped(30.0, 30.0 * 0.083, 1.0, 0.3, Round(0.4))
STRAIGHT = straight_whisker(30.0, 0.5, Round(0.4))

PLANAR = [
    (WIRE, -60.0, 0.5), (WIRE, 45.0, 0.3), (SHORT_ARM, 60.0, 0.1), (RIBBON, -60.0, 0.1), (LEANING, -45.0, 0.3),
]  # fmt: skip
BANKED = [(WIRE, 30.0, 0.1, -0.3), (RIBBON, -30.0, 0.1, 0.5)]


def dragged(whisker: Whisker, degrees: float, mu: float, bank: float = 0.0, d0: float = D0) -> Drag:
    """Over the land and, if there is one, about half a preload down or up the ramp; each drag is made once."""
    return _dragged(whisker, degrees, mu, bank, d0)


@cache
def _dragged(whisker: Whisker, degrees: float, mu: float, bank: float, d0: float) -> Drag:
    slope = math.tan(math.radians(degrees))
    beyond = 0.25 + (0.35 / abs(slope) if slope else 0.0)
    return drag(
        whisker, Wedge(slope, mu, bank), preload_mm=d0, start_mm=-LEAD_D0 * d0,
        travel_mm=(LEAD_D0 + beyond) * d0, radius_mm=RADIUS_D0 * d0, spatial=bank != 0.0,
    )  # fmt: skip


@cache
def wedge_surface(degrees: float, mu: float, bank: float, d0: float) -> TouchSurface:
    """6 d0 along the trace with the seam in the middle; across it 2 d0 if the tip is to slide there."""
    pitch, half = PITCH_D0 * d0, 100 if bank else 1
    x, z = pitch * np.arange(-300, 301), pitch * np.arange(-half, half + 1)
    height = math.tan(math.radians(degrees)) * np.maximum(x, 0.0) + bank * z[:, None]
    return prepare_surface(
        HeightMap(height.astype(np.float32), pitch), tip_radius_mm=RADIUS_D0 * d0, friction=mu
    )


def traced(whisker: Whisker, degrees: float, mu: float, bank: float = 0.0, d0: float = D0) -> Traces:
    """Ours at the same places of the base."""
    free = dragged(whisker, degrees, mu, bank, d0).free_tip_x_mm
    surface, tip = wedge_surface(degrees, mu, bank, d0), whisker.tip_model()
    rows, cols = surface.shape
    middle = 0.5 * surface.pitch_mm * np.array([rows - 1, cols - 1])
    lag = land_lag_mm(tip, preload_mm=d0, friction=mu)  # traces are labelled by the tip on the land
    return trace_contact(
        surface, tip, lines_mm=middle[:1], start_mm=float(free[0] + lag + middle[1]),
        step_mm=float(free[-1] - free[0]) / (free.size - 1), n_samples=free.size,
        preload_mm=d0, nominal_friction=mu,
    )  # fmt: skip


def deviation(whisker: Whisker, degrees: float, mu: float, bank: float = 0.0, d0: float = D0) -> Vector:
    """MuJoCo's moments less ours, as a share of the land's, reading by reading."""
    theirs, ours = dragged(whisker, degrees, mu, bank, d0), traced(whisker, degrees, mu, bank, d0)
    assert not (ours.flags & (SampleFlag.CONTACT_LOST | SampleFlag.JAMMED | SampleFlag.OUTSIDE)).any()
    land = land_moment_n_mm(whisker.tip_model(), preload_mm=d0, mu=mu)
    return np.asarray((theirs.moment_n_mm - ours.moment_n_mm[0]) / land)


def land_reading(run: Drag) -> int:
    """The last reading well before the seam: the tip is up to 0.3 d0 away from its force-free place."""
    return int(np.searchsorted(run.free_tip_x_mm, -0.4 * D0))


def figures(whisker: Whisker, degrees: float, mu: float, bank: float = 0.0) -> tuple[float, ...]:
    """Deviations on the land and at the end of the ramp, their mean, and the travel in mm with more than APART.

    The mean and the travel are from a third of the land on.
    """
    off = deviation(whisker, degrees, mu, bank)
    run = dragged(whisker, degrees, mu, bank)
    at = run.free_tip_x_mm
    begun = int(np.searchsorted(at, -0.7 * LEAD_D0 * D0))
    size = np.abs(off[begun:])
    apart = float((size > APART).mean() * (at[-1] - at[begun]))
    return float(off[land_reading(run)]), float(off[-1]), float(size.mean()), apart


def factor(whisker: Whisker, degrees: float, mu: float) -> float:
    """F as MuJoCo has it: the ratio of ramp and land, over that of d0 + h where the tip is."""
    run = dragged(whisker, degrees, mu)
    lift = D0 + run.tip_mm[:, 1]
    gain = run.moment_n_mm / lift
    return float(gain[-1] / gain[land_reading(run)])


@pytest.mark.parametrize(("whisker", "degrees", "mu"), PLANAR)
def test_a_drag_over_an_edge_is_what_contact_says(whisker: LShaped, degrees: float, mu: float) -> None:
    land, ramp, mean, apart = figures(whisker, degrees, mu)
    assert abs(land) < LAND
    assert abs(ramp) < RAMP
    assert mean < MEAN
    assert apart < APART_MM


@pytest.mark.parametrize(("whisker", "degrees", "mu"), PLANAR)
def test_the_factor_is_eq_16(whisker: LShaped, degrees: float, mu: float) -> None:
    slope = math.tan(math.radians(degrees))
    expected = float(moment_ratio(slope, mu, whisker.tip_model()))
    got = factor(whisker, degrees, mu)
    assert got == pytest.approx(expected, rel=FACTOR)
    assert abs(got - expected) < FACTOR_EFFECT * abs(expected - 1.0)
    # it slides: the force lies on the rim of the friction cone, against the motion
    force = dragged(whisker, degrees, mu).force_n[-1]
    assert force[0] / force[1] == pytest.approx(-(slope + mu) / (1.0 - mu * slope), rel=1e-6)


@pytest.mark.parametrize(("degrees", "mu"), [(-45.0, 0.5), (30.0, 0.1)])
def test_a_straight_whisker_is_a_profilometer(degrees: float, mu: float) -> None:
    assert factor(STRAIGHT, degrees, mu) == pytest.approx(1.0, abs=FACTOR)


@pytest.mark.parametrize(("whisker", "degrees", "mu", "bank"), BANKED)
def test_on_a_banked_surface_the_tip_slides_sideways_as_contact_says(
    whisker: LShaped, degrees: float, mu: float, bank: float
) -> None:
    """In three dimensions: wire slides down the bank and feels a fifth less; a ribbon hardly does."""
    land, ramp, mean, apart = figures(whisker, degrees, mu, bank)
    assert abs(land) < LAND
    assert abs(ramp) < RAMP
    assert mean < MEAN
    assert apart < APART_MM
    run = dragged(whisker, degrees, mu, bank)
    aside = -float(run.tip_mm[land_reading(run), 2]) / (bank * D0)
    assert aside > 0.5 if whisker is WIRE else 0.0 < aside < 0.05


def test_what_is_left_falls_with_the_preload() -> None:
    """Large rotation is the only thing that D0 / l1 can change: on the land it is first order in it."""
    off = [abs(deviation(WIRE, 0.0, 0.3, d0=d0)[-1]) for d0 in (2.0, 1.0, 0.5)]
    assert off[0] > 0.005
    # halved, and a little for what does not depend on it
    assert off[1] < 0.65 * off[0]
    assert off[2] < 0.65 * off[1]
