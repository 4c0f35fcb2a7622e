"""The exact bent whisker: reference values, elliptic integrals, shooting, equilibrium, linear limit."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from scipy import integrate, optimize, special

from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.elastica import ElasticaError, enhancement_exact, large_deflection, linear_error
from whisker_array.whisker.enhancement import (
    contact_direction,
    contact_force,
    enhancement_factor,
    moment_n_mm,
    rotation,
)
from whisker_array.whisker.sections import MUSIC_WIRE, Rectangle, Round, Taper, WhiskerError
from whisker_array.whisker.shapes import Chain, LShaped, Whisker, straight_whisker

SOLVER = 1e-6
"""solve_bvp is asked for 1e-7 of relative residual; ten times that bounds the error of force and tip."""
WIRE = LShaped(30.0, 2.5, None, 0.0, Round(0.3))


def ei_at(whisker: Whisker, segment: int, t: float) -> float:
    s = whisker.segments()[segment]
    return s.material.e_mpa * s.section_at(t).i_vertical_mm4


# --- known answers


@pytest.mark.parametrize(
    ("lift", "force", "moment", "back"),
    [
        (1.0, 0.83, 0.47, 0.105),
        (2.0, 1.43, 0.85, 0.170),
        (3.0, 1.80, 1.14, 0.196),
        (5.0, 1.87, 1.43, 0.129),
        (8.0, 0.25, 1.16, -0.272),
    ],
)
def test_reference_values(lift: float, force: float, moment: float, back: float) -> None:
    # per cent and mm to the printed digit; back: away from the base, which is -x
    exact, error = large_deflection(WIRE, lift_mm=lift), linear_error(WIRE, lift_mm=lift)
    assert round(100 * error.force, 2) == force
    assert round(100 * error.moment, 2) == moment
    assert round(-exact.tip_shift_mm[0], 3) == back
    # the linear tip runs back by 1.5 k = 0.125 mm a mm
    assert error.shift_mm == pytest.approx(-0.125 * lift - exact.tip_shift_mm[0], rel=1e-12)


def elliptic_cantilever(load: float) -> tuple[float, float, float]:
    """Bisshopp and Drucker (1945): rise, shortening and tip angle over the length at load = P l^2 / EI."""
    root = math.sqrt(load)

    def moduli(tip: float) -> tuple[float, float]:
        m = (1.0 + math.sin(tip)) / 2.0
        return m, math.asin(1.0 / math.sqrt(2.0 * m))

    def too_long(tip: float) -> float:
        m, phi = moduli(tip)
        return float(special.ellipk(m) - special.ellipkinc(phi, m)) - root

    tip = optimize.brentq(too_long, 1e-9, math.pi / 2 - 1e-9, xtol=1e-15)
    m, phi = moduli(tip)
    rise = 1.0 - 2.0 / root * float(special.ellipe(m) - special.ellipeinc(phi, m))
    return rise, 1.0 - math.sqrt(2.0 * math.sin(tip)) / root, tip


def test_elliptic_integrals_are_the_published_table() -> None:
    # Mattiasson (1981), P l^2 / EI = 1 and 10: rise, shortening, angle
    assert elliptic_cantilever(1.0) == pytest.approx((0.30172, 0.05643, 0.46135), abs=6e-6)
    assert elliptic_cantilever(10.0) == pytest.approx((0.81061, 0.55500, 1.43029), abs=6e-6)


@pytest.mark.parametrize("load", [0.05, 0.5, 1.0, 3.0, 10.0])
def test_straight_cantilever_is_the_elliptic_one(load: float) -> None:
    length, section = 40.0, Rectangle(0.3, 1.8)
    rise, shorter, tip = elliptic_cantilever(load)
    exact = large_deflection(straight_whisker(length, 0.0, section), lift_mm=rise * length)
    ei = MUSIC_WIRE.e_mpa * section.i_vertical_mm4
    # the angle root is good to 1e-15 but the load is flat in it near the fold: the solver sets the tolerance
    assert exact.force_n[1] == pytest.approx(load * ei / length**2, rel=SOLVER)
    assert exact.tip_shift_mm == pytest.approx([shorter * length, rise * length, 0.0], abs=SOLVER * length)
    end = (
        exact.shape_mm[-1] - exact.shape_mm[-2]
    )  # half a chord short of the tip, where there is no curvature
    assert math.atan2(end[1], -end[0]) == pytest.approx(tip, abs=2e-4 * load)


# --- an independent implementation: shooting from the clamp


def shoot(whisker: Whisker, lift: float, mu: float, alpha: float) -> tuple[np.ndarray, float]:
    """Force and x of the tip by integrating the moment balance M' = -p' x f from the clamp (unknowns f_n, M)."""
    push = (rotation(alpha) @ contact_direction(mu))[:2]
    segments = whisker.segments()
    rest_tip = (segments[-1].end_mm - segments[0].start_mm)[:2]
    model = whisker.tip_model()
    f_scale = lift / float(model.compliance_mm_per_n[1, :2] @ push)
    m_scale = abs(f_scale) * np.linalg.norm(rest_tip)

    def trace(unknown: np.ndarray) -> np.ndarray:
        fx, fy = unknown[0] * f_scale * push
        state = np.array([0.0, unknown[1] * m_scale, 0.0, 0.0])  # psi, M, x, y
        for i, segment in enumerate(segments):
            along = segment.axes[0]
            angle, length = math.atan2(along[1], along[0]), segment.length_mm

            def slope(s: float, v: np.ndarray, i: int = i, angle: float = angle, length: float = length):
                c, n = math.cos(angle + v[0]), math.sin(angle + v[0])
                return [v[1] / ei_at(whisker, i, min(s / length, 1.0)), -(c * fy - n * fx), c, n]

            run = integrate.solve_ivp(slope, (0.0, length), state, method="DOP853", rtol=1e-10, atol=1e-12)
            state = run.y[:, -1]
        return state

    def miss(unknown: np.ndarray) -> list[float]:
        end = trace(unknown)
        return [end[1] / m_scale, (end[3] - rest_tip[1] - lift) / lift]

    arm = (rest_tip[0] * push[1] - rest_tip[1] * push[0]) / np.linalg.norm(rest_tip)
    found = optimize.root(miss, [1.0, arm], tol=1e-11)
    assert found.success
    return found.x[0] * f_scale * push, trace(found.x)[2] - rest_tip[0]


CHAIN = Chain(
    np.array([[1.0, 2.0, 3.0], [-9.0, 1.0, 3.0], [-20.0, -2.0, 3.0], [-24.0, -8.0, 3.0]]),
    (Rectangle(0.4, 3.0), Taper(Rectangle(0.4, 3.0), Rectangle(0.2, 2.0)), Round(0.3)),
    l3_mm=4.0,
)
ANY: tuple[Whisker, ...] = (
    LShaped(30.0, 4.0, 1.0, 0.3, Rectangle(0.3, 1.8)),
    LShaped(30.0, 3.0, None, -0.2, Taper(Round(0.6), Round(0.25))),
    straight_whisker(25.0, 0.6, Taper(Rectangle(0.4, 3.0), Rectangle(0.15, 3.0))),
    CHAIN,
)


@pytest.mark.parametrize(
    ("whisker", "lift", "mu", "alpha"),
    [(w, *((3.0, 0.3, -0.6), (4.0, 0.1, 0.5))[k % 2]) for k, w in enumerate(ANY)],
)
def test_shooting_agrees(whisker: Whisker, lift: float, mu: float, alpha: float) -> None:
    force, shift = shoot(whisker, lift, mu, alpha)
    exact = large_deflection(whisker, lift_mm=lift, mu=mu, alpha_rad=alpha)
    np.testing.assert_allclose(exact.force_n[:2], force, rtol=SOLVER, atol=SOLVER * np.linalg.norm(force))
    assert exact.tip_shift_mm[0] == pytest.approx(shift, abs=SOLVER * lift)


# --- limits


def orders(values: list[float]) -> list[float]:
    """Observed order of each quantity whose lift is halved from one value to the next."""
    return [math.log2(abs(a / b)) for a, b in itertools.pairwise(values)]


LIFTS = (0.8, 0.4, 0.2, 0.1)


@pytest.mark.parametrize("k", [0.033, 0.117, 0.3])
def test_l_shaped_whisker_is_linear_to_first_order(k: float) -> None:
    # the arm turns with the elbow (angle 1.5 lift / l1): it lengthens the lever by k times that, raises the tip
    # by half of k (1.5 lift/l1)^2; together 3.375 k in the force, less 1.5 k of the lever in the moment
    whisker = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.3))
    errors = [linear_error(whisker, lift_mm=lift) for lift in LIFTS]
    # Richardson over the last two: what is left is of second order with a factor near one
    first = [
        2.0 * getattr(errors[3], name) / LIFTS[3] - getattr(errors[2], name) / LIFTS[2]
        for name in ("force", "moment")
    ]
    assert first[0] * 30.0 == pytest.approx(3.375 * k, abs=2e-4)
    assert first[1] * 30.0 == pytest.approx(1.875 * k, abs=2e-4)


@settings(max_examples=12, deadline=None)
@given(
    k=st.floats(0.02, 0.25),
    beta=st.floats(-0.5, 0.8),
    l3=st.floats(-2.0, 8.0),
    mu=st.floats(0.0, 0.5),
    alpha=st.floats(-0.7, 0.7),
)
def test_tiny_lift_is_the_linear_beam(k: float, beta: float, l3: float, mu: float, alpha: float) -> None:
    whisker = LShaped(30.0, 30.0 * k, l3, beta, Rectangle(0.3, 1.8))
    model, lift = whisker.tip_model(axial=False), 3e-5
    push = contact_force(1.0, alpha_rad=alpha, mu=mu)
    give = float(model.compliance_mm_per_n[1] @ push)
    if give < 0.2 * model.compliance_mm_per_n[1, 1]:
        return  # jammed, or so near to it that the linear beam holds at no lift to speak of
    force = lift / give * push
    exact = large_deflection(whisker, lift_mm=lift, mu=mu, alpha_rad=alpha)
    # lift / l1 is 1e-6; its factor in the error is of the order of one over the give's share
    np.testing.assert_allclose(exact.force_n, force, rtol=3e-5, atol=1e-12)
    np.testing.assert_allclose(exact.tip_shift_mm, model.compliance_mm_per_n @ force, atol=1e-4 * lift)
    scale = np.linalg.norm(force) * 30.0
    assert exact.moment_n_mm == pytest.approx(moment_n_mm(force, model), abs=3e-5 * scale)


# --- equilibrium of whatever comes out

whiskers = st.builds(
    LShaped,
    l1_mm=st.floats(10.0, 60.0),
    l2_mm=st.floats(0.3, 8.0),
    l3_mm=st.floats(-3.0, 8.0),
    beta_rad=st.floats(-0.4, 0.8),
    section=st.sampled_from(
        [Round(0.3), Rectangle(0.3, 4.5), Taper(Round(0.5), Round(0.25)), Rectangle(0.9, 0.3)]
    ),
)


@settings(max_examples=15, deadline=None)
@given(whisker=whiskers, share=st.floats(0.01, 0.2), mu=st.floats(0.0, 0.4), alpha=st.floats(-0.6, 0.5))
def test_bent_line_is_in_equilibrium(whisker: LShaped, share: float, mu: float, alpha: float) -> None:
    lift = share * whisker.l1_mm
    try:
        exact = large_deflection(whisker, lift_mm=lift, mu=mu, alpha_rad=alpha)
    except ElasticaError:
        reject()  # it slips through, jams or folds: `test_snapping_through_is_told_where_it_is`
    push = rotation(alpha) @ contact_direction(mu)
    np.testing.assert_allclose(np.cross(exact.force_n, push), 0.0, atol=1e-12 * np.linalg.norm(exact.force_n))
    assert exact.tip_shift_mm[1] == lift
    first, second = whisker.segments()
    rest = (second.end_mm - first.start_mm)[:2]
    line = exact.shape_mm
    np.testing.assert_allclose(line[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(line[-1], rest + exact.tip_shift_mm[:2], atol=1e-9)
    # moment at the sensor: arm to the deformed tip, from l3 below the clamp
    arm = line[-1] + [0.0, whisker.lowered_mm]
    assert exact.moment_n_mm == pytest.approx(arm[0] * exact.force_n[1] - arm[1] * exact.force_n[0], rel=1e-9)
    # each length as at rest, each turn of the line the moment there over EI: chords of 1/64 of a segment,
    # whose turn misses the curvature by (1/64)^2 of it and the tip by the solver's error
    half = len(line) // 2
    peak = max(np.abs((line[-1] - line) @ [exact.force_n[1], -exact.force_n[0]]))
    for i, (segment, part) in enumerate(((first, line[: half + 1]), (second, line[half:]))):
        step = np.diff(part, axis=0)
        chord, length = np.hypot(*step.T), segment.length_mm / (len(part) - 1)
        np.testing.assert_allclose(chord, length, rtol=1e-3)
        assert chord.max() <= length * (1 + 1e-6)
        angle = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        arms = line[-1] - part[1:-1]
        moment = arms[:, 0] * exact.force_n[1] - arms[:, 1] * exact.force_n[0]
        ei = [ei_at(whisker, i, (j + 1) / (len(part) - 1)) for j in range(len(moment))]
        np.testing.assert_allclose(np.diff(angle) / length * ei, moment, atol=2e-3 * peak)


# --- enhancement


def test_enhancement_tends_to_eq_16() -> None:
    whisker = default_whisker(5.0)
    ideal = enhancement_factor(whisker.tip_model(axial=False), alpha_rad=math.pi / 4, mu=0.2)
    gaps = [
        enhancement_exact(whisker, preload_mm=d, alpha_rad=math.pi / 4, mu=0.2) - ideal
        for d in (0.4, 0.2, 0.1, 0.05)
    ]
    assert orders(gaps) == pytest.approx([1.0] * 3, abs=0.02)
    assert abs(gaps[-1]) < 1e-3
    assert gaps[0] < 0.0  # bending dulls the edge: the arm no longer hangs straight down
    assert enhancement_exact(whisker, preload_mm=1.0, alpha_rad=0.0, mu=0.2) == 1.0


# --- the worst of force and moment


def test_refusals_say_what_is_wrong() -> None:
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ElasticaError, match="lift_mm"):
            large_deflection(WIRE, lift_mm=bad)
    with pytest.raises(ElasticaError, match="lower the lift"):
        large_deflection(WIRE, lift_mm=40.0)
    with pytest.raises(WhiskerError, match="radians"):
        large_deflection(WIRE, lift_mm=1.0, alpha_rad=45.0)
    with pytest.raises(WhiskerError, match="mu"):
        large_deflection(WIRE, lift_mm=1.0, mu=-0.1)
    with pytest.raises(ElasticaError, match="jams"):
        large_deflection(LShaped(30.0, 15.0, None, 0.0, Round(0.6)), lift_mm=1.0, alpha_rad=1.05)
    with pytest.raises(ElasticaError, match="plane"):
        large_deflection(Chain(np.array([[0.0, 0, 0], [-9, -1, 1]]), Round(0.3)), lift_mm=0.5)


def test_snapping_through_is_told_where_it_is() -> None:
    # Under a growing force along the normal of a 0.5 rad slope the tip of this long arm rises, then sinks: no
    # force holds it higher. Shot from the tip to the clamp with the rotation of the tip as the unknown.
    whisker, slope = LShaped(10.0, 8.0, 0.0, 0.0, Round(0.3)), 0.5
    fx, fy = math.sin(slope), math.cos(slope)
    ei = ei_at(whisker, 0, 0.0)

    def back(force: float, turn: float) -> np.ndarray:
        state = np.array([turn, 0.0, 0.0, 0.0])  # psi, M, x and y from the tip
        for rest, length in ((-math.pi / 2, 8.0), (math.pi, 10.0)):

            def rate(_: float, v: np.ndarray, rest: float = rest) -> list[float]:
                c, n = math.cos(rest + v[0]), math.sin(rest + v[0])
                return [-v[1] / ei, force * (c * fy - n * fx), -c, -n]

            run = integrate.solve_ivp(rate, (0.0, length), state, method="DOP853", rtol=1e-6, atol=1e-8)
            state = run.y[:, -1]
        return state

    turn, lifts = 0.0, []
    for force in np.linspace(0.05, 0.75, 24):
        turn = optimize.newton(lambda t, force=force: back(force, t)[0], turn, x1=turn + 1e-3, tol=1e-9)
        lifts.append(8.0 - back(force, turn)[3])
    highest = max(lifts)
    assert lifts[-1] < highest
    assert large_deflection(whisker, lift_mm=0.99 * highest, alpha_rad=slope).tip_shift_mm[0] > 0.0
    with pytest.raises(ElasticaError, match=r"beyond a lift of 0\.67\d? mm.*slips"):
        large_deflection(whisker, lift_mm=1.01 * highest, alpha_rad=slope)
