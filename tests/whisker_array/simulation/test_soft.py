"""Dirt that yields under the tip: limits, closed forms, an independent solver, and both fidelities."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap, TraceDirection
from tests.support.scans import SMALL_PLAN
from tests.support.trace_frame import sample_lines, trace_contact
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.contact import land_lag_mm
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.regrid import fit_pitch, fit_soil
from whisker_array.simulation.soft import carrying_stiffness_n_per_mm, sunken_heights
from whisker_array.simulation.surface import prepare_surface
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped, TipModel
from whisker_array.whisker.touch import Touch, default_touch

MU = 0.2
PITCH = 0.05
TOUCH = default_touch(5.0)
WIRE = Touch(LShaped(30.0, 3.5, None, 0.0, Round(0.4)).tip_model(), preload_mm=1.0, tip_radius_mm=0.1)
HARDEST, SOFTEST = 1e12, 2e-6
SETTLED = 4e-4
"""Relative to the moment, as in test_contact: a few times Newton's tolerance."""


def moments(scan: Scan, *, skip: int = 0) -> NDArray[np.float64]:
    """Of all sweeps in one row, relative to the land's; NaN where flagged, which only lines beyond the part may be.

    `skip` samples of each line are left out, where the tip comes from its rest.
    """
    flags = np.concatenate([s.flags[..., skip:].ravel() for s in scan.sweeps])
    # wire bounces in a groove that it runs along, with dirt and without: see test_contact
    assert (flags & ~np.uint8(SampleFlag.OUTSIDE) > 0).mean() < 1e-3
    felt = np.concatenate([s.moment_n_mm[..., skip:].ravel() for s in scan.sweeps])
    return np.where(flags == 0, felt / scan.touch.land_moment_n_mm(), np.nan)


def dirty_part(pitch: float = PITCH) -> tuple[HeightMap, HeightMap, NDArray[np.float32]]:
    """Top, bottom and thickness of a plate with grooves both ways, filled and caked over in patches."""
    y, x = np.mgrid[: round(4.0 / pitch) + 1, : round(6.0 / pitch) + 1] * pitch
    groove = np.clip(0.5 - np.abs(x - 2.6), 0.0, 0.2)
    bottom = -np.maximum(groove, np.clip(0.5 - np.abs(y - 1.8), 0.0, 0.2))
    fill = np.clip(1.5 * np.sin(2.1 * x + 0.4) * np.cos(1.3 * y), 0.0, 1.0)
    lump = 0.08 * np.clip(1.2 - np.hypot(x - 4.6, y - 2.9), 0.0, 0.5)
    thickness = (fill * -bottom + lump).astype(np.float32)
    return HeightMap((bottom + thickness).astype(np.float32), pitch), HeightMap(bottom, pitch), thickness


def soil_of(thickness: NDArray[np.float32], hardness: float | NDArray[np.floating], mu: float = MU) -> Soil:
    return Soil(thickness, np.float32(hardness), np.float32(mu))  # type: ignore[arg-type]


# --- limits


@pytest.mark.parametrize("fidelity", list(Fidelity))
@pytest.mark.parametrize("pitch", [PITCH, 0.02, 0.08])
def test_no_thickness_is_no_dirt_to_the_last_bit(fidelity: Fidelity, pitch: float) -> None:
    top, _, thickness = dirty_part(pitch)
    plain = trace_scan(top, touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity, friction=0.31)
    clean = trace_scan(
        top, touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity, soil=soil_of(0 * thickness, 5.0, 0.31)
    )
    for one, other in zip(plain.sweeps, clean.sweeps, strict=True):
        np.testing.assert_array_equal(one.flags, other.flags)
        # a friction map is looked up by interpolation: its weights sum to 1 but for rounding
        np.testing.assert_allclose(
            one.moment_n_mm, other.moment_n_mm, rtol=SETTLED if pitch < PITCH else 1e-6
        )
    mapped = trace_scan(
        top, touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity, friction=np.full(top.shape, 0.31, np.float32)
    )
    for one, other in zip(mapped.sweeps, clean.sweeps, strict=True):
        np.testing.assert_array_equal(one.moment_n_mm, other.moment_n_mm)


