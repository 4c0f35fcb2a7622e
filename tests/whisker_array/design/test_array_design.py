"""The array designer: what it builds can stand, its times are the plan's own, and no other combination is quicker."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.cli.design_report import print_arrays
from whisker_array.design.array_design import ArrayRequest, design_arrays
from whisker_array.design.limits import DesignError
from whisker_array.design.plan_accuracy import PlanCounts
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.comb import WhiskerArray, collisions, default_body, least_rows, least_stagger_mm

REQUEST = ArrayRequest(5.0, accuracy=0.95)


def counts(lines: int, directions: tuple[int, ...], right: int) -> PlanCounts:
    return PlanCounts(lines, directions, 0.3, 10, 100, right, 8, 0)


KNOWN = (
    counts(10, (0,), 90),
    counts(20, (0,), 96),
    counts(20, (90,), 96),
    counts(40, (0, 90, 180, 270), 99),
)


@pytest.fixture(scope="module")
def chosen() -> tuple:
    return design_arrays(REQUEST, sizes=(2, 8, 24), counts=KNOWN)


def test_combs_can_be_built_and_times_are_the_plans(chosen: tuple) -> None:
    for choice in chosen:
        array = choice.plan.array
        assert array.body is not None
        assert not collisions(array.body, array)
        assert choice.stage_s == pytest.approx(sum(p.stage_s for p in choice.plan.passes()))
        assert choice.measured.accuracy >= REQUEST.accuracy
        assert choice.plan.region_mm == REQUEST.region_mm


def test_more_whiskers_are_quicker(chosen: tuple) -> None:
    seconds = [c.stage_s for c in chosen]
    assert seconds == sorted(seconds, reverse=True)


def test_no_comb_of_default_whiskers_is_quicker(chosen: tuple) -> None:
    """Eight default whiskers at many pitches, by the measured plan of least lines, at the same speed."""
    best = chosen[1]
    body = default_body(5.0)
    for directions in ((0,), (90,)):
        usual = default_plan(
            REQUEST.region_mm,
            character_height_mm=5.0,
            n_whiskers=1,
            directions=tuple(type(best.plan.directions[0])(d) for d in directions),
            speed_mm_s=best.plan.speed_mm_s,
            lines_per_height=20,
        )
        for lines in (5, 10, 20, 40):
            pitch = lines * usual.line_pitch_mm
            rows = least_rows(body, pitch_mm=pitch, n_whiskers=8)
            stagger = least_stagger_mm(body, WhiskerArray(8, pitch, rows=rows), step_mm=1.0)
            array = WhiskerArray(8, pitch, rows=rows, stagger_mm=stagger, body=body)
            assert replace(usual, array=array).scan_time_s >= best.stage_s


def test_words_fit_a_terminal_and_say_what_was_measured(
    chosen: tuple, capsys: pytest.CaptureFixture[str]
) -> None:
    print_arrays(REQUEST, chosen)
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines())) <= 80
    assert f"{chosen[-1].stage_s:.1f} s a serial" in told
    assert "on 10 parts" in told
    assert "96.0 %" in told


def test_refusals() -> None:
    with pytest.raises(DesignError, match=r"no measured plan reads 99\.9 %.*40 lines"):
        design_arrays(replace(REQUEST, accuracy=0.999), counts=KNOWN)
    with pytest.raises(DesignError, match=r"no plan was measured at dirt 0\.9; plans were measured at 0\.3"):
        design_arrays(replace(REQUEST, severity=0.9), counts=KNOWN)
    for change in (
        {"accuracy": 1.0},
        {"character_height_mm": -1.0},
        {"length_mm": 0.0},
        {"speed_error": 0.0},
    ):
        with pytest.raises(DesignError):
            replace(REQUEST, **change)
