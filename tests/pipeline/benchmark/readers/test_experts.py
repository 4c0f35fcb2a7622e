"""Experts by themselves: what the format makes of each one's beliefs."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from pipeline.benchmark.analysis.statistics import statistics_of
from pipeline.benchmark.readers.modes import alone, experts_in
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from recognition.decision.decide import Decision
from recognition.decision.reading import Reading
from recognition.language.box import Box
from recognition.language.lattice import Lattice
from recognition.senses.settings import ReaderSettings
from tests.factories import designed_parts
from whisker_array.simulation.traces import Fidelity

FORMATTED = ReaderSettings(format="A9")
BOXES = (Box(0.0, 0.0, 1.0, 2.0), Box(1.0, 0.0, 2.0, 2.0))


def lattice(**belief: tuple[float, float]) -> Lattice:
    """Of two places: characters, and the belief in each at either."""
    with np.errstate(divide="ignore"):
        log = np.log(np.array([belief[char] for char in sorted(belief)]).T)
    return Lattice(tuple(char.strip("_") for char in sorted(belief)), log, boxes=BOXES)


def test_an_expert_alone_reads_what_the_format_makes_of_its_beliefs() -> None:
    own = lattice(B=(0.001, 0.0), Z=(0.997, 0.001), _2=(0.001, 0.998), _8=(0.001, 0.001))
    doubting = lattice(B=(0.3, 0.6), Z=(0.2, 0.0), _2=(0.0, 0.2), _8=(0.5, 0.2))
    whole = Reading((), 0.9, source="tactile", seconds={"scan": 2.0}).with_trace(
        by_expert=MappingProxyType({"network": own, "templates": doubting})
    )
    sure, unsure = alone(whole, "network", FORMATTED), alone(whole, "templates", FORMATTED)
    assert (sure.text, sure.decision, sure.source) == ("Z2", Decision.ACCEPT, "tactile")
    assert sure.seconds == {"scan": 2.0}
    assert unsure.text[0] == "B"  # it believed in an 8 there, which is no letter
    assert unsure.decision is Decision.REVIEW
    silent = alone(replace(whole, source="vision").with_trace(by_expert={}), "network", FORMATTED)
    assert (silent.text, silent.decision) == ("", Decision.REJECT)


def test_experts_belong_to_the_modes_that_they_have_a_say_in() -> None:
    assert experts_in(("vision", "rapidocr photo")) == ("vision network",)
    assert experts_in(("fused",)) == ("tactile network", "tactile templates", "vision network")
    assert experts_in(("tactile",)) == ("tactile network", "tactile templates")


APART = ("tactile", "tactile network", "tactile templates")


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> list[Trial]:
    """Of a clean part whose font, height and format are given."""
    reading = ReaderSettings(fidelity=Fidelity.POINTWISE)
    benchmark = Benchmark(designed_parts(severities=(0.0,)), APART, reading)
    return run_benchmark(benchmark, tmp_path_factory.mktemp("apart"))


def test_a_part_is_read_once_for_all_of_them(trials: list[Trial]) -> None:
    assert tuple(t.mode for t in trials) == APART
    assert not any(t.error for t in trials)
    whole, own, _ = trials
    assert whole.text == own.text == whole.truth
    assert own.scan_s == whole.scan_s > 0.0
    assert own.compute_s < 1.5 * whole.compute_s  # a second reading would double it
    compared = {(c.first.mode, c.second.mode) for c in statistics_of(trials).comparisons}
    assert compared == {("tactile", "tactile network"), ("tactile", "tactile templates")}


def test_templates_alone_read_a_clean_part_of_their_font(trials: list[Trial]) -> None:
    assert trials[2].text == trials[2].truth
