"""The designer against the public functions, against chance, and against what the physics says of its limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from pipeline.cli.design_report import BOUND_WORDS, explain_failure
from tests.support.benches import preload_stress_mpa
from tests.support.paper import is_jammed
from tests.support.trace_frame import trace_contact
from whisker_array.design.checks import (
    FINEST_WAVELENGTH_LINES,
    check,
    factors,
    linear_force_error,
    sideways_slide_mm,
)
from whisker_array.design.design import Design, NoWhiskerError, design_whisker, worst_edge
from whisker_array.design.limits import Bound, Constraint, DesignError, Limits, Request
from whisker_array.design.trade import speed_trade_off
from whisker_array.design.tuned import Kind, middle_friction, tune
from whisker_array.simulation.surface import prepare_surface
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.elastica import linear_error
from whisker_array.whisker.enhancement import enhancement_factor, normal_force_n
from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.validity import (
    DEFLECTION_LIMIT,
    LINEAR_ERROR_LIMIT,
    PRELOAD_MARGIN,
    QUASI_STATIC_SHARE,
    deflection_ratio,
    first_bending_frequency_hz,
)

ASKED = Request(
    alpha_rad=(math.radians(30.0), math.radians(60.0)), mu=(0.1, 0.5), depth_mm=0.2, character_height_mm=5.0
)
SEARCH_TOLERANCE = 5e-3
"""The search keeps 0.1 % off its limits and stops on ridges at some 1e-5: far below what this lets pass."""


@pytest.fixture(scope="module")
def made() -> Design:
    return design_whisker(ASKED)


@pytest.fixture(autouse=True)
def _one_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """All searches but that of `made` start once: they find the same whiskers as from five starts."""
    for module in ("design", "tuned"):
        monkeypatch.setattr(f"whisker_array.design.{module}._STARTS", 1)


def feasible(whisker: LShaped, preload_mm: float, request: Request, limits: Limits) -> bool:
    checked = check(whisker, request, limits, preload_mm=preload_mm)
    return all(row.slack >= 0.0 for row in checked.rows())


def test_the_design_keeps_every_assumption_of_the_paper(made: Design) -> None:
    whisker, preload, wall = made.whisker, made.preload_mm, math.tan(ASKED.alpha_rad[1])
    assert preload >= PRELOAD_MARGIN * ASKED.depth_mm
    detail_hz = made.speed_mm_s / (FINEST_WAVELENGTH_LINES * made.request.line_pitch_mm)
    assert detail_hz <= QUASI_STATIC_SHARE * first_bending_frequency_hz(whisker, tip_held=True)
    for mu in (0.1, 0.2, 0.35, 0.5):
        assert not is_jammed([0.0, -wall, wall], mu, whisker.tip_model()).any()
        assert deflection_ratio(whisker, preload_mm=preload, mu=mu) <= DEFLECTION_LIMIT
        assert preload_stress_mpa(whisker, preload_mm=preload, mu=mu) <= whisker.material.yield_mpa
        assert linear_error(whisker, lift_mm=preload, mu=mu).worst <= LINEAR_ERROR_LIMIT


def test_the_table_agrees_with_the_public_functions(made: Design) -> None:
    rows = {row.bound: row for row in made.constraints}
    assert all(row.slack >= 0.0 for row in made.constraints)
    tip = made.whisker.tip_model()
    d = tip.compliance_mm_per_n
    forces = [
        normal_force_n(tip, lift_mm=made.preload_mm, alpha_rad=a, mu=mu)
        for a in np.radians(np.linspace(-60.0, 60.0, 41))
        for mu in np.linspace(0.1, 0.5, 5)
    ]
    assert rows[Bound.FORCE].value == pytest.approx(max(forces), rel=1e-9)
    assert rows[Bound.FORCE].value <= Limits().force_n
    # lift over its land value is the land's force over the wall's
    shares = [
        normal_force_n(tip, lift_mm=1.0, mu=mu) / normal_force_n(tip, lift_mm=1.0, alpha_rad=a, mu=mu)
        for a in np.radians(np.linspace(-60.0, 60.0, 41))
        for mu in np.linspace(0.1, 0.5, 5)
    ]
    assert rows[Bound.JAMMING].value == pytest.approx(min(shares), rel=1e-9)
    slide = made.preload_mm * d[2, 2] / d[1, 1] * math.tan(ASKED.alpha_rad[1])
    assert rows[Bound.SLIDE].value == pytest.approx(slide)
    assert made.speed_mm_s >= ASKED.least_speed_mm_s
    worst = max(linear_error(made.whisker, lift_mm=made.preload_mm, mu=mu).worst for mu in (0.1, 0.5))
    assert rows[Bound.LINEAR_BEAM].value == pytest.approx(worst)


def test_the_contrast_is_the_worst_step_by_eq_16(made: Design) -> None:
    tip = made.whisker.tip_model()
    steps = [
        abs(enhancement_factor(tip, alpha_rad=sign * a, mu=mu) - 1.0) * lip
        for a in np.linspace(*ASKED.alpha_rad, 13)
        for sign in (1.0, -1.0)
        for mu in np.linspace(*ASKED.mu, 17)
        for lip in (1.0, 1.0 - ASKED.depth_mm / made.preload_mm)
    ]
    # the designer's grid holds the ends and every other friction of this one
    assert made.contrast == pytest.approx(min(steps), rel=1e-6)
    assert made.contrast_exact == pytest.approx(made.contrast, rel=0.02)


def test_no_feasible_whisker_by_chance_is_better(made: Design) -> None:
    rng = np.random.default_rng(7)
    section = made.whisker.section
    w = made.whisker
    axis = w.l1_mm * math.sin(w.beta_rad) + w.l2_mm - w.lowered_mm
    found = 0
    for spread in np.repeat([0.02, 0.1, 0.5], 300):
        a = np.exp(spread * rng.standard_normal(7))
        l1, l2, beta = w.l1_mm * a[0], w.l2_mm * a[1], w.beta_rad * a[2]
        l3 = l1 * math.sin(beta) + l2 - axis * a[3]
        ribbon = Rectangle(section.thickness_mm * a[4], section.width_mm * a[5])
        if not beta < math.pi / 4.0:
            continue
        other, preload = LShaped(l1, l2, l3, beta, ribbon), made.preload_mm * a[6]
        if feasible(other, preload, ASKED, Limits()):
            found += 1
            assert worst_edge(other, ASKED, preload_mm=preload)[0].contrast < made.contrast * (
                1.0 + SEARCH_TOLERANCE
            )
    assert found >= 10


def test_everything_twice_as_large_is_the_same_design(made: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "whisker_array.design.design._STARTS", 5
    )  # one alone ends on another part of a flat ridge
    request = replace(ASKED, depth_mm=2.0 * ASKED.depth_mm, character_height_mm=10.0)
    usual = Limits()
    l1, thickness = ((2.0 * low, 2.0 * high) for low, high in (usual.l1_mm, usual.thickness_mm))
    limits = replace(
        usual,
        l1_mm=l1,
        thickness_mm=thickness,
        force_n=4.0 * usual.force_n,
        axis_clearance_mm=2.0 * usual.axis_clearance_mm,
    )
    twice = design_whisker(request, limits=limits)
    assert twice.contrast == pytest.approx(made.contrast, rel=1e-3)
    for name in ("l1_mm", "lowered_mm"):
        assert getattr(twice.whisker, name) == pytest.approx(2.0 * getattr(made.whisker, name), rel=0.02)
    assert twice.preload_mm == pytest.approx(2.0 * made.preload_mm, rel=0.02)
    assert twice.request.tip_radius_mm == pytest.approx(2.0 * made.request.tip_radius_mm)
    assert twice.frequency_hz == pytest.approx(0.5 * made.frequency_hz, rel=0.01)


@pytest.mark.parametrize("height_mm", [2.0, 3.0, 5.0, 8.0, 12.0])
def test_the_default_whisker_leaves_room_for_its_sensor(height_mm: float) -> None:
    request = Request(
        alpha_rad=(math.radians(30.0), math.radians(60.0)),
        mu=(0.1, 0.4),
        depth_mm=0.04 * height_mm,
        character_height_mm=height_mm,
    )
    preload_mm = default_preload_mm(height_mm)
    rows = check(default_whisker(height_mm), request, Limits(), preload_mm=preload_mm).rows()
    slack = {row.bound: row.slack for row in rows}
    assert slack.pop(Bound.AXIS) > -1e-9
    broken = {bound for bound, left in slack.items() if left < 0.0}
    # small ones have their axis above the clamp; large ones press with more than half a newton on steep rough walls
    assert broken == ({Bound.LOWERED} if height_mm < 3.0 else {Bound.FORCE} if height_mm >= 5.0 else set())


def test_speed_costs_contrast(made: Design) -> None:
    trade = speed_trade_off(made, factors=(4.0, 400.0))
    fast, impossible = trade.contrast
    assert made.contrast > fast
    assert impossible is None
    assert trade.at == ASKED.least_speed_mm_s


@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_the_slide_is_what_the_contact_solver_shows(mu: float) -> None:
    """On a long wall along the trace the tip slides by what the solver's moment tells, whatever the friction."""
    wall, lift = math.radians(45.0), 2.0
    pitch = 0.02
    z = np.arange(300) * pitch
    surface = np.tile(-np.clip(z - 2.0, 0.0, None)[:, None] * math.tan(wall), (1, 300))
    whisker = LShaped(30.0, 3.5, None, 0.0, Rectangle(0.3, 4.5))
    tip = whisker.tip_model()
    traces = trace_contact(
        prepare_surface(HeightMap(surface.astype(np.float32), pitch), friction=mu),
        tip,
        lines_mm=np.array([4.0]),  # two mm down the wall of 4 mm preload: 2 mm are left
        start_mm=0.5,
        step_mm=pitch,
        n_samples=250,
        preload_mm=4.0,
        nominal_friction=mu,
    )
    force = np.array([-mu, math.cos(wall), math.sin(wall)])
    normal = float(traces.moment_n_mm[0, -1]) / float(tip.moment_arm_mm @ force)
    slid = normal * math.sin(wall) * tip.compliance_mm_per_n[2, 2]
    bound = sideways_slide_mm(whisker, preload_mm=lift, wall_rad=wall)
    ratio = tip.compliance_mm_per_n[2, 2] / tip.compliance_mm_per_n[1, 1]
    pull = -tip.compliance_mm_per_n[1, 0] / tip.compliance_mm_per_n[1, 1] * mu / math.cos(wall)
    assert slid == pytest.approx(bound / (1.0 + ratio * math.tan(wall) ** 2 + pull), rel=1e-3)
    assert slid < bound


