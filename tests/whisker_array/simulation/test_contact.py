"""Both fidelities: against closed forms, the paper's formula, a slow solver of its own, and symmetry."""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from glyphs import stamp
from glyphs.soiling.soil import Soil
from glyphs.stamping.faces import Face
from glyphs.surface.maps import HeightMap
from tests.support.felt import felt as felt_whole
from tests.support.trace_frame import sample_lines, trace_contact
from whisker_array.simulation.contact import SurfacePose, land_lag_mm
from whisker_array.simulation.contact_kernel import ABREAST
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.surface import TouchSurface, prepare_surface
from whisker_array.simulation.traces import SampleFlag, Traces
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.enhancement import land_moment_n_mm, moment_ratio
from whisker_array.whisker.sections import Round, WhiskerError
from whisker_array.whisker.shapes import LShaped, TipModel, straight_whisker

# ----------------------------------------------------------------------------------------------------------- contact

D0 = 1.0
MU = 0.2
RIBBON = default_whisker(5.0).tip_model()
WIRE = LShaped(30.0, 3.5, None, 0.0, Round(0.4)).tip_model()
SETTLED = 4e-4
"""Relative to the moment. Newton stops when the tip moves less than 5e-4 of a step, here 1e-5 mm; against the
whisker's stiffness along x, 23 times that in height, this is 1e-4 of the force at d0 = 1, and a few of them."""
Heights = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def surface_of(
    heights: Heights, *, pitch: float, size: tuple[float, float], friction: float | NDArray[np.float32] = MU
) -> TouchSurface:
    """heights(x, z) over size = (along x, along z), mm."""
    x = np.arange(round(size[0] / pitch) + 1) * pitch
    z = np.arange(round(size[1] / pitch) + 1) * pitch
    field = np.broadcast_to(heights(x[None, :], z[:, None]), (z.size, x.size))
    return prepare_surface(HeightMap(field.astype(np.float32), pitch), friction=friction)


def trace(
    surface: TouchSurface,
    tip: TipModel,
    *,
    lines: NDArray[np.float64],
    start: float,
    step: float,
    n: int,
    d0: float = D0,
    mu: float = MU,
) -> Traces:
    return trace_contact(
        surface, tip, lines_mm=lines, start_mm=start, step_mm=step, n_samples=n,
        preload_mm=d0, nominal_friction=mu,
    )  # fmt: skip


def profile(
    heights: Callable[[NDArray[np.float64]], NDArray[np.float64]], tip: TipModel, mu: float
) -> Traces:
    """One trace of 7 mm in steps of 0.02 mm over a surface that is alike across the trace."""
    surface = surface_of(lambda x, z: heights(x), pitch=0.02, size=(8.0, 0.2), friction=mu)
    return trace(surface, tip, lines=np.array([0.1]), start=0.3, step=0.02, n=350, mu=mu)


def softened(tip: TipModel, factor: float) -> TipModel:
    """The same whisker with its lateral compliance multiplied."""
    d = tip.compliance_mm_per_n.copy()
    d[2, 2] *= factor
    return TipModel(d, tip.moment_arm_mm)


def ratio(traces: Traces, tip: TipModel, *, mu: float = MU) -> NDArray[np.float64]:
    return traces.moment_n_mm / land_moment_n_mm(tip, preload_mm=D0, mu=mu)


# --- limits


