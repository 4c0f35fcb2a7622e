"""A warning where the linear beam misses the exact force, moment or deflection."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.cli.whisker import linear_beam_warning
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.elastica import linear_error
from whisker_array.whisker.sections import Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import Chain, LShaped, Whisker, straight_whisker
from whisker_array.whisker.validity import DEFLECTION_LIMIT, LINEAR_ERROR_LIMIT, deflection_ratio

LONG_ARM = LShaped(30.0, 9.0, None, 0.0, Rectangle(0.3, 4.5))
"""k = 0.3: bends by under 10 % of l1 at 1 mm, yet the linear force is wrong by more than 2 %."""


@pytest.mark.parametrize("height", [2.5, 5.0, 10.0])
def test_default_whisker_gives_no_warning(height: float) -> None:
    for mu in (0.0, 0.2, 0.5):
        assert linear_beam_warning(default_whisker(height), lift_mm=default_preload_mm(height), mu=mu) == ""


def test_warning_gives_the_measured_errors() -> None:
    line = linear_beam_warning(LONG_ARM, lift_mm=1.25, mu=0.2)
    error = linear_error(LONG_ARM, lift_mm=1.25, mu=0.2)
    assert "1.25 mm" in line
    assert f"{100 * error.force:+.1f} % in force" in line
    assert f"{100 * error.moment:+.1f} % in moment" in line
    assert f"{100 * deflection_ratio(LONG_ARM, preload_mm=1.25, mu=0.2):.1f} % of l1" in line


@settings(max_examples=30, deadline=None)
@given(k=st.floats(0.02, 0.4), preload=st.floats(0.2, 5.0), mu=st.floats(0.0, 0.5))
def test_silent_exactly_within_the_limits(k: float, preload: float, mu: float) -> None:
    whisker = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.4))
    error = linear_error(whisker, lift_mm=preload, mu=mu)
    ratio = deflection_ratio(whisker, preload_mm=preload, mu=mu)
    over = max(abs(error.force), abs(error.moment)) > LINEAR_ERROR_LIMIT or ratio > DEFLECTION_LIMIT
    assert bool(linear_beam_warning(whisker, lift_mm=preload, mu=mu)) == over


@pytest.mark.parametrize(
    ("whisker", "mu", "why"),
    [
        (LShaped(30.0, 3.0, None, -1.2, Rectangle(0.3, 4.5)), 0.5, "jams"),
        (Chain(np.array([[0.0, 0, 0], [-20, -2, 0], [-22, -4, 1]]), Round(0.3)), 0.2, "plane"),
        (straight_whisker(1.0, 0.0, Round(0.3)), 0.2, "cannot be"),
    ],
)
def test_no_exact_answer_is_said(whisker: Whisker, mu: float, why: str) -> None:
    line = linear_beam_warning(whisker, lift_mm=1.1, mu=mu)
    assert "cannot be checked" in line
    assert why in line


def test_negative_friction_is_refused() -> None:
    with pytest.raises(WhiskerError, match="mu"):
        linear_beam_warning(default_whisker(5.0), lift_mm=1.0, mu=-0.2)