@pytest.mark.parametrize("fidelity", list(Fidelity))
@pytest.mark.parametrize("pitch", [PITCH, 0.1])
@pytest.mark.parametrize("touch", [TOUCH, WIRE], ids=["ribbon", "wire"])
def test_hardest_dirt_is_its_top_and_softest_what_is_below(
    fidelity: Fidelity, pitch: float, touch: Touch
) -> None:
    top, bottom, thickness = dirty_part(pitch)

    def felt(surface: HeightMap, soil: Soil | None) -> NDArray[np.float64]:
        return moments(
            trace_scan(surface, touch=touch, plan=SMALL_PLAN, fidelity=fidelity, friction=MU, soil=soil)
        )

    rigid_top, rigid_bottom = felt(top, None), felt(bottom, None)
    assert np.nanmax(np.abs(rigid_top - rigid_bottom)) > 0.1
    for hardness, rigid in ((HARDEST, rigid_top), (SOFTEST, rigid_bottom)):
        off = np.abs(felt(top, soil_of(thickness, hardness)) - rigid)
        # of a map that is interpolated the bottom is cut off at the top, beside the dirt, where a cubic crosses it;
        # by as little wire is led into another groove
        crossed = hardness == SOFTEST and pitch > PITCH
        if not crossed:
            assert np.nanmax(off) < 4 * SETTLED  # two solutions, of different iterations
        assert np.nanquantile(off, 0.95) < (5e-3 if crossed else SETTLED)


# --- closed forms


def layer_moment(touch: Touch, *, thickness: float, hardness: float, radius: float, mu: float) -> float:
    """Moment on a flat layer whose top is the land: s = f(-s) / (2 pi r H) solved by bisection, eqs. (7), (14)."""
    a = np.array([-mu, 1.0, 0.0])

    def force(sinkage: float) -> float:
        return (touch.preload_mm - sinkage) / float(touch.tip.compliance_mm_per_n[1] @ a)

    def misfit(sinkage: float) -> float:
        return sinkage - force(sinkage) / (2.0 * math.pi * radius * hardness)

    sinkage = thickness
    if misfit(thickness) > 0.0:
        sinkage = optimize.bisect(misfit, 0.0, thickness, xtol=1e-12)
    return force(sinkage) * float(touch.tip.moment_arm_mm @ a)


@pytest.mark.parametrize("fidelity", list(Fidelity))
@pytest.mark.parametrize("radius", [0.1, 0.0], ids=["ball", "point"])
@pytest.mark.parametrize("hardness", [0.05, 0.3, 1.0, 4.0, 20.0, 300.0])
@pytest.mark.parametrize("tip", [TOUCH.tip, WIRE.tip], ids=["ribbon", "wire"])
def test_a_flat_layer_sinks_by_the_force_over_two_pi_r_h(
    tip: TipModel, hardness: float, radius: float, fidelity: Fidelity
) -> None:
    """From the softest, which is pushed through, over those that yield more than the whisker, to the hardest."""
    touch = Touch(tip, preload_mm=0.8, tip_radius_mm=radius, friction=0.3)
    thickness = np.full((81, 121), 0.6, dtype=np.float32)
    flat = HeightMap(0.0 * thickness, PITCH)
    scan = trace_scan(
        flat, touch=touch, plan=SMALL_PLAN, fidelity=fidelity, soil=soil_of(thickness, hardness, 0.3)
    )
    # the point is as fine as half a sample
    exact = layer_moment(touch, thickness=0.6, hardness=hardness, radius=radius or 0.5 * PITCH, mu=0.3)
    felt = moments(scan, skip=3)
    np.testing.assert_allclose(felt[np.isfinite(felt)], exact / touch.land_moment_n_mm(), rtol=SETTLED)