@pytest.mark.parametrize("beta_deg", [0.0, 15.0, 30.0])
@pytest.mark.parametrize("mu", [0.0, 0.1, 0.5])
def test_the_first_order_of_the_beams_error_is_that_of_the_elastica(beta_deg: float, mu: float) -> None:
    whisker = LShaped(40.0, 0.0, 0.0, math.radians(beta_deg), Rectangle(0.3, 3.0))
    lift = 0.05
    exact = linear_error(whisker, lift_mm=lift, mu=mu).force
    # what is left is of second order, (lift / l1)^2 = 1.6e-6 times a few
    assert linear_force_error(whisker, lift_mm=lift, mu=mu) == pytest.approx(exact, abs=1.5e-5)


def test_round_wire_slides_sideways() -> None:
    with pytest.raises(DesignError, match=r"round wire.*slides.*take a ribbon"):
        design_whisker(ASKED, section="round")


def test_round_wire_serves_where_slides_are_allowed() -> None:
    made = design_whisker(ASKED, section="round", limits=Limits(slide_lines=40.0))
    assert isinstance(made.whisker.section, Round)
    assert all(row.slack >= 0.0 for row in made.constraints)


def test_walls_that_must_jam_are_named_with_their_mend() -> None:
    asked = replace(ASKED, alpha_rad=(math.radians(30.0), math.radians(75.0)))
    with pytest.raises(NoWhiskerError, match=r"together: .*jamming") as failed:
        design_whisker(asked)
    explained = explain_failure(failed.value)
    assert "lift on the steepest wall / on the land comes to" in explained
    assert "take walls less steep" in explained.split("Mend: ")[1]


