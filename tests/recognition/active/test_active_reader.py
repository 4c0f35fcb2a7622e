"""Parts that are felt pass by pass: when it stops, what is kept, and what it costs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from recognition.active.active_reader import ActiveReader, ActiveSettings, region_around
from recognition.active.active_reading import ActiveReading, StopReason
from recognition.active.moves import Way
from recognition.active.policy import Ladder
from recognition.active.watch import LineWatch
from recognition.decide.decision import Decision, ReadingFlag
from recognition.reader import Reader
from recognition.see.levelling import level
from recognition.see.text_line import TextLine
from recognition.touch import TactileReader
from tests.support.scans import Jamming
from whisker_array.scan.simulated_session import SimulatedSession
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.passes import Pass
from whisker_array.whisker.touch import default_touch

HEIGHT_MM = 5.0
TEXT = "K407"


@cache
def reader() -> TactileReader:
    return Reader(format="A999").touch


def mounted(surface: HeightMap, session: type[SimulatedSession] = SimulatedSession) -> SimulatedSession:
    return session(
        level(surface),
        touch=default_touch(HEIGHT_MM),
        array=WhiskerArray(8, 0.5 * HEIGHT_MM),
        height_mm=HEIGHT_MM,
        sample_pitch_mm=HEIGHT_MM / 80.0,
    )


@cache
def part() -> HeightMap:
    return stamp(TEXT, fonts="gothic", height_mm=HEIGHT_MM, seed=3).height_map


@cache
def read() -> ActiveReading:
    return ActiveReader(reader()).read(mounted(part()))


def test_a_clean_part_is_sure_in_a_tenth_of_the_plans_time() -> None:
    active = read()
    assert (active.reading.text, active.stop, active.passes[-1].text) == (TEXT, StopReason.SURE, TEXT)
    assert active.reading.decision is Decision.ACCEPT
    whole = default_plan((0.0, 0.0, *part().size_mm), character_height_mm=HEIGHT_MM)
    assert active.stage_s < 0.1 * whole.scan_time_s
    assert active.stage_s == pytest.approx(sum(p.order.stage_s for p in active.passes))
    assert sum(s.plan.line_mm.shape[0] for s in active.scan.sweeps) == len(active.passes)


def test_the_budget_ends_it() -> None:
    active = ActiveReader(reader(), ActiveSettings(budget_s=0.5)).read(mounted(part()))
    # the first step is always felt: nothing is known without
    assert active.stage_s > 0.5
    ladder = Ladder(((Way.ALONG, 16), (Way.BACK, 16)))
    settings = ActiveSettings(budget_s=9.0, policy=ladder, until_sure=False)
    active = ActiveReader(reader(), settings).read(mounted(part()))
    assert active.stop is StopReason.BUDGET
    assert active.stage_s <= 9.0


@pytest.mark.parametrize("at", [0, 6])
def test_what_was_felt_before_the_stage_failed_is_kept(at: int) -> None:
    settings = ActiveSettings(policy=Ladder(((Way.ALONG, 16),)), until_sure=False)
    active = ActiveReader(reader(), settings).read(Jamming(mounted(part()), at))
    assert active.stop is StopReason.STAGE_FAILED
    assert len(active.passes) == at
    assert "the array has jammed" in active.problem
    assert active.reading.decision is not Decision.ACCEPT
    assert (active.scan is None) == (at == 0)
    if at == 6:
        assert active.reading.text == TEXT
        assert any("the stage failed" in message for message in active.reading.messages())


def test_land_is_given_up_soon() -> None:
    rng = np.random.default_rng(1)
    land = HeightMap((0.002 * rng.standard_normal((200, 500))).astype(np.float32), 0.1)
    active = ActiveReader(reader()).read(mounted(land))
    assert active.stop in (StopReason.NO_GAIN, StopReason.NOTHING_FOUND)
    assert active.reading.decision is not Decision.ACCEPT
    assert active.stage_s < 15.0  # nine passes of some 1.5 s


def test_a_line_that_runs_down_has_the_land_of_a_level_one() -> None:
    level = region_around(
        TextLine.straight(20.0, 20.0, length_mm=20.0, height_mm=HEIGHT_MM), (0.0, 0.0, 60.0, 60.0)
    )
    centre = np.array([[20.0, 20.0], [20.0, 40.0]])
    down = region_around(TextLine(centre, HEIGHT_MM), (0.0, 0.0, 60.0, 60.0))
    assert down == pytest.approx((level[1], level[0], level[3], level[2]))


def test_a_known_line_is_felt_and_nothing_else() -> None:
    line = TextLine.straight(6.0, 8.0, length_mm=20.0, height_mm=HEIGHT_MM)
    field = (0.0, 0.0, 60.0, 25.0)
    x0, y0, x1, y1 = region_around(line, field)
    assert (x0, x1) == pytest.approx((2.0, 30.0))
    assert (y0, y1) == pytest.approx((3.0, 13.0))
    assert region_around(line, (5.0, 4.0, 20.0, 12.0)) == (5.0, 4.0, 20.0, 12.0)
    active = ActiveReader(reader()).read(mounted(part()), region_mm=(4.0, 2.0, 20.0, 12.0))
    for felt in active.passes:
        first, last = (4.0, 20.0) if felt.order.direction.along_x else (2.0, 12.0)
        assert felt.order.along_mm[0] >= first - 0.1
        assert felt.order.along_mm[1] <= last + 0.1


def test_what_no_look_sees_is_read_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LineWatch, "look", lambda *_: None)
    active = ActiveReader(reader()).read(mounted(part()))
    assert (active.reading.text, active.stop) == (TEXT, StopReason.SURE)
    assert active.reading.decision is Decision.ACCEPT


class WithDeadWhisker(SimulatedSession):
    """One whisker's wire is broken."""

    def feel(self, order: Pass) -> Sweep:
        sweep = super().feel(order)
        moment = sweep.moment_n_mm.copy()
        moment[:, 2] = 0.0
        return replace(sweep, moment_n_mm=moment)


def test_a_whisker_that_is_dead_is_named() -> None:
    # with it the text is not sure within the budget, and every pass of it is felt
    active = ActiveReader(reader(), ActiveSettings(budget_s=5.0)).read(mounted(part(), WithDeadWhisker))
    assert ReadingFlag.WHISKER_FAULTY in active.reading.flags
    assert any("whisker 2, dead whisker" in message for message in active.reading.messages())
    assert active.reading.text == TEXT or active.reading.decision is not Decision.ACCEPT
