"""Figures of the paper: the step read off a simulated trace is that of eq. (16)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_figures import draw_figures
from paper_steps import PRELOAD_MM, StepError, Wedge, feel_step, paper_whisker, read_step

from tests.support.benches import preload_stress_mpa
from tests.support.run_tables import csv_rows
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.validity import deflection_ratio

SAMPLE = 0.35e-2
"""Relative: the foot is felt a sample of 1 um early or late, of the 289 um in which a 60 degree slope would bring
the moment down to nothing from there. Flatter slopes are longer."""


def trace_by_the_rule(
    *, factor: float, gear: float, ramp_share: float, alpha: float, start: float
) -> tuple[np.ndarray, np.ndarray, Wedge]:
    """A trace by the rule m / m_land = F (1 + h/d0), over a commanded place that runs `gear` times the tip's.

    A ramp at the foot, of the share of the widest that can be told from the line, and a land of -2.5 N mm.
    """
    wedge = Wedge(alpha)
    x = np.arange(-0.6, wedge.run_mm + 0.5, 0.001)
    height = np.maximum(-(x - start) * math.tan(alpha) / gear, -0.5)
    foot = start + gear * wedge.run_mm
    ratio = np.where(x < start, 1.0, factor * (1.0 + height))
    steepness = factor * math.tan(alpha) / gear
    ramp = max(ramp_share * abs(factor - 1.0) * 0.5 / (4.0 * steepness), 1e-9)
    ratio = np.where(x > foot, 0.5 * (factor + (1.0 - factor) * np.clip((x - foot) / ramp, 0.0, 1.0)), ratio)
    return x, -2.5 * ratio, wedge


@settings(max_examples=15, deadline=None)
@given(
    factor=st.floats(0.7, 1.8),
    gear=st.floats(0.7, 1.0),
    ramp_share=st.floats(0.0, 1.0),
    alpha_deg=st.floats(15.0, 60.0),
    start=st.floats(-0.03, 0.03),
)
def test_any_factor_is_read_off_a_trace_by_the_rule(
    factor: float, gear: float, ramp_share: float, alpha_deg: float, start: float
) -> None:
    alpha = math.radians(alpha_deg)
    x, moment, wedge = trace_by_the_rule(
        factor=factor, gear=gear, ramp_share=ramp_share, alpha=alpha, start=start
    )
    reading = read_step(x, moment, wedge=wedge, preload_mm=1.0)
    # one sample, over the length in which the line would come to nothing from the foot on
    one_sample = 0.001 * math.tan(alpha) / (gear * 0.5)
    assert reading.factor == pytest.approx(factor, rel=one_sample)
    assert reading.foot_mm == pytest.approx(start + gear * wedge.run_mm, abs=0.001)
    assert reading.edge_mm == pytest.approx(
        start, abs=0.002
    )  # as far before the foot as that is before no lift
    assert reading.land_n_mm == pytest.approx(-2.5)


@pytest.mark.parametrize(("k", "alpha", "mu"), [(0.083, 45.0, 0.2), (0.083, 60.0, 0.0), (0.117, 60.0, 0.2)])
def test_in_contact_the_tip_slides_off_the_edge_and_the_peak_is_lower_than_f(
    k: float, alpha: float, mu: float
) -> None:
    """Eq. (7) keeps the tip's height at the edge, but the base is what stands still.

    The force turns towards +x, so the whisker yields by d0 (g' - g) more along x, g = D11 f along x over along
    y; the tip goes that far down the slope, and farther as its lift and with it its lag become less.
    """
    tip = paper_whisker(k).tip_model()
    slope = math.tan(math.radians(alpha))

    def give(p: float) -> float:
        force = np.array([p - mu, 1.0 + mu * p, 0.0])
        shift = tip.compliance_mm_per_n @ force
        return float(shift[0] / shift[1])

    step = feel_step(k, alpha, mu, Fidelity.CONTACT, tip_radius_mm=0.0)
    slid = (give(slope) - give(0.0)) / (1.0 + give(slope) * slope)
    # a sample of the trace, 1.7 um of height at most, in 1 mm of lift
    assert step.reading.peak == pytest.approx(step.predicted * (1.0 - slope * slid), rel=2e-3)
    assert step.reading.peak < 0.995 * step.predicted
    pointwise = feel_step(k, alpha, mu, Fidelity.POINTWISE, tip_radius_mm=0.0)
    assert pointwise.reading.peak == pytest.approx(step.predicted, rel=3e-3)


def test_a_ball_rounds_the_edge_but_leaves_the_step_on_the_line() -> None:
    sharp, blunt = (feel_step(0.083, 45.0, 0.2, Fidelity.POINTWISE, tip_radius_mm=r) for r in (0.0, 0.05))
    # the ball leaves the edge r (1 - cos(alpha)) below the land
    lower = 0.05 * (1.0 - math.cos(math.radians(45.0)))
    assert blunt.reading.peak == pytest.approx(blunt.predicted * (1.0 - lower), rel=2e-3)
    assert sharp.reading.peak > blunt.reading.peak
    assert blunt.reading.factor == pytest.approx(sharp.reading.factor, rel=SAMPLE)


@pytest.mark.parametrize("k", [0.033, 0.083, 0.117])
def test_the_whiskers_are_within_the_limits_of_the_beam(k: float) -> None:
    whisker = paper_whisker(k)
    assert deflection_ratio(whisker, preload_mm=PRELOAD_MM, mu=0.5) < 0.1
    assert preload_stress_mpa(whisker, preload_mm=PRELOAD_MM, mu=0.5) < 0.2 * whisker.material.yield_mpa


def test_a_trace_that_is_no_step_is_refused() -> None:
    x, moment, wedge = trace_by_the_rule(factor=1.2, gear=0.9, ramp_share=0.0, alpha=0.8, start=0.0)
    with pytest.raises(StepError, match="does not fall"):
        read_step(x, np.full_like(x, -2.0), wedge=wedge, preload_mm=1.0)
    with pytest.raises(StepError, match="level out at"):
        read_step(x, moment, wedge=wedge, preload_mm=2.0)
    with pytest.raises(StepError, match="jams"):
        # past atan(2 / (3 k)) = 53 degrees
        feel_step(0.5, 60.0, 0.0, Fidelity.POINTWISE)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    """The steps of one run of the script, which leaves all its pictures."""
    folder = tmp_path_factory.mktemp("gallery") / "new" / "folder"
    written = draw_figures(folder, mu=0.1)
    assert [path.name for path in written if path.stat().st_size > 1000] == [
        *("fig4-factor.png", "fig6-test-pieces.png", "fig7-whiskers.png", "figures.csv")
    ]
    return csv_rows(folder / "figures.csv")


def test_the_table_has_every_step_the_paper_asks_for(rows: list[dict[str, str]]) -> None:
    columns = "figure k alpha_deg mu fidelity f_predicted f_read_off error peak"
    assert list(rows[0]) == columns.split()
    steps = {(r["figure"], float(r["k"]), float(r["alpha_deg"]), float(r["mu"])) for r in rows}
    assert len(rows) == 2 * len(steps)  # both fidelities
    assert steps == {
        *((f, k, a, mu) for f, k in (("4a", 0.033), ("4b", 0.117)) for a in (15, 30, 45, 60) for mu in (0, 0.2, 0.5)),
        *(("6", 0.083, alpha, 0.1) for alpha in (30, 45, 60)),
        *(("7", k, 60, 0.1) for k in (0, 0.033, 0.083, 0.117)),
    }  # fmt: skip
    for row in rows:
        predicted, read_off = float(row["f_predicted"]), float(row["f_read_off"])
        assert read_off == pytest.approx(predicted, rel=SAMPLE)
        assert float(row["k"]) > 0.0 or float(row["peak"]) == pytest.approx(1.0, abs=1e-4)
        assert float(row["error"]) == pytest.approx(
            read_off / predicted - 1.0, abs=1e-5
        )  # six printed digits


def test_the_paper_s_whisker_makes_the_paper_s_steps(rows: list[dict[str, str]]) -> None:
    contact = [r for r in rows if r["figure"] == "6" and r["fidelity"] == "contact"]
    assert [float(r["f_predicted"]) for r in contact] == pytest.approx([1.073, 1.127, 1.225], abs=6e-4)


def test_the_paper_s_finding_30_degrees_hardly_45_and_60_clearly(rows: list[dict[str, str]]) -> None:
    for fidelity in Fidelity:
        over = {
            float(r["alpha_deg"]): float(r["peak"]) - 1.0
            for r in rows
            if (r["figure"], r["fidelity"]) == ("6", fidelity.value)
        }
        assert over[30.0] < 0.07
        assert over[45.0] > 1.5 * over[30.0]
        assert over[60.0] > 2.5 * over[30.0]