@pytest.mark.parametrize("mu", [0.0, MU, 0.5])
@pytest.mark.parametrize("angle", [-45.0, -30.0, 30.0, 45.0])
@pytest.mark.parametrize("tip", [RIBBON, WIRE], ids=["ribbon", "wire"])
def test_steady_on_a_ramp_is_the_closed_form(tip: TipModel, angle: float, mu: float) -> None:
    """On an endless plane the sliding force is known: f = f_n (n - mu t), and where the tip then stands.

    The tip lies at x - lag + f_n dx with D11 a = (dx, dy), its height there is p (that) and must be f_n dy - d0.
    """
    p = math.tan(math.radians(angle))
    surface = surface_of(lambda x, z: p * (x - 1.0), pitch=0.02, size=(2.0, 0.4), friction=mu)
    n = 60
    felt = trace(surface, tip, lines=np.array([0.2]), start=0.4, step=0.02, n=n, d0=D0, mu=mu)
    a = np.array([-(p + mu), 1.0 - mu * p, 0.0])
    dx, dy, _ = tip.compliance_mm_per_n @ a
    command = 0.4 + 0.02 * np.arange(n)
    lag = land_lag_mm(tip, preload_mm=D0, friction=mu)
    f_n = (D0 + p * (command - lag - 1.0)) / (dy - p * dx)
    steady = slice(20, None)  # 0.4 mm behind the start, the tip has slid from its rest
    assert not felt.flags.any()
    np.testing.assert_allclose(
        felt.moment_n_mm[0, steady], (f_n * float(tip.moment_arm_mm @ a))[steady], rtol=SETTLED
    )


# --- an independent solver


def slow_trace(
    heights: Callable[[float, float], tuple[float, float, float]],
    tip: TipModel,
    *,
    line: float,
    start: float,
    step: float,
    n: int,
    d0: float,
    mu: float,
) -> NDArray[np.float64]:
    """Minimise 1/2 d^T K d + mu f_n |q - q_prev|_G step by step; f_n and G are iterated to agree with the answer.

    `heights` gives the height and its two slopes, exactly.
    """
    k = np.linalg.inv(tip.compliance_mm_per_n)
    a = np.array([-mu, 1.0, 0.0])
    shift = tip.compliance_mm_per_n @ a
    lag = d0 * shift[0] / shift[1]
    last = np.array([start - step, line])
    moments = []
    for j in range(n):
        free = np.array([start + j * step - lag, line])

        def displacement(q: NDArray[np.float64], free: NDArray[np.float64] = free) -> NDArray[np.float64]:
            return np.array([q[0] - free[0], heights(q[0], q[1])[0] + d0, q[1] - free[1]])

        q = last + np.array([step, 0.0])
        for _ in range(30):
            _, p, r = heights(q[0], q[1])
            f = k @ displacement(q)
            f_n = (f @ np.array([-p, 1.0, -r])) / math.sqrt(1.0 + p * p + r * r)
            metric = np.array([[1.0 + p * p, p * r], [p * r, 1.0 + r * r]])

            def energy(
                u: NDArray[np.float64],
                f_n: float = f_n,
                metric: NDArray[np.float64] = metric,
                last: NDArray[np.float64] = last,
                displacement: Callable[[NDArray[np.float64]], NDArray[np.float64]] = displacement,
            ) -> float:
                d, move = displacement(last + step * u), step * u
                # in units of the force times a step, so that the minimiser's tolerances mean something
                return float(0.5 * d @ k @ d + mu * f_n * math.sqrt(move @ metric @ move)) / (f_n * step)

            best = optimize.minimize(
                energy, (q - last) / step, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-13}
            )
            moved = float(np.abs(last + step * best.x - q).max())
            q = last + step * best.x
            if moved < 1e-5 * step:
                break
        moments.append(float(tip.moment_arm_mm @ (k @ displacement(q))))
        last = q
    return np.array(moments)


