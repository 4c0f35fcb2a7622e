"""Steps of touch: where their lines lie, what they cost, which is chosen and when none is."""

from __future__ import annotations

from itertools import pairwise
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.active.active_reader import region_around
from recognition.active.active_reading import StopReason
from recognition.active.gain import Gain, WayGain, sureness
from recognition.active.moves import FIRST, JOINED, MOST, Step, Way, between, next_step
from recognition.active.policy import Drawn, Greedy, Ladder, Progress
from recognition.see.text_line import TextLine
from whisker_array.scan.session import Fitting
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.touch import default_touch

FIELD = (0.0, 0.0, 60.0, 25.0)
FITTING = Fitting(default_touch(5.0), WhiskerArray(8, 2.5), 5.0, FIELD)


def gain(*, cross: float = -2.0, along: float = -2.0) -> Gain:
    ways = {
        Way.ALONG: WayGain(along, 0.0, 0.0),
        Way.BACK: WayGain(along, 0.0, 0.0),
        Way.CROSS: WayGain(cross, 0.0, 0.0),
        Way.CROSS_BACK: WayGain(along, 0.0, 0.0),
    }
    return Gain(ways, sure=3.0, surer=2.0, looks=-1.0)


def felt(*, confidences: tuple[float, ...]) -> Progress:
    return Progress(
        FITTING,
        MappingProxyType({Way.ALONG: FIRST + len(confidences) - 1}),
        stage_s=5.0,
        confidences=confidences,
        steps=tuple((Way.ALONG, FIRST + k) for k in range(len(confidences))),
    )


@given(n=st.sampled_from([2, 4, 8, 16, 32]))
def test_lines_between_fill_a_pitch_evenly(n: int) -> None:
    assert sorted(between(k) for k in range(n)) == [k / n for k in range(n)]


@pytest.mark.parametrize("way", list(Way))
def test_steps_lay_lines_between_those_felt(way: Way) -> None:
    region, lines, laid = (5.0, 8.0, 50.0, 15.0), 0, []
    while (step := next_step(FITTING, region, way, lines)) is not None:
        assert step.lines == (FIRST if lines == 0 else lines + 1)
        laid += [v for p in step.passes for v in p.line_mm]
        lines = step.lines
    assert lines == MOST
    assert len(set(np.round(laid, 6))) == len(laid)
    low, high = (region[1], region[3]) if way.direction.along_x else (region[0], region[2])
    within = sorted(v for v in laid if low <= v <= high)
    assert max(b - a for a, b in pairwise(within)) == pytest.approx(2.5 / MOST)


def test_regions_of_a_field_share_their_lines_and_samples() -> None:
    wide, narrow = (next_step(FITTING, region, Way.ALONG, 0) for region in (FIELD, (12.3, 9.1, 31.7, 14.9)))
    assert narrow.stage_s < wide.stage_s
    lines = {round(v, 6) for p in wide.passes for v in p.line_mm}
    shared = {round(v, 6) for p in narrow.passes for v in p.line_mm if 9.1 <= v <= 14.9}
    assert shared <= lines
    step = narrow.passes[0].sample_pitch_mm
    assert narrow.passes[0].along_mm[0] / step == pytest.approx(round(narrow.passes[0].along_mm[0] / step))


@given(
    begins=st.floats(0.0, 20.0), length=st.floats(6.0, 38.0), way=st.sampled_from([Way.CROSS, Way.CROSS_BACK])
)
def test_the_lines_of_a_step_cover_a_line_to_both_its_ends(begins: float, length: float, way: Way) -> None:
    text = TextLine.straight(begins, 12.0, length_mm=length, height_mm=5.0)
    step = next_step(FITTING, region_around(text, FIELD), way, 0)
    laid = sorted(v for p in step.passes for v in p.line_mm if 0.0 <= v <= 60.0)
    # a line of the first step is an eighth of a height from the next
    assert laid[0] <= max(begins, 0.0) + 0.625
    assert laid[-1] >= min(begins + length, 60.0) - 0.625
    within = [v for v in laid if begins - 0.7 <= v <= begins + length + 0.7]
    assert max(b - a for a, b in pairwise(within)) <= 0.625 + 1e-9


def test_a_ladder_goes_up_rung_by_rung_and_ends() -> None:
    ladder, progress, ways = Ladder(((Way.ALONG, 5), (Way.BACK, 4))), Progress(FITTING), []
    while isinstance(step := ladder.choose(progress, FIELD, left_s=1e9), Step):
        ways.append((step.way, step.lines))
        progress = progress.after(step, None)
    assert step is StopReason.ALL_FELT
    joined = [(Way.BACK, JOINED + k) for k in range(4 - JOINED + 1)]
    assert ways == [(Way.ALONG, FIRST), (Way.ALONG, 5), *joined]
    assert [(way, lines) for way, lines, _ in progress.history] == ways
    assert ladder.choose(felt(confidences=(0.0,)), FIELD, left_s=0.1) is StopReason.BUDGET


def test_a_reading_that_is_surer_than_the_look_counts() -> None:
    looked = felt(confidences=(0.01, 0.3))
    assert looked.with_confidence(0.8).confidences == (0.01, 0.8)
    assert looked.with_confidence(0.1).confidences == looked.confidences


def test_drawn_steps_are_the_same_for_a_seed() -> None:
    def ways(seed: int) -> list[Way]:
        progress, found = Progress(FITTING), []
        for _ in range(12):
            step = Drawn(seed).choose(progress, FIELD, left_s=1e9)
            found.append(step.way)
            progress = progress.after(step, None)
        return found

    assert ways(1) == ways(1) != ways(2)
    # all begin as the greedy one does
    begun = Greedy(gain()).choose(Progress(FITTING), FIELD, left_s=1e9)
    assert ways(1)[0] == ways(2)[0] == begun.way


def test_the_step_that_brings_most_for_its_time_is_chosen() -> None:
    doubtful = felt(confidences=(0.01, 0.3))
    along = Greedy(gain(cross=-6.0), worth_s=1e6).choose(doubtful, FIELD, left_s=1e9)
    across = Greedy(gain(cross=1.0, along=-8.0), worth_s=1e6).choose(doubtful, FIELD, left_s=1e9)
    assert (along.way, across.way) == (Way.ALONG, Way.CROSS)
    # the first step of another way is several travels, and too dear for what is left
    short = Greedy(gain(cross=1.0, along=-8.0), worth_s=1e6).choose(
        doubtful, FIELD, left_s=along.stage_s + 0.1
    )
    assert short.way is Way.ALONG


def test_no_step_is_taken_that_is_not_worth_it() -> None:
    vain = felt(confidences=(0.0001,) * 8)
    assert Greedy(gain(), worth_s=10.0).choose(vain, FIELD, left_s=1e9) is StopReason.NO_GAIN
    assert isinstance(Greedy(gain(), worth_s=1e6).choose(vain, FIELD, left_s=1e9), Step)
    with pytest.raises(ValueError, match="worth_s"):
        Greedy(gain(), worth_s=0.0)


def test_sureness_is_that_of_the_surest_of_the_last_looks() -> None:
    assert sureness((1.0, 0.01, 0.01, 0.01)) == pytest.approx(0.5)
    assert sureness((0.0,)) == 0.0
    assert sureness((0.2, 1.0)) == 1.0
