"""How fast parts of an exam are made, photographed and felt: pytest -m benchmark.

One core, 8 characters of 5 mm, severity 0.6, memory kept as the exam's workers keep it. The target holds for the
quickest of some parts and for processor time: other work on the machine only adds.
"""

from __future__ import annotations

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tests.benchmarks.test_speed import ask, one_core

pytestmark = pytest.mark.benchmark

PART_S = 0.250
ROUNDS = 9


SLOWER = {
    "rust": "contact with what yields takes twice the time of bare contact",
    "mud": "contact with what yields takes twice the time of bare contact",
    "workshop": "its seven kinds draw some twenty random fields, and contact with what yields takes twice the time",
}
"""Soils for which the target is not reached yet on a machine that is busy, and why."""


@pytest.mark.parametrize(
    "soil",
    [
        "paint",
        "wear",
        "weld",
        *(pytest.param(s, marks=pytest.mark.xfail(reason=why, strict=False)) for s, why in SLOWER.items()),
    ],
)
def test_making_and_feeling_a_part_on_one_core(benchmark: BenchmarkFixture, soil: str) -> None:
    """Stamped, soiled, photographed, and scanned by contact in four directions."""
    answers: list[dict[str, float]] = []
    with one_core(f"exam_{soil}") as process:

        def make() -> None:
            words = (word.partition("=") for word in ask(process).split())
            answers.append({step: float(seconds) for step, _, seconds in words})

        benchmark.pedantic(make, rounds=ROUNDS, warmup_rounds=2)
    quickest = min(answers, key=lambda steps: sum(steps.values()))
    benchmark.extra_info["steps"] = quickest
    print(soil, quickest, round(sum(quickest.values()), 3))
    assert set(quickest) == {"make", "photo", "scan"}
    assert sum(quickest.values()) <= PART_S
