"""The dynamic whisker against closed forms, the slow limit, and finite elements solved in time by scipy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.proof.dynamic import (
    CONTACT_DAMPING,
    FINE_ERROR,
    contact_mm_per_n,
    shortest_period_s,
    speed_cost,
    trace_dynamic,
    whisker_modes,
)
from tests.proof.small_model import speed_errors
from whisker_array.design.array_design import BETAS_DEG, SPEED_BY_ERROR
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.traces import SampleFlag, Traces
from whisker_array.whisker.array import SAFE_SPEED_MM_S
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.sections import MUSIC_WIRE, Rectangle
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import default_touch
from whisker_array.whisker.validity import first_bending_frequency_hz, land_force_n

HEIGHT = 5.0
WHISKER = default_whisker(HEIGHT)
TIP = WHISKER.tip_model()
PRELOAD = default_preload_mm(HEIGHT)
MU = 0.2
MODES = whisker_modes(WHISKER)
CONTACT = contact_mm_per_n(
    tip_radius_mm=0.06,
    force_n=float(land_force_n(WHISKER, preload_mm=PRELOAD, mu=MU)[1]),
    material=MUSIC_WIRE,
)
STEP = 0.01
Profile = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def smooth(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rounded groove: 0.1 mm deep, its steepest wall 16 degrees."""
    return np.asarray(-0.1 * np.exp(-(((x - 2.0) / 0.3) ** 2)))


def traced(profile: Profile, speed: float, *, length: float = 4.0, **other: float) -> tuple[Traces, Traces]:
    """Dynamic and slow moments."""
    h = profile(np.arange(0.0, length, STEP))[None].astype(np.float32)
    slow = trace_pointwise(h, TIP, step_mm=STEP, preload_mm=PRELOAD, friction=MU)
    fast = trace_dynamic(
        h, MODES, step_mm=STEP, speed_mm_s=speed, preload_mm=PRELOAD, friction=MU,
        contact_mm_per_n=CONTACT, **other,
    )  # fmt: skip
    return fast, slow


def apart(speed: float, **other: float) -> float:
    """Greatest difference to the slow moment, in land moments, less what the contact itself gives."""
    fast, slow = traced(smooth, speed, **other)
    land = float(slow.moment_n_mm[0, 0])
    still = float(fast.moment_n_mm[0, 40]) - land  # on level land, long before the groove
    return float(np.abs((fast.moment_n_mm[0, 40:] - slow.moment_n_mm[0, 40:] - still) / land).max())


def test_modes_are_those_of_beam_tables() -> None:
    """Blevins, table 8-1: lambda L = 1.875 clamped and free, 3.927 clamped and pinned; masses are lumped (0.3 %)."""
    straight = straight_whisker(30.0, 0.0, Rectangle(0.3, 4.5))
    modes = whisker_modes(straight)
    per = math.sqrt(MUSIC_WIRE.e_mpa * 4.5 * 0.3**3 / 12.0 / (MUSIC_WIRE.density_t_mm3 * 4.5 * 0.3)) / (
        2.0 * math.pi * 30.0**2
    )
    assert modes.omega_rad_s[0] / (2.0 * math.pi) == pytest.approx(1.8751**2 * per, rel=3e-3)
    np.testing.assert_allclose(modes.held_hz, np.array([3.9266, 7.0686, 10.2102]) ** 2 * per, rtol=5e-3)


def test_the_first_held_mode_is_that_of_the_validity_check() -> None:
    for whisker in (WHISKER, replace(WHISKER, beta_rad=0.3)):
        expected = first_bending_frequency_hz(whisker, tip_held=True)
        assert whisker_modes(whisker).held_hz[0] == pytest.approx(expected, rel=1e-6)


def test_a_slow_force_lifts_the_tip_as_d11_says() -> None:
    """Exact by construction, but for stretching, which bending modes do not have (2e-5 of the terms)."""
    modes = whisker_modes(WHISKER, held=1)
    yields = (modes.tip / modes.omega_rad_s[:, None] ** 2).T @ modes.tip
    np.testing.assert_allclose(yields[1], TIP.compliance_mm_per_n[1, :2], rtol=2e-5)
    carried = (modes.moment / modes.omega_rad_s**2) @ modes.tip + modes.rest_moment_mm
    np.testing.assert_allclose(carried, TIP.moment_arm_mm[:2], atol=1e-9)