def test_every_limit_has_words() -> None:
    assert set(BOUND_WORDS) == set(Bound)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"alpha_rad": (1.0, 0.5)}, "gentlest"),
        ({"depth_mm": 3.0}, "half the height"),
        ({"speed_mm_s": -1.0}, "speed_mm_s"),
    ],
)
def test_requests_that_cannot_be(change: dict[str, object], says: str) -> None:
    """Beside those that the command refuses: tests/contract/test_design.py."""
    with pytest.raises(DesignError, match=says):
        replace(ASKED, **change)


def test_slack_is_negative_where_a_limit_is_broken() -> None:
    assert Constraint(Bound.FORCE, 0.6, 0.5, True).slack == pytest.approx(-0.2)
    assert Constraint(Bound.SIGNAL, 100.0, 200.0, False).slack == pytest.approx(-0.5)
    assert Constraint(Bound.SIGNAL, 200.1, 200.0, False).binding


def test_a_null_is_where_it_was_asked_for() -> None:
    alpha = math.radians(45.0)
    tuned = tune(alpha, ASKED)
    assert tuned.kind is Kind.NULL
    mid = middle_friction(ASKED.mu)
    whisker = tuned.design.whisker
    f = factors(whisker, alpha_rad=alpha + np.radians([-10.0, 0.0, 10.0]), mu=np.array([mid]))[:, 0]
    assert f[1] == pytest.approx(0.0, abs=1e-3)  # five digits of l3
    assert f[0] > 0.1
    assert f[2] < -0.1
    for place, mu in zip(tuned.place_rad, tuned.table_mu, strict=True):
        assert factors(whisker, alpha_rad=np.array([place]), mu=np.array([mu]))[0, 0] == pytest.approx(
            0.0, abs=1e-9
        )
    # it does not jam on any wall of the request
    walls = np.radians(np.linspace(-60.0, 60.0, 61))
    assert np.isfinite(factors(whisker, alpha_rad=walls, mu=np.linspace(*ASKED.mu, 5))).all()


