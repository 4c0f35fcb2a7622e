"""Friction of the land, from mixed shapes or from dragging and pushing back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap, TraceDirection
from tests.factories import extruded, ideal_chain, scanned
from whisker_array.estimation.friction import USABLE_SD, FrictionRoute, land_friction
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.touch import default_touch, profiling_touch

N = 8
PITCH = 0.02
TOUCH, PROFILER = default_touch(5.0), profiling_touch(5.0)
FRICTIONS = (0.1, 0.2, 0.3, 0.5)


def piece() -> HeightMap:
    r"""Land with one groove 0.3 mm deep, 45 degrees, along y: ``___/-\___`` upside down."""
    x = np.arange(0.0, 10.0, PITCH)
    z = np.interp(x, [4.0, 4.3, 5.7, 6.0], [0.0, -0.3, -0.3, 0.0])
    return extruded(z, rows=round(4.2 / PITCH), pitch_mm=PITCH)


def scan_of(
    mu: float,
    *,
    fidelity: Fidelity = Fidelity.POINTWISE,
    two_way: bool = True,
    gain_sd: float | None = 0.03,
) -> Scan:
    plan = RasterPlan(
        array=WhiskerArray(N, 0.5, kinds=2),
        region_mm=(0.8, 0.1, 9.2, 3.9),
        line_pitch_mm=0.125,
        sample_pitch_mm=0.04,
        directions=(TraceDirection.FORWARD_X,),
        lead_mm=0.6,
        two_way=two_way,
    )
    return scanned(
        piece(), plan, touch=TOUCH, others=(PROFILER,), fidelity=fidelity, friction=mu, gain_sd=gain_sd
    )


@pytest.mark.parametrize("mu", FRICTIONS)
@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_two_ways_give_the_friction_whatever_the_gains(fidelity: Fidelity, mu: float) -> None:
    found = land_friction(scan_of(mu, fidelity=fidelity))
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
    (found,) = land_friction(scan_of(mu, fidelity=fidelity, two_way=False, gain_sd=0.001))
    assert found.route is FrictionRoute.SHAPES
    assert found.sd < USABLE_SD
    # its own standard error, of eight pairs, and 0.005 for what all pairs have in common
    assert abs(found.mu - mu) < 3.0 * found.sd + 0.005


def test_gains_read_off_land_say_nothing_of_its_friction() -> None:
    chain = ideal_chain(2 * N)
    calibration = Calibration(chain.gain, chain.offset_n_mm, from_land=True)
    assert land_friction(replace(scan_of(0.4, two_way=False), calibration=calibration)) == ()
    # the way back needs no gains
    (found,) = land_friction(replace(scan_of(0.4), calibration=calibration))
    assert found.route is FrictionRoute.TWO_WAYS
    assert found.mu == pytest.approx(0.4, abs=0.003)


def test_one_whisker_has_no_standard_error() -> None:
    scan = scan_of(0.3)
    columns = [0, N]
    sweeps = tuple(
        replace(
            s,
            plan=replace(s.plan, line_mm=s.plan.line_mm[:, columns]),
            moment_n_mm=s.moment_n_mm[:, columns],
            flags=s.flags[:, columns],
            air_n_mm=s.air_n_mm[:, columns],
        )
        for s in scan.sweeps
    )
    for found in land_friction(replace(scan, sweeps=sweeps, kind=(0, 1))):
        assert found.sd == float("inf")
