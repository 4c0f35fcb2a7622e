"""Names of parts."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from pipeline.common.part_id import is_part_id, new_part_id


def test_they_rise_and_are_unique_over_threads() -> None:
    with ThreadPoolExecutor(8) as pool:
        batches = list(pool.map(lambda _: [new_part_id() for _ in range(500)], range(8)))
    assert all(ids == sorted(ids) for ids in batches)
    assert len({i for ids in batches for i in ids}) == 4000
    assert all(is_part_id(i) for ids in batches for i in ids)


def test_they_begin_with_the_time() -> None:
    digits = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
    before_ms = time.time_ns() // 1_000_000
    shown = new_part_id()[:10]
    told_ms = sum(digits.index(c) * 32**k for k, c in enumerate(reversed(shown)))
    # another test may have made some within this millisecond, never in advance of the clock
    assert before_ms <= told_ms <= time.time_ns() // 1_000_000


def test_they_rise_though_the_clock_is_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    first = new_part_id()
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    second = new_part_id()
    assert second > first
    assert second[:10] == first[:10]


@pytest.mark.parametrize(
    "text",
    ["", "x", "0" * 25, "0" * 27, "8" + "0" * 25, "O" * 26, "../" + "0" * 23, "0" * 26 + "\n", "٠" * 26],
)
def test_what_is_no_name(text: str) -> None:
    assert not is_part_id(text)
