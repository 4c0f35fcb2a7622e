"""Friction of the land; height, slope and friction of grooves with known walls, by noisy sensors."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from tests.factories import extruded, ideal_chain, scanned
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.friction import USABLE_SD, FrictionRoute, land_friction
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.estimation.relief import Relief, Route, relief_from_edges
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.touch import Touch, default_touch, profiling_touch

# ---------------------------------------------------------------------------------------------------------- friction

PAIRS = 8
PITCH = 0.02
DEFAULT_TOUCH, PROFILER = default_touch(5.0), profiling_touch(5.0)
FRICTIONS = (0.1, 0.2, 0.3, 0.5)


def grooved_land() -> HeightMap:
    r"""Land with one groove 0.3 mm deep, 45 degrees, along y: ``___/-\___`` upside down."""
    x = np.arange(0.0, 10.0, PITCH)
    z = np.interp(x, [4.0, 4.3, 5.7, 6.0], [0.0, -0.3, -0.3, 0.0])
    return extruded(z, rows=round(4.2 / PITCH), pitch_mm=PITCH)


def land_scan(
    mu: float, *, fidelity: Fidelity = Fidelity.POINTWISE, two_way: bool = True, gain_sd: float | None = 0.03
) -> Scan:
    plan = RasterPlan(
        array=WhiskerArray(PAIRS, 0.5, kinds=2),
        region_mm=(0.8, 0.1, 9.2, 3.9),
        line_pitch_mm=0.125,
        sample_pitch_mm=0.04,
        directions=(TraceDirection.FORWARD_X,),
        lead_mm=0.6,
        two_way=two_way,
    )
    return scanned(
        grooved_land(),
        plan,
        touch=DEFAULT_TOUCH,
        others=(PROFILER,),
        fidelity=fidelity,
        friction=mu,
        gain_sd=gain_sd,
    )


@pytest.mark.parametrize("mu", FRICTIONS)
@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_two_ways_give_the_friction_whatever_the_gains(fidelity: Fidelity, mu: float) -> None:
    found = land_friction(land_scan(mu, fidelity=fidelity))
    assert found[0].route is FrictionRoute.TWO_WAYS
    # noise leaves 0.0002 here; on stamped parts it came out up to 0.0012 too high
    assert found[0].mu == pytest.approx(mu, abs=0.003)
    assert 0.0 < found[0].sd < 0.001
    # gains 3 % apart are 3 % / 1.5 k = 0.17 of mu a pair of whiskers, 0.06 and more in the mean of eight
    assert found[1].route is FrictionRoute.SHAPES
    assert found[1].sd > USABLE_SD


@pytest.mark.parametrize("mu", FRICTIONS)
@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_shapes_give_the_friction_with_gains_from_a_bench(fidelity: Fidelity, mu: float) -> None:
    (found,) = land_friction(land_scan(mu, fidelity=fidelity, two_way=False, gain_sd=0.001))
    assert found.route is FrictionRoute.SHAPES
    assert found.sd < USABLE_SD
    # its own standard error, of eight pairs, and 0.005 for what all pairs have in common
    assert abs(found.mu - mu) < 3.0 * found.sd + 0.005


def test_gains_read_off_land_say_nothing_of_its_friction() -> None:
    chain = ideal_chain(2 * PAIRS)
    calibration = Calibration(chain.gain, chain.offset_n_mm, from_land=True)
    assert land_friction(replace(land_scan(0.4, two_way=False), calibration=calibration)) == ()
    # the way back needs no gains
    (found,) = land_friction(replace(land_scan(0.4), calibration=calibration))
    assert found.route is FrictionRoute.TWO_WAYS
    assert found.mu == pytest.approx(0.4, abs=0.003)


def test_one_whisker_has_no_standard_error() -> None:
    scan = land_scan(0.3)
    sweeps = tuple(s.of(np.array([0, PAIRS])) for s in scan.sweeps)
    for found in land_friction(replace(scan, sweeps=sweeps, kind=(0, 1))):
        assert found.sd == float("inf")


# ---------------------------------------------------------------------------------------------------------- profiled

N = 4
DEPTH = 0.5
# the paper's sensor, at the height of the tip: F = 1.29 at 60 degrees, where that of the default whisker is 1.15
TOUCH = default_touch(5.0).with_whisker(replace(default_whisker(5.0), l3_mm=None))
PROFILERS = {
    "raised sensor": profiling_touch(5.0),
    "straight": replace(
        TOUCH,
        tip=straight_whisker(30.0, math.radians(25.0), Rectangle(0.3, 4.5)).tip_model(),
        whisker="straight",
    ),
}
BEVELS = (30, 45, 60)

Masks = dict[str, np.ndarray]


def profile(x_mm: np.ndarray, alpha_deg: float) -> np.ndarray:
    """Height of a groove: land to 4 mm, wall, floor to 8 mm, wall, land."""
    w = DEPTH / math.tan(math.radians(alpha_deg))
    return np.interp(x_mm, [4.0, 4.0 + w, 8.0, 8.0 + w], [0.0, -DEPTH, -DEPTH, 0.0])


@cache
def piece(alpha_deg: float) -> HeightMap:
    x = np.arange(0.0, 12.0, PITCH)
    return extruded(profile(x, alpha_deg), rows=80, pitch_mm=PITCH)


def scan_of(
    alpha_deg: float,
    mu: float,
    fidelity: Fidelity,
    *,
    others: tuple[Touch, ...] = (),
    two_way: bool = False,
    directions: tuple[TraceDirection, ...] = (TraceDirection.FORWARD_X,),
) -> Scan:
    rows = 1 + len(others)
    plan = RasterPlan(
        array=WhiskerArray(N, 0.25, kinds=rows),
        region_mm=(1.0, 0.3, 11.0, 1.27),
        line_pitch_mm=0.03125,
        sample_pitch_mm=0.02,
        directions=directions,
        lead_mm=0.8,
        two_way=two_way,
    )
    return scanned(piece(alpha_deg), plan, touch=TOUCH, others=others, fidelity=fidelity, friction=mu)


def places(relief: Relief, alpha_deg: float) -> tuple[np.ndarray, Masks]:
    """x of the columns, and the columns on land, either wall and the floor, clear of the ball at the corners."""
    x = relief.origin_mm[0] + np.arange(relief.height_mm.shape[1]) * relief.pitch_mm
    w = DEPTH / math.tan(math.radians(alpha_deg))
    return x, {
        "land": (x > 2.0) & (x < 3.5),
        "fall": (x > 4.07) & (x < 4.0 + w - 0.06),
        "floor": (x > 4.0 + w + 0.3) & (x < 7.5),
        "rise": (x > 8.06) & (x < 8.0 + w - 0.07),
    }


def ball_rise_mm(alpha_deg: float) -> float:
    """How much higher than the wall the lowest point of a ball runs over it: r (1 / cos(alpha) - 1)."""
    return TOUCH.tip_radius_mm * (1.0 / math.cos(math.radians(alpha_deg)) - 1.0)


def bias_sd(values: np.ndarray) -> tuple[float, float]:
    assert np.isfinite(values).mean() > 0.5, "most of it must be known to speak of a bias"
    return float(np.nanmean(values)), float(np.nanstd(values))


# every bevel and friction with either profiler, and the steepest and roughest, which jams, with both
@pytest.mark.parametrize(
    ("profiler", "alpha_deg", "mu"),
    [
        *zip(["raised sensor"] * 4, (30, 45, 60, 60), (0.5, 0.3, 0.1, 0.5), strict=True),
        *zip(["straight"] * 4, (30, 45, 60, 60), (0.1, 0.5, 0.3, 0.5), strict=True),
    ],
)
@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_bias_and_spread_with_noise(fidelity: Fidelity, profiler: str, alpha_deg: int, mu: float) -> None:
    scan = scan_of(alpha_deg, mu, fidelity, others=(PROFILERS[profiler],), two_way=True)
    relief = estimate_relief(scan)
    assert relief.route is Route.PROFILED
    assert relief.slope_y is None
    # 0.0001 was seen here, up to 0.0012 on stamped parts
    assert relief.friction == pytest.approx(mu, abs=0.003)
    assert relief.friction_sd < 0.001
    x, on = places(relief, alpha_deg)
    angle = np.degrees(np.arctan(relief.slope_x))
    # seen: biases of -0.4 to 1.4 degrees, most at mu = 0.5 where half of a falling wall's pushed samples are left
    # out, and spreads up to 0.66
    for wall, true in (("fall", -alpha_deg), ("rise", alpha_deg)):
        bias, sd = bias_sd(angle[:, on[wall]] - true)
        assert abs(bias) < 1.5, wall
        assert sd < 1.0, wall
    # level ground: the land's fit lets the groove's rims in and is 0.1 to 0.2 % off beside it, which is
    # 0.001 / 1.5 k = 0.3 degrees on land and twice that on the floor, where the lift is half; the zero that walks by
    # 0.3 % of full scale a minute brings it to 1.55 in one case
    assert abs(bias_sd(angle[:, on["land"]])[0]) < 0.8
    assert abs(bias_sd(angle[:, on["floor"]])[0]) < 1.7
    # vibration of 0.2 % of the preload and noise; read over the floor, where nothing else can spread it
    bias, sd = bias_sd(1000.0 * (relief.height_mm[:, on["floor"]] + DEPTH))
    assert abs(bias) < 2.0
    assert sd < 1.5
    # on the wall the ball's underside, lower by what samples 0.02 mm apart miss of where the ball touches:
    # r sin(60 deg) = 0.052 mm lies between two of them, 6 um; 1.2 um at 30 degrees, 0.1 at 45
    error = 1000.0 * (relief.height_mm - profile(x, alpha_deg) - ball_rise_mm(alpha_deg))
    for wall in ("fall", "rise"):
        bias, sd = bias_sd(error[:, on[wall]])
        assert abs(bias) < (8.0 if alpha_deg == 60 else 2.0), wall
        assert sd < 2.5, wall
    # pushed back up a steep rough wall so much jams in contact that the way back is left aside
    if relief.friction_map is None:
        assert alpha_deg + math.degrees(math.atan(mu)) > 65.0
        assert fidelity is Fidelity.CONTACT
    else:
        bias, sd = bias_sd(relief.friction_map[:, on["land"]])
        assert bias == pytest.approx(mu, abs=0.01)
        assert sd < 0.02  # one pixel: noise of 0.1 % is 0.006 of mu


@pytest.mark.parametrize("mu", [0.1, 0.5])
@pytest.mark.parametrize("profiler", [None, *PROFILERS])
@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_turned_about_floors_are_right_at_any_assumed_friction(
    fidelity: Fidelity, profiler: str | None, mu: float
) -> None:
    both = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    others = () if profiler is None else (PROFILERS[profiler],)
    relief = estimate_relief(scan_of(45, mu, fidelity, others=others, directions=both))
    assert relief.route is (Route.TURNED if profiler is None else Route.PROFILED)
    # gains 3 % apart say nothing of friction, so the nominal one was assumed
    assert (relief.friction, relief.friction_sd, relief.friction_map) == (TOUCH.friction, None, None)
    _, on = places(relief, 45)
    bias, sd = bias_sd(1000.0 * (relief.height_mm[:, on["floor"]] + DEPTH))
    assert abs(bias) < 2.0  # F = 1 on the floor whatever the friction
    assert sd < 1.5
    fall, rise = (
        float(np.nanmean(np.degrees(np.arctan(relief.slope_x[:, on[wall]])))) for wall in ("fall", "rise")
    )
    # walls are those of the friction assumed, alike on both sides: at 0.5 off by 5 degrees with a profiler, 10 without
    assert abs(fall + 45.0) < 10.5
    assert abs(rise - 45.0) < 10.5
    assert fall + rise == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("alpha_deg", BEVELS)
def test_turned_walls_in_contact_are_put_back_to_where_the_tips_were(alpha_deg: int) -> None:
    both = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    scan = scan_of(alpha_deg, TOUCH.friction, Fidelity.CONTACT, directions=both)
    relief = estimate_relief(scan)
    plain = relief_from_edges(edge_map(scan), TOUCH)
    _, on = places(relief, alpha_deg)
    for wall, sign in (("fall", -1.0), ("rise", 1.0)):
        settled_deg, plain_deg = (
            float(np.nanmean(np.degrees(np.arctan(r.slope_x[:, on[wall]]))))
            for r in (relief, plain)
            if r.slope_x is not None
        )
        # 0.2 seen; without it 8 to 15, since the tips of opposite ways are bent apart
        assert abs(settled_deg - sign * alpha_deg) < 1.0
        assert abs(plain_deg - sign * alpha_deg) > 5.0


def test_without_a_profiler_it_is_the_relief_of_the_edge_map_at_the_friction_measured() -> None:
    both = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    scan = scan_of(45, 0.4, Fidelity.POINTWISE, two_way=True, directions=both)
    relief = estimate_relief(scan)
    assert relief.friction == pytest.approx(0.4, abs=0.003)
    assert relief.friction_sd is not None
    expected = relief_from_edges(edge_map(scan), TOUCH, friction=relief.friction)
    np.testing.assert_array_equal(relief.height_mm, expected.height_mm)
    np.testing.assert_array_equal(relief.slope_x, expected.slope_x)
    # with the friction known the walls are right as well
    _, on = places(relief, 45)
    bias, _ = bias_sd(np.degrees(np.arctan(relief.slope_x[:, on["fall"]])) + 45.0)
    assert abs(bias) < 1.5


def test_rows_on_other_lines_are_refused() -> None:
    scan = scan_of(45, 0.2, Fidelity.POINTWISE, others=(PROFILERS["straight"],))
    (sweep,) = scan.sweeps
    lines = sweep.plan.line_mm + np.repeat([0.0, 0.011], N)
    moved = replace(scan, sweeps=(replace(sweep, plan=replace(sweep.plan, line_mm=lines)),))
    with pytest.raises(MapError, match="do not run on the same lines"):
        estimate_relief(moved)