@pytest.mark.parametrize("angle", [-40.0, -20.0, 20.0, 40.0])
@pytest.mark.parametrize("tip", [TOUCH.tip, WIRE.tip], ids=["ribbon", "wire"])
def test_steady_on_a_ramp_of_dirt_is_the_closed_form(tip: TipModel, angle: float) -> None:
    """Force over the track's normal; its slope p' = p - df_n/dx / kappa, and p dx = (dy + 1 / kappa) df_n."""
    p, d0, radius, hardness, mu = math.tan(math.radians(angle)), 1.0, 0.025, 4.0, 0.3
    kappa = 2.0 * math.pi * radius * hardness
    z = np.broadcast_to(p * (np.arange(151) * 0.02 - 1.5), (21, 151)).astype(np.float32)
    soil = soil_of(np.full(z.shape, 2.0, dtype=np.float32), hardness * radius / 0.01, mu)
    surface = prepare_surface(HeightMap(z, 0.02), friction=mu, soil=soil)  # a point: the ball is 0.01 mm

    def unit(slope: float) -> NDArray[np.float64]:
        return np.array([-(slope + mu), 1.0 - mu * slope, 0.0]) / math.hypot(1.0, slope)

    def misfit(slope: float) -> float:
        dy = float(tip.compliance_mm_per_n[1] @ unit(slope))
        return slope - p * (1.0 - (1.0 / kappa) / (dy + 1.0 / kappa))

    track = optimize.brentq(misfit, min(0.0, p), max(0.0, p))
    assert abs(track) < 0.97 * abs(p)
    dx, dy, _ = tip.compliance_mm_per_n @ unit(track)
    lag = land_lag_mm(tip, preload_mm=d0, friction=mu)
    n = 70
    felt = trace_contact(
        surface, tip, lines_mm=np.array([0.2]), start_mm=0.8, step_mm=0.02, n_samples=n, preload_mm=d0,
        nominal_friction=mu,
    )  # fmt: skip
    command = 0.8 + 0.02 * np.arange(n)
    f_n = (d0 + p * (command - lag - 1.5)) / (dy + 1.0 / kappa - p * dx)
    expected = f_n * float(tip.moment_arm_mm @ unit(track))
    assert not felt.flags.any()
    np.testing.assert_allclose(felt.moment_n_mm[0, 30:], expected[30:], rtol=SETTLED)


# --- an independent solver: the slope of the track by differentiating it


