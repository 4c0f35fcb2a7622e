"""Exact bounds against scipy and the formulas, and the widths of intervals before a run."""

import pytest

from pipeline.benchmark.analysis.shares import exact_share
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.trials.planning import foresight


def test_none_wrong_follows_the_rule_of_three() -> None:
    assert exact_share(0, 6).high == pytest.approx(1.0 - 0.05 ** (1 / 6))


def test_before_a_run_one_line_tells_how_sure_the_cells_will_be() -> None:
    items = [
        Item(f"p{k}", k, Condition(soil=("rust", "paint")[k % 2], severity=0.3, font="gothic", format=""))
        for k in range(13)
    ]
    said = foresight(items, ("soil", "severity"))
    assert said.startswith("2 cells, the smallest of 6 parts; its serials right to ±31% at worst")
    assert len(said) <= 100