@pytest.mark.parametrize("tip", [RIBBON, WIRE], ids=["ribbon", "wire"])
def test_the_kernel_minimises_the_energy_that_it_states(tip: TipModel) -> None:
    def heights(x: float, z: float) -> tuple[float, float, float]:
        # a bank that rises and falls along the trace and leans across it
        return (
            0.15 * math.sin(2.0 * x) + 0.12 * math.sin(1.5 * z),
            0.3 * math.cos(2.0 * x),
            0.18 * math.cos(1.5 * z),
        )

    surface = surface_of(
        lambda x, z: 0.15 * np.sin(2.0 * x) + 0.12 * np.sin(1.5 * z),
        pitch=0.02,
        size=(6.0, 4.0),
        friction=0.3,
    )
    step, n = 0.02, 75
    felt = trace(surface, tip, lines=np.array([1.7]), start=1.0, step=step, n=n, d0=0.6, mu=0.3)
    slow = slow_trace(heights, tip, line=1.7, start=1.0, step=step, n=n, d0=0.6, mu=0.3)
    assert not felt.flags.any()
    assert np.ptp(slow) > 0.3 * abs(slow.mean())
    np.testing.assert_allclose(felt.moment_n_mm[0], slow, rtol=SETTLED)


# --- symmetry, friction, sideways


def test_round_wire_slides_into_a_groove_that_runs_along_the_trace_and_a_ribbon_less() -> None:
    # a groove 0.3 mm deep with 45 degree walls that comes in beside the trace: the line runs half-way up the wall
    def groove(x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
        depth = 0.3 * np.clip(x - 1.0, 0.0, 1.0)
        return -np.clip(depth + 0.45 - np.abs(z - 1.5), 0.0, depth)

    surface = surface_of(groove, pitch=0.02, size=(8.0, 3.0))
    stiff = softened(WIRE, 1.0 / 30.0)
    lines, n = np.array([1.5 - 0.6]), 300
    off = {}
    for name, tip in (("wire", WIRE), ("ribbon", stiff)):
        felt = trace(surface, tip, lines=lines, start=0.4, step=0.02, n=n)
        h, mu, _ = sample_lines(surface, lines_mm=lines, start_mm=0.4, step_mm=0.02, n_samples=n)
        ideal = trace_pointwise(h, tip, step_mm=0.02, preload_mm=D0, friction=mu)
        assert h[0, -1] == pytest.approx(-0.15, abs=1e-6)
        assert not felt.flags.any()
        off[name] = float(ratio(felt, tip)[0, -50:].mean() - ratio(ideal, tip)[0, -50:].mean())
    # the wire lies on the floor, 0.3 deep instead of 0.15
    assert off["wire"] == pytest.approx(-0.15, abs=0.01)
    # the ribbon gives by Dzz / Dyy (d0 + h) = 0.030 mm; and the wall, steeper than the trace knows, presses
    # with sqrt(2) times the friction, which the formula along the trace leaves out: 0.012
    assert off["ribbon"] == pytest.approx(-0.042, abs=0.006)


def test_oil_is_felt_by_an_l_shaped_whisker_and_not_by_a_straight_one() -> None:
    mu = np.full((21, 401), 0.4, dtype=np.float32)
    mu[:, 150:300] = 0.1
    surface = surface_of(lambda x, z: 0.0 * x, pitch=0.02, size=(8.0, 0.4), friction=mu)
    bent, straight = WIRE, straight_whisker(30.0, 0.0, Round(0.4)).tip_model()
    felt = {
        name: trace(surface, tip, lines=np.array([0.2]), start=0.4, step=0.02, n=360, mu=0.4)
        for name, tip in (("L", bent), ("straight", straight))
    }
    assert not felt["L"].flags.any()
    in_oil, clean = slice(160, 250), slice(0, 120)  # well within the patch at 3 to 6 mm
    step = land_moment_n_mm(bent, preload_mm=D0, mu=0.1) / land_moment_n_mm(bent, preload_mm=D0, mu=0.4)
    assert abs(step - 1.0) > 0.04
    np.testing.assert_allclose(ratio(felt["L"], bent, mu=0.4)[0, clean], 1.0, rtol=1e-4)
    np.testing.assert_allclose(ratio(felt["L"], bent, mu=0.4)[0, in_oil], step, rtol=1e-3)
    np.testing.assert_allclose(ratio(felt["straight"], straight, mu=0.4), 1.0, rtol=1e-4)


# --- flags


def test_contact_is_lost_over_a_groove_deeper_than_the_preload_and_found_again() -> None:
    def groove(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return -np.clip(1.4 - np.abs(x - 4.0), 0.0, 1.4)

    felt = profile(groove, WIRE, MU)
    at = 0.3 + 0.02 * np.arange(350)
    lost = (felt.flags[0] & SampleFlag.CONTACT_LOST) > 0
    assert lost[np.abs(at - 4.0) < 0.2].all()
    assert not lost[np.abs(at - 4.0) > 0.7].any()  # the land side of the walls is well within the preload
    assert (felt.moment_n_mm[0, lost] == 0.0).all()
    np.testing.assert_allclose(ratio(felt, WIRE)[0, at > 6.0], 1.0, rtol=1e-3)
    shallow = profile(lambda x: 0.5 * groove(x), WIRE, MU)
    assert not shallow.flags.any()


@pytest.mark.parametrize(
    ("k", "mu", "angle"), [(0.05, 1.0, 60.0), (0.117, 1.0, 60.0), (0.05, 1.2, 60.0), (0.05, 0.5, 80.0)]
)
def test_a_wall_that_cannot_be_climbed_jams_and_gives_no_number(k: float, mu: float, angle: float) -> None:
    # 1 - mu p + 1.5 k (p + mu) <= 0: no force in the friction cone lifts the tip
    p = math.tan(math.radians(angle))
    assert 1.0 - mu * p + 1.5 * k * (p + mu) < 0.0
    tip = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.4)).tip_model()
    felt = profile(lambda x: p * np.clip(x - 3.0, 0.0, 0.8 / p), tip, mu)
    at = 0.3 + 0.02 * np.arange(350)
    jammed = (felt.flags[0] & SampleFlag.JAMMED) > 0
    assert not jammed[at < 2.9].any()
    assert jammed[at > 3.3].all()  # held at the foot for good, while the base walks on
    assert (felt.moment_n_mm[0, jammed] == 0.0).all()
    # until it is called jammed, what the whisker feels is within a few times what it can feel
    assert np.abs(ratio(felt, tip, mu=mu)).max() < 3.0