def track_moments(
    x: NDArray[np.float64], top: NDArray[np.float64], kappa: NDArray[np.float64], tip: TipModel
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Commanded place and moment where the tip stands at x, the slope being the derivative of the whole track."""
    h = top.copy()
    for _ in range(6):
        slope = np.gradient(h, x)
        a = np.stack([-(slope + MU), 1.0 - MU * slope]) / np.hypot(1.0, slope)
        dx, dy = tip.compliance_mm_per_n[:2, :2] @ a
        last, h = h, (kappa * dy * top - 1.0) / (1.0 + kappa * dy)  # kappa (top - h) dy = d0 + h
    assert np.abs(h - last)[20:-20].max() < 1e-4
    f_n = kappa * (top - h)
    lag = land_lag_mm(tip, preload_mm=1.0, friction=MU)
    return x + lag - f_n * dx, f_n * (tip.moment_arm_mm[:2] @ a)


@pytest.mark.parametrize(("tip", "mean_mpa"), [(TOUCH.tip, 60.0), (WIRE.tip, 15.0)], ids=["ribbon", "wire"])
def test_slopes_are_those_of_the_track(tip: TipModel, mean_mpa: float) -> None:
    """Undulating dirt of varying hardness, deep enough to carry: the kernel foresees the track that is made."""
    pitch = step = 0.01
    x = np.arange(801) * pitch

    def height(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(0.12 * np.sin(1.7 * x))

    def hardness(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(mean_mpa * np.exp(0.5 * np.sin(2.6 * x + 1.0)))

    z, hard = (np.broadcast_to(a(x), (9, x.size)).astype(np.float32) for a in (height, hardness))
    soil = soil_of(np.full(z.shape, 3.0, dtype=np.float32), hard)
    surface = prepare_surface(HeightMap(z, pitch), friction=MU, soil=soil)
    ball = 2.0 * math.pi * 0.5 * pitch
    command = 1.0 + step * np.arange(400)
    felt = trace_contact(
        surface, tip, lines_mm=np.array([0.04]), start_mm=1.0, step_mm=step, n_samples=command.size,
        preload_mm=1.0, nominal_friction=MU,
    )  # fmt: skip
    assert not felt.flags.any()
    fine = np.linspace(0.0, 8.0, 201)
    places, expected = track_moments(fine, height(fine), ball * hardness(fine), tip)
    slow = np.interp(command, places, expected)
    there = slice(60, None)  # the tip has slid from its rest
    land = float(np.abs(slow[there]).mean())
    assert np.ptp(slow[there]) > 0.2 * land
    # the kernel takes e for constant as the slope turns, by up to 0.35 a mm
    np.testing.assert_allclose(felt.moment_n_mm[0, there], slow[there], atol=6e-3 * land)
    rigid = trace_contact(
        prepare_surface(HeightMap(z, pitch), friction=MU), tip, lines_mm=np.array([0.04]), start_mm=1.0,
        step_mm=step, n_samples=command.size, preload_mm=1.0, nominal_friction=MU,
    )  # fmt: skip
    assert np.abs(rigid.moment_n_mm[0, there] - slow[there]).max() > 0.05 * land


def test_both_fidelities_agree_where_the_tip_stays_as_it_is_led() -> None:
    """Height, thickness and preload halved, sideways compliance quartered: as without dirt, they come together.

    Sinkage falls with the force; the share of it in the height stays.
    """
    errors = []
    for level in range(3):
        s = 0.5**level
        pitch = 0.04 * 0.6**level
        y, x = np.mgrid[: round(4.0 / pitch), : round(6.0 / pitch)] * pitch
        top = 0.12 * s * np.sin(2.1 * x + 0.4) * np.cos(1.7 * y + 0.3)
        thickness = (0.06 * s * np.clip(np.sin(1.3 * x - 0.8 * y), 0.0, 1.0)).astype(np.float32)
        d = TOUCH.tip.compliance_mm_per_n.copy()
        d[2, 2] *= 20.0 * 0.25**level
        tip = TipModel(d, TOUCH.tip.moment_arm_mm)
        # 1 / kappa alike on all grids: the ball is half a sample
        soil = soil_of(thickness, 20.0 * 0.04 / pitch)
        surface = prepare_surface(HeightMap(top.astype(np.float32), pitch), friction=MU, soil=soil)
        assert surface.yielding is not None
        lines, n, d0 = np.array([1.1, 1.6, 2.3]), round(4.8 / pitch), 0.4 * s
        felt = trace_contact(
            surface, tip, lines_mm=lines, start_mm=0.6, step_mm=pitch, n_samples=n, preload_mm=d0,
            nominal_friction=MU,
        )  # fmt: skip
        where = {"lines_mm": lines, "start_mm": 0.6, "step_mm": pitch, "n_samples": n}
        below, mu, _ = sample_lines(surface, **where)
        above, kappa, _ = sample_lines(replace(surface, fields=surface.yielding), **where)
        h = sunken_heights(above, below, kappa, tip, step_mm=pitch, preload_mm=d0, friction=mu)
        ideal = trace_pointwise(h, tip, step_mm=pitch, preload_mm=d0, friction=mu)
        sunk = above - h
        # in some places the dirt carries, in others it is pushed through
        assert ((sunk > 0.01 * s) & (h > below + 0.005 * s)).mean() > 0.1
        assert ((sunk > 0.005 * s) & (h <= below)).mean() > 0.1
        land = float(np.abs(ideal.moment_n_mm).mean())
        difference = np.abs(felt.moment_n_mm - ideal.moment_n_mm)[:, n // 8 :] / land
        assert (felt.flags[:, n // 8 :] == 0).mean() > 0.99
        errors.append(float(np.sqrt(np.mean(difference**2))))
    assert errors[0] < 0.05
    for coarse, fine in itertools.pairwise(errors):
        assert fine < 0.7 * coarse  # first order, as without dirt


# --- friction, edges, directions


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_friction_of_the_soil_is_felt_and_a_given_one_wins(fidelity: Fidelity) -> None:
    top = HeightMap(np.zeros((81, 121), np.float32), PITCH)
    mu = np.full(top.shape, 0.4, dtype=np.float32)
    mu[:, 40:80] = 0.1
    soil = Soil(np.zeros(top.shape, np.float32), np.float32(10.0), mu)  # type: ignore[arg-type]
    touch = replace(WIRE, friction=0.4)
    plan = replace(SMALL_PLAN, directions=(TraceDirection.FORWARD_X,))
    felt = trace_scan(top, touch=touch, plan=plan, fidelity=fidelity, soil=soil).sweeps[0]
    at = felt.plan.position_mm()
    oil = np.broadcast_to((at > 2.6) & (at < 3.7), felt.flags.shape) & (felt.flags == 0)
    step = replace(touch, friction=0.1).land_moment_n_mm()
    assert abs(step / touch.land_moment_n_mm() - 1.0) > 0.03
    np.testing.assert_allclose(felt.moment_n_mm[oil], step, rtol=1e-3)
    given = trace_scan(top, touch=touch, plan=plan, fidelity=fidelity, soil=soil, friction=0.4).sweeps[0]
    np.testing.assert_allclose(given.moment_n_mm[given.flags == 0], touch.land_moment_n_mm(), rtol=1e-3)


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_a_groove_caked_full_is_felt_by_as_much_as_the_dirt_gives(fidelity: Fidelity) -> None:
    """Nothing through hard dirt, the groove's edges through soft, a shallower groove in between."""
    x = np.broadcast_to(np.arange(121) * PITCH, (81, 121))
    depth = np.clip(1.2 - np.abs(x - 3.0), 0.0, 0.2).astype(np.float32)
    top = HeightMap(0.0 * depth, PITCH)
    plan = replace(SMALL_PLAN, directions=(TraceDirection.FORWARD_X,))

    def felt(surface: HeightMap, soil: Soil | None) -> NDArray[np.float64]:
        sweep = trace_scan(surface, touch=TOUCH, plan=plan, fidelity=fidelity, soil=soil).sweeps[0]
        whole = sweep.moment_n_mm[(sweep.flags == 0).all(axis=2)] / TOUCH.land_moment_n_mm()
        return np.asarray(whole.mean(axis=0), dtype=np.float64)

    clean = felt(HeightMap(-depth, PITCH), None)
    kappa_1 = 2.0 * math.pi * TOUCH.tip_radius_mm
    half = TOUCH.land_moment_n_mm() / float(TOUCH.tip.moment_arm_mm @ [-MU, 1.0, 0.0]) * 0.9 / (0.1 * kappa_1)
    hard, middling, soft = (felt(top, soil_of(depth, hardness)) for hardness in (1e6, half, 1.0))
    assert np.ptp(hard) < 1e-3
    middle = hard.size // 2
    assert middling[middle] == pytest.approx(0.9, abs=1e-3)  # 0.1 of 0.2 mm at d0 = 1 mm
    assert clean[middle] == pytest.approx(0.8, abs=1e-3)
    np.testing.assert_allclose(soft, clean, atol=4 * SETTLED)


# --- the pieces


def test_dirt_carries_with_its_mean_hardness_under_the_ball_and_clean_metal_has_no_part_in_it() -> None:
    hardness = np.where(np.arange(40) < 20, 2.0, 6.0)[None, :] * np.ones((30, 1))
    thickness = np.where(np.arange(40) < 30, 0.1, 0.0)[None, :] * np.ones((30, 1))
    hardness[:, 30:] = 1000.0
    soil = soil_of(thickness.astype(np.float32), hardness)
    kappa = carrying_stiffness_n_per_mm(soil, tip_radius_mm=0.2, pitch_mm=0.1)
    unit = 2.0 * math.pi * 0.2
    assert kappa.shape == (30, 40)
    np.testing.assert_allclose(kappa[15, :18], 2.0 * unit, rtol=1e-6)
    np.testing.assert_allclose(kappa[15, 22:30], 6.0 * unit, rtol=1e-6)
    assert 2.0 * unit < kappa[15, 19] < kappa[15, 20] < 6.0 * unit
    even = soil_of(thickness.astype(np.float32), 3.0)
    np.testing.assert_allclose(
        carrying_stiffness_n_per_mm(even, tip_radius_mm=0.0, pitch_mm=0.1),
        2.0 * math.pi * 0.05 * 3.0,
        rtol=1e-6,
    )


def test_on_a_finer_grid_the_metal_is_where_it_was() -> None:
    top, bottom, thickness = dirty_part(0.1)
    soil = soil_of(thickness, 5.0)
    fitted, _ = fit_pitch(top, MU, target_mm=PITCH)
    metal, _ = fit_pitch(bottom, MU, target_mm=PITCH)
    fine = fit_soil(soil, top, fitted, target_mm=PITCH)
    assert fine.shape == fitted.shape
    # beside the dirt the cubic would swing below no thickness at all
    assert np.abs(fitted.z_mm - fine.thickness_mm - metal.z_mm).max() < 0.02
    assert np.median(np.abs(fitted.z_mm - fine.thickness_mm - metal.z_mm)) < 1e-6
    coarse_top, _ = fit_pitch(top, MU, target_mm=0.6)
    coarse = fit_soil(soil, top, coarse_top, target_mm=0.6)
    assert coarse.shape == coarse_top.shape
    assert coarse.thickness_mm.mean() == pytest.approx(thickness.mean(), rel=0.1)  # the rim counts as much
    assert fit_soil(soil, top, top, target_mm=0.1) is soil


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_dropouts_in_dirt_are_told_and_felt_as_filled(fidelity: Fidelity) -> None:
    top, _, thickness = dirty_part()
    z = top.z_mm.copy()
    z[30:34, 60:66] = np.nan
    scan = trace_scan(
        HeightMap(z, PITCH), touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity, soil=soil_of(thickness, 8.0)
    )
    for sweep in scan.sweeps:
        assert np.isfinite(sweep.moment_n_mm).all()
        assert (sweep.flags & SampleFlag.DROPOUT).any()
