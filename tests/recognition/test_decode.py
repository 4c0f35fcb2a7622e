"""The best chain against one that tries everything."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.decode import Placed, best_chain

Case = tuple[np.ndarray, np.ndarray, dict[str, float]]


@st.composite
def cases(draw: st.DrawFn) -> Case:
    n_templates, cols = draw(st.integers(1, 3)), draw(st.integers(2, 11))
    # quarters: sums are exact in float32
    quarters = st.integers(-8, 16).map(lambda n: n / 4)
    row = st.lists(quarters, min_size=cols, max_size=cols)
    reward = draw(st.lists(row, min_size=n_templates, max_size=n_templates))
    half = draw(st.lists(st.integers(1, 2), min_size=n_templates, max_size=n_templates))
    rules = {
        "overlap": draw(st.integers(0, 2)),
        "reach": draw(st.integers(0, 6)),
        "gap_free": draw(st.integers(0, 3)),
        "gap_cost": draw(st.sampled_from([0.0, 0.25, 0.5])),
    }
    return np.array(reward, dtype=np.float32), np.array(half, dtype=np.int64), rules


def gap_cost(end: int, start: int, rules: dict[str, float]) -> float | None:
    """What the land between one ink's last column and the next one's first costs; None when it may not be."""
    gap = start - end
    if gap > rules["reach"] or gap <= -rules["overlap"]:
        return None
    return rules["gap_cost"] * max(0, gap - rules["gap_free"])


def exhaustive(case: Case, allowed: np.ndarray | None) -> float:
    """The most that any chain earns, from the right-hand side; minus infinity when there is none."""
    reward, half, rules = case
    cols = reward.shape[1]

    @cache
    def rest(k: int, end: int | None) -> float:
        """Most earned by what may follow k characters, the last of which ends at `end`."""
        if allowed is not None and k == len(allowed):
            return 0.0
        best = 0.0 if allowed is None else -np.inf
        for t in range(len(half)):
            for c in range(half[t], cols - half[t]):
                barred = reward[t, c] <= 0.0 if allowed is None else not allowed[k, t]
                cost = 0.0 if end is None else gap_cost(end, c - half[t], rules)
                if not barred and cost is not None:
                    best = max(best, float(reward[t, c]) - cost + rest(k + 1, int(c + half[t])))
        return best

    return rest(0, None)


def check_chain(case: Case, placed: tuple[Placed, ...], total: float) -> None:
    """The characters stand in the image, in order, as the rules have it, and earn the total."""
    reward, half, rules = case
    earned, end = 0.0, None
    for p in placed:
        start = p.column - int(half[p.template])
        assert start >= 0
        assert p.column + half[p.template] < reward.shape[1]
        assert p.reward == reward[p.template, p.column]
        cost = 0.0 if end is None else gap_cost(end, start, rules)
        assert cost is not None
        earned += p.reward - cost
        end = p.column + int(half[p.template])
    assert earned == pytest.approx(total, abs=1e-9)


@settings(deadline=None)
@given(cases())
def test_a_free_chain_earns_what_the_best_of_all_earns(case: Case) -> None:
    reward, half, rules = case
    total, placed = best_chain(reward, half, allowed=None, **rules)
    assert total == pytest.approx(exhaustive(case, None), abs=1e-9)
    assert all(p.reward > 0.0 for p in placed)
    check_chain(case, placed, total)


@settings(deadline=None)
@given(cases(), st.data())
def test_a_fixed_format_earns_what_the_best_of_all_earns(case: Case, data: st.DataObject) -> None:
    reward, half, rules = case
    places = data.draw(st.integers(1, 4))
    flat = data.draw(st.lists(st.booleans(), min_size=places * len(half), max_size=places * len(half)))
    allowed = np.array(flat, dtype=np.bool_).reshape(places, len(half))
    total, placed = best_chain(reward, half, allowed=allowed, **rules)
    expected = exhaustive(case, allowed)
    if expected == -np.inf:
        assert (total, placed) == (0.0, ())
        return
    assert total == pytest.approx(expected, abs=1e-9)
    assert len(placed) == places
    assert all(allowed[k, p.template] for k, p in enumerate(placed))
    check_chain(case, placed, total)


def test_many_modest_characters_beat_a_loud_stranger() -> None:
    # beyond reach of each other: no two characters earn more than the one at the left, eight do
    reward = np.full((1, 60), -0.5, dtype=np.float32)
    reward[0, 5] = 9.5
    reward[0, 30:60:4] = 1.5
    total, placed = best_chain(
        reward, np.array([1]), allowed=None, overlap=1, reach=5, gap_free=5, gap_cost=0.1
    )
    assert total == pytest.approx(12.0)
    assert [p.column for p in placed] == list(range(30, 60, 4))


def test_nothing_that_earns_is_no_chain() -> None:
    rules = {"overlap": 1, "reach": 5, "gap_free": 2, "gap_cost": 0.1}
    reward = np.full((2, 9), -1.0, dtype=np.float32)
    assert best_chain(reward, np.array([1, 2]), allowed=None, **rules) == (0.0, ())
    # a format has no room on a map narrower than its characters
    allowed = np.ones((4, 2), dtype=np.bool_)
    assert best_chain(reward[:, :5], np.array([1, 2]), allowed=allowed, **rules) == (0.0, ())


def test_a_format_takes_a_poor_character_where_it_must() -> None:
    reward = np.full((2, 12), -1.0, dtype=np.float32)
    reward[0, 2] = reward[1, 8] = 2.0
    rules = {"overlap": 1, "reach": 8, "gap_free": 8, "gap_cost": 0.0}
    only_first = np.array([[True, False], [True, False]])
    total, placed = best_chain(reward, np.array([1, 1]), allowed=only_first, **rules)
    assert total == pytest.approx(1.0)
    assert [p.template for p in placed] == [0, 0]
