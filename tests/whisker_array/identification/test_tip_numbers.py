"""A tip in five numbers, and back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whisker_array.identification.tip_numbers import SHAPE, tip_numbers, tip_of_numbers
from whisker_array.whisker.defaults import default_whisker


@pytest.mark.parametrize("beta_deg", [0.0, 20.0, 45.0])
def test_a_tip_comes_back_but_for_a_factor(beta_deg: float) -> None:
    tip = replace(default_whisker(5.0), beta_rad=math.radians(beta_deg)).tip_model()
    factor = tip.compliance_mm_per_n[1, 1]
    again = tip_of_numbers(tip_numbers(tip))
    np.testing.assert_allclose(
        again.compliance_mm_per_n, tip.compliance_mm_per_n / factor, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(again.moment_arm_mm, tip.moment_arm_mm / factor, rtol=1e-9, atol=1e-12)


@given(st.lists(st.floats(-4.0, 4.0), min_size=SHAPE, max_size=SHAPE))
def test_of_any_numbers_there_is_a_tip(off: list[float]) -> None:
    """A steep beam's D11 is nearly singular, and a cloud around it must not leave what beams are: TipModel refuses."""
    steep = replace(default_whisker(5.0), beta_rad=math.radians(25.0)).tip_model()
    q = tip_numbers(steep)
    q[:SHAPE] += off
    np.testing.assert_allclose(tip_numbers(tip_of_numbers(q)), q, rtol=1e-6, atol=1e-6)