def test_a_slow_stage_gives_the_pointwise_moment_and_the_error_falls_with_speed() -> None:
    """Inertia goes with speed squared, damping with speed; single speeds may hit a mode, so far ones are compared."""
    errors = [apart(v) for v in (160.0, 40.0, 10.0, 2.5)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-4
    order = math.log(errors[0] / errors[-1]) / math.log(64.0)
    assert 1.0 < order < 2.2, errors


def test_half_the_time_step_changes_nothing_that_counts() -> None:
    one, two = (traced(smooth, 100.0, steps_a_period=n)[0].moment_n_mm[0] for n in (16.0, 32.0))
    assert float(np.abs(one - two).max() / abs(one[0])) < 1e-3


def test_beyond_a_cliff_the_tip_is_in_the_air_and_rings_freely() -> None:
    """The land falls by twice the preload: what follows is the free whisker, its frequency and its decay."""
    fast, _ = traced(lambda x: np.where(x > 1.0, -2.0 * PRELOAD, 0.0), 200.0, length=12.0)
    begin = int(2.0 / STEP)
    assert (fast.flags[0, begin:] & np.uint8(SampleFlag.CONTACT_LOST)).all()
    assert not (fast.flags[0, : int(0.9 / STEP)]).any()
    moment = fast.moment_n_mm[0, begin:].astype(np.float64)
    time = np.arange(moment.size) * STEP / 200.0
    # higher modes die out sooner: all have the same share of critical damping
    late = slice(moment.size // 3, None)
    crossings = time[late][1:][np.diff(np.signbit(moment[late])) != 0]
    period = 2.0 * float(np.mean(np.diff(crossings)))
    assert 1.0 / period == pytest.approx(MODES.omega_rad_s[0] / (2.0 * math.pi), rel=0.01)
    tops = [
        np.abs(moment[i : i + round(period * 200.0 / STEP)]).max()
        for i in (moment.size // 3, 2 * moment.size // 3)
    ]
    decay = math.exp(-MODES.damping * MODES.omega_rad_s[0] * time[moment.size // 3])
    assert tops[1] / tops[0] == pytest.approx(decay, rel=0.05)


def test_it_lands_again_and_settles() -> None:
    """A wide pit deeper than the preload: off the surface within, and on the land's moment a while behind it."""

    def pit(x: NDArray[np.float64]) -> NDArray[np.float64]:
        down, up = np.clip((x - 1.0) / 0.5, 0.0, 1.0), np.clip((x - 3.0) / 1.5, 0.0, 1.0)
        return np.asarray(-1.5 * PRELOAD * (down - up))

    fast, slow = traced(pit, 20.0, length=9.0)
    lost = (fast.flags[0] & np.uint8(SampleFlag.CONTACT_LOST)) != 0
    assert lost[int(1.8 / STEP) : int(2.8 / STEP)].all()
    assert not lost[int(6.0 / STEP) :].any()
    assert fast.moment_n_mm[0, -1] == pytest.approx(slow.moment_n_mm[0, -1], rel=2e-3)


def beam_element(
    ei: float, ea: float, mass: float, length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(6, 6) stiffness and consistent mass of a plane Euler-Bernoulli frame element, (u, w, theta) at both ends."""
    k, m = np.zeros((6, 6)), np.zeros((6, 6))
    b, n = [1, 2, 4, 5], [0, 3]
    s = length
    k[np.ix_(b, b)] = (ei / s**3) * np.array(
        [[12, 6 * s, -12, 6 * s], [6 * s, 4 * s * s, -6 * s, 2 * s * s],
         [-12, -6 * s, 12, -6 * s], [6 * s, 2 * s * s, -6 * s, 4 * s * s]]
    )  # fmt: skip
    m[np.ix_(b, b)] = (mass * s / 420.0) * np.array(
        [[156, 22 * s, 54, -13 * s], [22 * s, 4 * s * s, 13 * s, -3 * s * s],
         [54, 13 * s, 156, -22 * s], [-13 * s, -3 * s * s, -22 * s, 4 * s * s]]
    )  # fmt: skip
    k[np.ix_(n, n)] = ea / s * np.array([[1, -1], [-1, 1]])
    m[np.ix_(n, n)] = mass * s / 6.0 * np.array([[2, 1], [1, 2]])
    return k, m


def frame_matrices(
    whisker: LShaped, parts: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness and mass of the clamped whisker; the last node is the tip."""
    nodes = 1 + sum(parts)
    k, m = np.zeros((3 * nodes, 3 * nodes)), np.zeros((3 * nodes, 3 * nodes))
    section = whisker.segments()[0].section_at(0.0)
    e, rho = whisker.material.e_mpa, whisker.material.density_t_mm3
    at = 0
    for segment, n in zip(whisker.segments(), parts, strict=True):
        dx, dy = (segment.end_mm - segment.start_mm)[:2] / segment.length_mm
        turn = np.kron(np.eye(2), np.array([[dx, dy, 0], [-dy, dx, 0], [0, 0, 1]]))
        ke, me = beam_element(
            e * section.i_vertical_mm4, e * section.area_mm2, rho * section.area_mm2, segment.length_mm / n
        )
        for _ in range(n):
            dofs = slice(3 * at, 3 * at + 6)
            k[dofs, dofs] += turn.T @ ke @ turn
            m[dofs, dofs] += turn.T @ me @ turn
            at += 1
    return k[3:, 3:], m[3:, 3:]


def finite_elements(
    profile: Profile, speed: float, *, length: float, at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Moment at the sensor by finite elements, solved in time by scipy's LSODA; the same contact, no modes.

    Damping is 2 zeta sqrt(M^-1 K) by its matrix root, which is the same share for every mode there is.
    """
    k, m = frame_matrices(WHISKER, (5, 1))
    n = len(k)
    inverse = np.linalg.inv(m)
    square, vector = np.linalg.eig(inverse @ k)
    square, vector = square.real, vector.real
    # above 30 kHz the elements are no beam any more; those modes are damped out
    share = np.where(np.sqrt(square) < 2.0 * math.pi * 3e4, MODES.damping, 0.7)
    drag = vector @ np.diag(2.0 * share * np.sqrt(square)) @ np.linalg.inv(vector)
    period = shortest_period_s(MODES, contact_mm_per_n=CONTACT, friction=MU)
    lag = CONTACT_DAMPING * period / math.pi
    d = np.linalg.inv(k)[n - 3 : n - 1, n - 3 : n - 1]

    (d00, d01), (d10, d11) = d.tolist()

    def height(x: float) -> float:
        return float(profile(x))  # type: ignore[arg-type]

    def slope(x: float) -> float:
        return (height(x + 1e-4) - height(x - 1e-4)) / 2e-4

    def slow_shift(x: float) -> float:
        p = slope(x)
        back, up = -(p + MU), 1.0 - MU * p
        return (d00 * back + d01 * up) * (PRELOAD + height(x)) / (d10 * back + d11 * up)

    def push(t: float, y: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        u, v = y[n - 3 : n - 1], y[2 * n - 3 : 2 * n - 1]
        x = speed * t
        ahead = float(u[0]) - slow_shift(x)
        p = slope(x + ahead)
        gap = PRELOAD + height(x + ahead) - float(u[1])
        drift = (slow_shift(x + speed * 1e-7) - slow_shift(x - speed * 1e-7)) / 2e-7
        rate = p * (speed + float(v[0]) - drift) - float(v[1])
        lam = max(0.0, (gap + lag * rate) / CONTACT)
        return lam, lam * np.array([-(p + MU), 1.0 - MU * p])

    def change(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        force = np.zeros(n)
        force[n - 3 : n - 1] = push(t, y)[1]
        return np.concatenate([y[n:], inverse @ (force - k @ y[:n]) - drag @ y[n:]])

    lam0 = PRELOAD / (float(d[1, :2] @ np.array([-MU, 1.0])) + CONTACT)
    start = np.zeros(2 * n)
    load = np.zeros(n)
    load[n - 3 : n - 1] = lam0 * np.array([-MU, 1.0])
    start[:n] = np.linalg.solve(k, load)
    found = solve_ivp(
        change, (0.0, length / speed), start, method="LSODA", t_eval=at / speed, rtol=1e-4, atol=1e-8,
        max_step=2e-4,
    )  # fmt: skip
    assert found.success
    # the clamp's moment and forces are what the first element's end carries; the sensor sits l3 below it
    first, _ = beam_element(
        MUSIC_WIRE.e_mpa * 4.5 * 0.3**3 / 12.0, MUSIC_WIRE.e_mpa * 1.35, MUSIC_WIRE.density_t_mm3 * 1.35,
        WHISKER.l1_mm / 5,
    )  # fmt: skip
    turn = np.kron(np.eye(2), np.diag([-1.0, -1.0, 1.0]))
    ends = turn.T @ first @ turn @ np.concatenate([np.zeros((3, found.y.shape[1])), found.y[:3]])
    return np.asarray(ends[0] * WHISKER.lowered_mm - ends[2])


def test_finite_elements_in_time_say_the_same() -> None:
    """A groove with walls of 45 degrees, fast enough that the tip leaves it and rings.

    Six elements against three modes: what is left out are modes above 8 kHz, so samples are averaged over a pixel of
    0.12 mm, as an edge map does; agreement within a fifth of what speed does (an eighth is found).
    """

    def groove(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(-0.15 * np.exp(-(((x - 0.5) / 0.13) ** 2)))

    length, speed = 1.3, 120.0
    at = np.arange(0.0, length - 0.5 * STEP, STEP)
    fast, slow = traced(groove, speed, length=length)
    other = finite_elements(groove, speed, length=length, at=at)
    land = float(slow.moment_n_mm[0, 0])
    pixel = np.ones(12) / 12
    ours, theirs, still = (
        np.convolve(np.asarray(m, dtype=np.float64)[: at.size] / land, pixel, mode="valid")
        for m in (fast.moment_n_mm[0], other, slow.moment_n_mm[0])
    )
    by_speed = float(np.sqrt(((ours - still) ** 2).mean()))
    difference = float(np.sqrt(((ours - theirs) ** 2).mean()))
    assert by_speed > 0.005
    assert difference < by_speed / 5.0, (difference, by_speed)


def test_what_speed_costs_is_the_same_at_every_scale() -> None:
    """From 5 mm on, where the sensor is lowered in proportion."""
    costs = [
        speed_cost(default_whisker(h), default_touch(h), speed_mm_s=60.0, character_height_mm=h)
        for h in (5.0, 7.5, 10.0)
    ]
    for cost in costs:
        assert cost.error == pytest.approx(costs[0].error, rel=0.02)
        assert cost.ringing == pytest.approx(costs[0].ringing, rel=0.05)


def test_the_usual_speed_keeps_the_fine_error_and_three_times_it_does_not() -> None:
    touch = default_touch(HEIGHT)
    usual = speed_cost(WHISKER, touch, speed_mm_s=SAFE_SPEED_MM_S, character_height_mm=HEIGHT)
    assert usual.error < FINE_ERROR
    fast = speed_cost(WHISKER, touch, speed_mm_s=3.0 * SAFE_SPEED_MM_S, character_height_mm=HEIGHT)
    assert fast.ringing > usual.ringing
    assert fast.in_air_mm > usual.in_air_mm
    assert fast.error > FINE_ERROR


@pytest.mark.parametrize("beta_deg", BETAS_DEG)
def test_array_design_knows_the_speed_for_each_error(beta_deg: float) -> None:
    """At an angle of each of its builds, over several strokes; at the default's, a tenth more speed is too much."""
    whisker = replace(WHISKER, beta_rad=math.radians(beta_deg))
    touch = default_touch(HEIGHT).with_whisker(whisker)
    for error, speed in SPEED_BY_ERROR.items():
        kept, faster = (
            speed_errors(whisker, touch, speed_mm_s=v, height_mm=HEIGHT).with_mass
            for v in (speed, 1.1 * speed)
        )
        assert kept <= 1.03 * error
        assert faster > error or beta_deg > 0.0
