"""Exact bounds and the parts that an interval takes, against scipy and the formulas."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.benchmark.analysis.bounds import bounded, parts_without_wrong
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.trials.planning import foresight, half_width, parts_needed
from pipeline.common.shares import share


@settings(deadline=None)
@given(st.integers(0, 40), st.integers(0, 40))
def test_bounds_are_those_of_scipys_exact_test(count: int, more: int) -> None:
    from scipy.stats import binomtest

    found = bounded(count, count + more)
    if count + more == 0:
        assert (found.low, found.high) == (0.0, 1.0)
        return
    low, high = (
        binomtest(count, count + more, alternative=side).proportion_ci(0.95, method="exact")
        for side in ("greater", "less")
    )
    assert found.low == pytest.approx(low.low, abs=1e-7)  # scipy finds the root by bisection
    assert found.high == pytest.approx(high.high, abs=1e-7)


def test_none_wrong_follows_the_rule_of_three() -> None:
    assert bounded(0, 6).high == pytest.approx(1.0 - 0.05 ** (1 / 6))
    for limit in (0.001, 0.005, 0.02, 0.5):
        parts = parts_without_wrong(limit)
        assert parts == math.ceil(math.log(0.05) / math.log(1 - limit))
        assert bounded(0, parts).high <= limit < bounded(0, parts - 1).high
    assert parts_without_wrong(0.001) == 2995
    with pytest.raises(ValueError, match="cannot be shown"):
        parts_without_wrong(0.0)


@settings(deadline=None)
@given(st.integers(0, 60), st.integers(1, 60))
def test_the_width_is_that_of_wilsons_interval(count: int, more: int) -> None:
    found = share(count, count + more)
    low, high = found.low, found.high
    if count > 0:  # else scipy cuts the interval at 0
        assert half_width(count + more, found.value) == pytest.approx((high - low) / 2, abs=1e-12)


@settings(deadline=None)
@given(st.floats(0.005, 0.4), st.floats(0.0, 1.0))
def test_the_parts_needed_are_the_fewest(wanted: float, value: float) -> None:
    parts = parts_needed(wanted, value)
    assert half_width(parts, value) <= wanted
    assert parts == 1 or half_width(parts - 1, value) > wanted


def test_half_of_the_parts_right_takes_the_textbooks_number() -> None:
    """Wald's z^2/4w^2 less z^2, which Wilson's interval is narrower by at one half."""
    z2 = 1.959963984540054**2
    assert parts_needed(0.02, 0.5) == math.ceil(z2 / (4 * 0.02**2) - z2)


def test_before_a_run_one_line_tells_how_sure_the_cells_will_be() -> None:
    items = [
        Item(f"p{k}", k, Condition(soil=("rust", "paint")[k % 2], severity=0.3, font="gothic", format=""))
        for k in range(13)
    ]
    said = foresight(items, ("soil", "severity"))
    assert said.startswith("2 cells of 6 parts: serials ±31% at worst")
    assert "±2% takes 2,398" in said
    assert len(said) <= 80
