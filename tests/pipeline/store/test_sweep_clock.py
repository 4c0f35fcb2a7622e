"""The clock that sweeps go by: a leap ahead deletes nothing."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

from pipeline.store.evidence_folder import SweepClock

DAY_S = 86_400.0
NOW_S = 2e9


class Times:
    """A clock and the monotonic one beside it."""

    def __init__(self) -> None:
        self.wall_s, self.monotonic_s = NOW_S, 50.0

    def passes(self, seconds: float) -> None:
        self.wall_s += seconds
        self.monotonic_s += seconds


@pytest.fixture
def times() -> Times:
    return Times()


def clock(folder: Path, times: Times) -> SweepClock:
    """The clock of a service that starts now."""
    return SweepClock(folder / "swept", wall_s=lambda: times.wall_s, monotonic_s=lambda: times.monotonic_s)


def test_sweeps_go_on_by_the_hour_and_after_a_month_at_rest(tmp_path: Path, times: Times) -> None:
    sweeps = clock(tmp_path, times)
    for _ in range(3):
        assert sweeps.may_sweep(None)
        times.passes(3600.0)
    times.passes(30 * DAY_S)
    assert clock(tmp_path, times).may_sweep(None)


@pytest.mark.parametrize("swept_before", [True, False])
def test_a_clock_ten_years_ahead_sweeps_nothing_until_it_is_set(
    tmp_path: Path, times: Times, swept_before: bool
) -> None:
    newest = datetime.fromtimestamp(NOW_S, UTC)
    if swept_before:
        assert clock(tmp_path, times).may_sweep(newest)
    times.wall_s += 3650 * DAY_S
    sweeps = clock(tmp_path, times)
    assert not sweeps.may_sweep(newest)
    assert sweeps.trouble == "nothing is deleted: by the clock the last sweep was 3,650 days ago"
    times.passes(3600.0)
    # parts that come meanwhile bear the wrong time, and prove nothing
    assert not sweeps.may_sweep(datetime.fromtimestamp(times.wall_s, UTC))
    times.wall_s -= 3650 * DAY_S
    times.passes(3600.0)
    assert not sweeps.may_sweep(newest)  # it has leapt again
    times.passes(3600.0)
    assert sweeps.may_sweep(newest)
    assert sweeps.trouble == ""


def test_a_person_may_say_that_the_clock_is_right(tmp_path: Path, times: Times) -> None:
    sweeps = clock(tmp_path, times)
    assert sweeps.may_sweep(None)
    times.passes(100 * DAY_S)
    assert not sweeps.may_sweep(None)
    sweeps.file.touch()
    os.utime(sweeps.file, (times.wall_s, times.wall_s))
    assert sweeps.may_sweep(None)


def test_a_leap_of_hours_spares_files_in_the_making_once(tmp_path: Path, times: Times) -> None:
    sweeps = clock(tmp_path, times)
    assert sweeps.may_sweep(None)
    times.wall_s += 2 * 3600.0
    times.passes(3600.0)
    assert not sweeps.may_sweep(None)
    assert "leapt by 7,200 s" in sweeps.trouble
    times.passes(3600.0)
    assert sweeps.may_sweep(None)
