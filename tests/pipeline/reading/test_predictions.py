"""Print the figures of an identified whisker for a request, with their uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.cli.design_report import fitness
from pipeline.reading.predictions import predictions
from tests.support.benches import known_whisker
from whisker_array.design.limits import Request
from whisker_array.identification.bench import Unknown
from whisker_array.identification.knowledge import Knowledge
from whisker_array.whisker.enhancement import is_jammed
from whisker_array.whisker.sections import WhiskerError

WHISKER, TOUCH, KNOWN = known_whisker()
REQUEST = Request(
    alpha_rad=(math.radians(20.0), math.radians(45.0)), mu=(0.1, 0.3), depth_mm=0.3, character_height_mm=5.0
)


def of(known: Knowledge) -> dict[str, tuple[float, float]]:
    told = predictions(WHISKER, TOUCH, known, more=fitness(REQUEST))
    return {one.what: (one.value, one.sd) for one in told}


def test_spread_is_that_of_whiskers_drawn_from_what_is_known() -> None:
    """First order against 2,000 draws: within 10 %, three times what so many draws leave of a standard deviation."""
    rng = np.random.default_rng(5)
    drawn = rng.multivariate_normal(np.zeros(len(KNOWN.names)), KNOWN.covariance, size=2000)
    by_name = dict(zip(KNOWN.names, drawn.T, strict=True))
    moments = []
    for k in range(len(drawn)):
        whisker = replace(
            WHISKER,
            l1_mm=WHISKER.l1_mm + by_name[Unknown.L1][k],
            l2_mm=WHISKER.l2_mm + by_name[Unknown.L2][k],
            l3_mm=WHISKER.lowered_mm + by_name[Unknown.L3][k],
            beta_rad=WHISKER.beta_rad + math.radians(by_name[Unknown.BETA][k]),
        )
        touch = replace(
            TOUCH,
            tip=whisker.tip_model(),
            preload_mm=TOUCH.preload_mm + by_name[Unknown.PRELOAD][k],
            friction=TOUCH.friction + by_name[Unknown.FRICTION][k],
        )
        moments.append(abs(touch.land_moment_n_mm()) * (1.0 + by_name[Unknown.STIFFNESS][k]))
    value, sd = of(KNOWN)["moment of the land, N mm"]
    assert value == pytest.approx(abs(TOUCH.land_moment_n_mm()))
    assert sd == pytest.approx(np.std(moments), rel=0.1)


def test_the_steepest_wall_is_where_the_whisker_jams() -> None:
    steepest, _ = of(KNOWN)["steepest wall it climbs, deg"]
    slopes = np.tan(np.radians([steepest - 0.1, steepest + 0.1]))
    np.testing.assert_array_equal(is_jammed(slopes, TOUCH.friction, TOUCH.tip), [False, True])


def test_a_whisker_that_jams_in_the_job_is_no_number() -> None:
    steep = replace(REQUEST, alpha_rad=(math.radians(30.0), math.radians(85.0)), mu=(0.1, 0.9))
    told = {one.what: one for one in predictions(WHISKER, TOUCH, KNOWN, more=fitness(steep))}
    assert math.isnan(told["worst edge contrast"].value)
    assert math.isfinite(told["moment of the land, N mm"].value)


@pytest.mark.parametrize(
    ("names", "covariance", "says"),
    [
        ((Unknown.L1, Unknown.L1), np.eye(2), "or one twice"),
        ((Unknown.PLAY,), np.eye(1), "or one twice"),
        ((Unknown.L1,), np.eye(2), r"must be \(1, 1\)"),
        ((Unknown.L1,), np.array([[np.nan]]), "must be finite"),
        ((Unknown.L1,), np.array([[-1.0]]), "negative variance"),
    ],
)
def test_knowledge_that_cannot_be_is_refused(
    names: tuple[Unknown, ...], covariance: np.ndarray, says: str
) -> None:
    with pytest.raises(WhiskerError, match=says):
        Knowledge(names, covariance)