def test_a_threshold_serves_where_no_wall_is_steeper() -> None:
    alpha = math.radians(45.0)
    asked = replace(ASKED, alpha_rad=(math.radians(30.0), alpha), mu=(0.1, 0.3))
    tuned = tune(alpha, asked)
    assert tuned.kind is Kind.THRESHOLD
    # the pole lies beyond, and friction carries it away by its own angle
    assert tuned.place_rad[0] > alpha
    assert tuned.place_rad[2] - tuned.place_rad[0] == pytest.approx(math.atan(0.3) - math.atan(0.1))
    whisker = tuned.design.whisker
    f = factors(whisker, alpha_rad=tuned.place_rad[0] + np.array([-1e-3, 1e-3]), mu=np.array([0.1]))[:, 0]
    assert f[0] > 50.0
    assert math.isnan(f[1])


@pytest.mark.parametrize("degrees", [5.0, 85.0, math.nan])
def test_inclinations_that_cannot_be_singled_out(degrees: float) -> None:
    with pytest.raises(DesignError, match="cannot be singled out"):
        tune(math.radians(degrees), ASKED)


def test_a_null_within_the_friction_angle_is_refused() -> None:
    asked = replace(ASKED, mu=(0.5, 0.9))
    with pytest.raises(DesignError, match="friction angle"):
        tune(math.radians(20.0), asked, kind=Kind.NULL)