@pytest.mark.parametrize("mu", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("angle", [-60.0, 60.0])
def test_the_steepest_bevels_of_dies_do_not_jam_the_default_whisker(angle: float, mu: float) -> None:
    p = math.tan(math.radians(angle))
    felt = profile(lambda x: p * np.clip(x - 3.0, 0.0, 0.3 / abs(p)), RIBBON, mu)
    assert not (felt.flags & SampleFlag.JAMMED).any()
    after = ratio(felt, RIBBON, mu=mu)[0, -100:]
    np.testing.assert_allclose(after, 1.0 + math.copysign(0.3, p), rtol=1e-3)


def test_leaving_the_surface_is_flagged() -> None:
    surface = surface_of(lambda x, z: 0.0 * x, pitch=0.05, size=(4.0, 1.0))
    felt = trace(surface, RIBBON, lines=np.array([0.5]), start=-0.5, step=0.05, n=100)
    at = -0.5 + 0.05 * np.arange(100)
    outside = (at < -1e-9) | (at > 4.0 + 1e-9)
    rim = np.isclose(at, 0.0) | np.isclose(at, 4.0)
    np.testing.assert_array_equal((felt.flags[0] == SampleFlag.OUTSIDE)[~rim], outside[~rim])


@pytest.mark.parametrize(("face", "mu"), [(Face.FLAT, 0.1), (Face.SHARP, 0.2), (Face.ROUND, 0.4)])
def test_the_solver_settles_on_stamped_plates(face: Face, mu: float) -> None:
    part = stamp("A8", face=face, bevel_deg=60.0 if mu == 0.2 else 45.0, seed=4)
    for sweep in felt_whole(part.height_map, friction=mu).sweeps:
        assert not (sweep.flags & ~np.uint8(SampleFlag.OUTSIDE)).any()


# --- the rest


def test_the_same_whatever_the_number_of_threads() -> None:
    surface = surface_of(lambda x, z: 0.1 * np.sin(3 * x) * np.cos(2 * z), pitch=0.03, size=(4.0, 3.0))
    threads = numba.get_num_threads()
    runs = []
    try:
        for count in sorted({1, threads}):
            numba.set_num_threads(count)
            for _ in range(2):
                felt = trace(surface, RIBBON, lines=np.linspace(0.3, 2.7, 23), start=0.3, step=0.03, n=110)
                runs.append(felt.moment_n_mm)
    finally:
        numba.set_num_threads(threads)
    for other in runs[1:]:
        np.testing.assert_array_equal(other, runs[0])


@pytest.mark.parametrize("dirty", [False, True])
def test_lines_do_not_know_of_each_other(dirty: bool) -> None:
    """Traced abreast in more than one block, or each alone: some settle at once, some jam, some lose contact."""
    lines = np.linspace(0.3, 2.7, 2 * ABREAST + 3)
    y, x = np.mgrid[:101, :134] * 0.03
    rough = (0.1 * np.sin(3 * x) * np.cos(2 * y) * (y > 1.0)).astype(np.float32)
    rough[60:70, 40:] += 2.5  # a wall that jams
    rough[80:90, 60:90] -= 1.5  # a hole deeper than the preload
    soil = None
    if dirty:
        thickness = np.where(x > 1.5, 0.1, 0.0).astype(np.float32)
        soil = Soil(thickness, np.full(x.shape, 5.0, np.float32), np.full(x.shape, MU, np.float32))
    surface = prepare_surface(HeightMap(rough, 0.03), tip_radius_mm=0.06, friction=MU, soil=soil)
    together = trace(surface, RIBBON, lines=lines, start=0.3, step=0.03, n=110)
    seen = SampleFlag(int(np.bitwise_or.reduce(together.flags, axis=None)))
    assert SampleFlag.JAMMED in seen
    assert SampleFlag.CONTACT_LOST in seen
    for i in range(lines.size):
        alone = trace(surface, RIBBON, lines=lines[i : i + 1], start=0.3, step=0.03, n=110)
        np.testing.assert_array_equal(alone.moment_n_mm[0], together.moment_n_mm[i])
        np.testing.assert_array_equal(alone.flags[0], together.flags[i])


@pytest.mark.parametrize("turned_deg", [0.0, 3.0, 90.0, 180.0])
def test_a_surface_laid_at_an_angle_is_felt_as_one_on_the_grid_of_the_traces(turned_deg: float) -> None:
    """Left over: a hundredth of the land, two grids of one bump with slopes of 20 degrees."""
    pitch, start, lines = 0.0125, 0.6, np.array([1.1, 1.4])
    slope_x, slope_z = 0.004, -0.003

    def bump(x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(-0.25 * np.exp(-((x - 2.0) ** 2 + (z - 1.3) ** 2) / 0.5))

    own = surface_of(lambda x, z: bump(x, z) + slope_x * x + slope_z * z, pitch=pitch, size=(4.0, 2.6))
    c, s = math.cos(math.radians(turned_deg)), math.sin(math.radians(turned_deg))
    # of the map's places in the trace frame: turned about (2, 1.3), which is (2.5, 2.5) of the map
    there = surface_of(
        lambda u, v: bump(2.0 + c * (u - 2.5) + s * (v - 2.5), 1.3 - s * (u - 2.5) + c * (v - 2.5)),
        pitch=pitch, size=(5.0, 5.0),
    )  # fmt: skip
    half = 0.5 * there.fields[..., :3]
    pose = SurfacePose(
        column_mm=(2.5 - c * 2.0 + s * 1.3, c, -s),
        row_mm=(2.5 - s * 2.0 - c * 1.3, s, c),
        tilt=(0.0, slope_x, slope_z),
        share=2.0,
        friction=MU,
    )
    step, n = 0.02, 140
    felt = trace(own, WIRE, lines=lines, start=start, step=step, n=n)
    told = trace_contact(
        TouchSurface(np.concatenate([0.0 * half, half], axis=2), there.dropout, pitch), WIRE, lines_mm=lines,
        start_mm=start, step_mm=step, n_samples=n, preload_mm=D0, nominal_friction=MU, pose=pose,
    )  # fmt: skip
    assert not told.flags.any()
    np.testing.assert_allclose(ratio(told, WIRE), ratio(felt, WIRE), atol=0.01)


# --------------------------------------------------------------------------------------------------------- pointwise

STEP = 0.05
FLOAT32 = 2e-5
"""Relative: heights of 1 mm in float32 make slopes uncertain by 1e-6, doubled where F is steep."""


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("k", [0.033, 0.117, 0.3])
def test_ramps_up_and_down_are_eq_16(k: float, mu: float) -> None:
    tip = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.4)).tip_model()
    slope = np.tan(np.radians([-60.0, -45.0, -30.0, -5.0, 0.0, 5.0, 30.0, 45.0, 60.0]))
    x = STEP * (np.arange(15) - 7)
    h = slope[:, None] * x  # within 0.61 mm of the land
    felt = trace_pointwise(h.astype(np.float32), tip, step_mm=STEP, preload_mm=D0, friction=mu)
    expected = land_moment_n_mm(tip, preload_mm=D0, mu=mu) * (1.0 + h / D0)
    expected *= moment_ratio(slope, mu, tip)[:, None]
    assert not felt.flags.any()
    np.testing.assert_allclose(felt.moment_n_mm, expected, rtol=FLOAT32)


