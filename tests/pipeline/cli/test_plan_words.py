"""A raster plan in words."""

from __future__ import annotations

from dataclasses import replace

from pipeline.cli.whisker import describe_plan
from whisker_array.whisker.array import default_plan


def test_plan_in_words() -> None:
    plan = default_plan((0.0, 0.0, 40.0, 10.0), character_height_mm=5.0, n_whiskers=4)
    for word in (
        "40.0 x 10.0 mm",
        "4 whiskers 5.00 mm apart (rows: 1)",
        "0°/90°/180°/270°",
        f"{plan.n_samples:,} samples",
    ):
        assert word in describe_plan(plan)
    assert "and back" not in describe_plan(plan)
    assert "and back" in describe_plan(replace(plan, two_way=True))
    kinds = default_plan((0.0, 0.0, 40.0, 10.0), character_height_mm=5.0, n_whiskers=4, kinds=2)
    assert "8 whiskers 5.00 mm apart (rows: 2)" in describe_plan(kinds)