def test_lost_contact_and_jamming_are_flagged_and_carry_no_number() -> None:
    tip = LShaped(30.0, 15.0, None, 0.0, Round(0.4)).tip_model()  # k = 0.5 jams at atan(4/3) = 53 degrees
    x = STEP * np.arange(60)
    deep = -np.clip(x - 1.0, 0.0, 1.2) * 0.9
    wall = np.where(x < 1.0, 0.0, np.where(x < 1.3, -2.0 * (x - 1.0), -0.6))
    felt = trace_pointwise(np.float32([deep, wall]), tip, step_mm=STEP, preload_mm=D0, friction=0.0)
    lost = np.float32(deep) <= -D0
    assert lost.any()
    np.testing.assert_array_equal(felt.flags[0] == SampleFlag.CONTACT_LOST, lost)
    on_wall = (x > 1.0 + 1e-9) & (x < 1.3 - 1e-9)
    assert (felt.flags[1, on_wall] == SampleFlag.JAMMED).all()
    assert (felt.flags[1, ~on_wall] == 0).sum() >= (~on_wall).sum() - 2  # the two corners have half the slope
    assert (felt.moment_n_mm[felt.flags != 0] == 0.0).all()
    assert (felt.moment_n_mm[felt.flags == 0] < 0.0).all()


def test_a_trace_of_one_sample_is_flat_and_refusals_speak() -> None:
    tip = default_whisker(5.0).tip_model()
    h = np.full((1, 1), 0.1, dtype=np.float32)
    felt = trace_pointwise(h, tip, step_mm=STEP, preload_mm=D0, friction=0.2)
    assert felt.moment_n_mm[0, 0] == pytest.approx(
        1.1 * land_moment_n_mm(tip, preload_mm=D0, mu=0.2), rel=1e-5
    )
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(WhiskerError, match="preload_mm"):
            trace_pointwise(h, tip, step_mm=STEP, preload_mm=wrong, friction=0.2)
        with pytest.raises(WhiskerError, match="step_mm"):
            trace_pointwise(h, tip, step_mm=wrong, preload_mm=D0, friction=0.2)
