"""Correlations by their formula, and the best chain against trying everything."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.glyph_match.chain import Placed, Spacing, best_chain
from recognition.glyph_match.correlation import correlate, steps_of

# ------------------------------------------------------------------------------------------------------------- chain

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
        earned += p.reward - cost
        end = p.column + int(half[p.template])
    assert earned == pytest.approx(total, abs=1e-9)


@settings(deadline=None, max_examples=25)
@given(cases())
def test_a_free_chain_earns_what_the_best_of_all_earns(case: Case) -> None:
    reward, half, rules = case
    total, placed = best_chain(reward, half, allowed=None, **rules)
    assert total == pytest.approx(exhaustive(case, None), abs=1e-9)
    assert all(p.reward > 0.0 for p in placed)
    check_chain(case, placed, total)


@settings(deadline=None, max_examples=25)
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


# ----------------------------------------------------------------------------------------------------- spacing


@st.composite
def spacings(draw: st.DrawFn, n_templates: int) -> Spacing:
    halves = st.integers(0, 6).map(lambda n: n / 2)
    rows = st.lists(halves, min_size=n_templates, max_size=n_templates)
    return Spacing(
        before=np.array(draw(rows)),
        after=np.array(draw(rows)),
        cost=draw(st.sampled_from([0.0, 0.25, 1.0])),
        limit=draw(st.sampled_from([0.0, 0.5, 3.0])),
        free_after=draw(st.frozensets(st.integers(0, 2), max_size=2)),
    )


def step_cost(k: int, left: tuple[int, int], right: tuple[int, int], spacing: Spacing) -> float:
    """What the distance between (template, column) at place k - 1 and at place k costs."""
    if k - 1 in spacing.free_after:
        return 0.0
    usual = spacing.after[left[0]] + spacing.before[right[0]]
    return float(min(spacing.cost * (right[1] - left[1] - usual) ** 2, spacing.limit))


def earned_by(chain: list[tuple[int, int]], case: Case, spacing: Spacing) -> float | None:
    """What (template, column) after (template, column) earn; None where they may not stand so."""
    reward, half, rules = case
    total = 0.0
    for k, (t, c) in enumerate(chain):
        total += float(reward[t, c])
        if k:
            last = chain[k - 1]
            land = gap_cost(int(last[1] + half[last[0]]), int(c - half[t]), rules)
            if land is None:
                return None
            total -= land + step_cost(k, last, (t, c), spacing)
    return total


@settings(deadline=None, max_examples=25)
@given(cases(), st.data())
def test_pairs_spaced_as_usual_earn_what_the_best_pair_earns(case: Case, data: st.DataObject) -> None:
    # two places: of chains that end alike only the best is followed up, which is all of them for a pair's sake
    reward, half, rules = case
    spacing = data.draw(spacings(len(half)))
    allowed = np.ones((2, len(half)), dtype=np.bool_)
    total, placed = best_chain(reward, half, allowed=allowed, spacing=spacing, **rules)
    stands = [(t, c) for t in range(len(half)) for c in range(half[t], reward.shape[1] - half[t])]
    one_end: dict[int, tuple[int, int]] = {}
    for t, c in stands:
        end = int(c + half[t])
        # of characters with a common end, the one that earns more, the first of equals
        if end not in one_end or reward[t, c] > reward[one_end[end][0], one_end[end][1]]:
            one_end[end] = (t, c)
    pairs = [earned_by([a, b], case, spacing) for a in one_end.values() for b in stands]
    possible = [v for v in pairs if v is not None]
    if not possible:
        assert (total, placed) == (0.0, ())
        return
    assert total == pytest.approx(max(possible), abs=1e-9)
    assert earned_by([(p.template, p.column) for p in placed], case, spacing) == pytest.approx(
        total, abs=1e-9
    )


def even(apart: float) -> Spacing:
    return Spacing(np.zeros(1), np.full(1, apart), cost=0.1, limit=1.0, free_after=frozenset())


SPACED = {"overlap": 1, "reach": 30, "gap_free": 30, "gap_cost": 0.0}


def test_what_is_lost_is_put_where_the_others_say() -> None:
    reward = np.zeros((1, 60), dtype=np.float32)
    reward[0, [10, 20, 40, 50]] = 2.0
    # a grain of dirt beside the lost one
    reward[0, 25] = 0.2
    half, allowed = np.array([2]), np.ones((5, 1), dtype=np.bool_)
    _, astray = best_chain(reward, half, allowed=allowed, **SPACED)
    assert [p.column for p in astray] == [10, 20, 25, 40, 50]
    total, placed = best_chain(reward, half, allowed=allowed, spacing=even(10.0), **SPACED)
    assert [p.column for p in placed] == [10, 20, 30, 40, 50]
    assert total == pytest.approx(8.0)


def test_what_stands_out_stands_where_it_is() -> None:
    reward = np.zeros((1, 60), dtype=np.float32)
    reward[0, [10, 20, 35, 45]] = 2.0
    # being off costs the limit at most, less than a character earns
    total, placed = best_chain(
        reward, np.array([2]), allowed=np.ones((4, 1), dtype=np.bool_), spacing=even(10.0), **SPACED
    )
    assert [p.column for p in placed] == [10, 20, 35, 45]
    assert total == pytest.approx(8.0 - 1.0)


# ------------------------------------------------------------------------------------------------------- correlation


def by_formula(image: np.ndarray, template: np.ndarray, *, least_felt: float) -> np.ndarray:
    rows, columns, _ = template.shape
    about = template - template.mean(axis=(0, 1))
    size = (about**2).sum()
    correlations = np.empty((image.shape[0] - rows + 1, image.shape[1] - columns + 1))
    for i, j in np.ndindex(*correlations.shape):
        window = image[i : i + rows, j : j + columns]
        window = window - window.mean(axis=(0, 1))
        correlations[i, j] = (about * window).sum() / np.sqrt(
            size * ((window**2).sum() + least_felt**2 * size)
        )
    return correlations


def test_correlations_are_those_of_the_formula() -> None:
    rng = np.random.default_rng(3)
    image = rng.normal(size=(14, 20, 4)).astype(np.float32)
    templates = rng.normal(size=(3, 7, 5, 4)).astype(np.float32)
    correlations = correlate(image, list(templates), least_felt=0.2)
    assert correlations.shape == (3, 8, 16)
    for one, template in zip(correlations, templates, strict=True):
        assert one == pytest.approx(by_formula(image, template, least_felt=0.2), abs=1e-4)


def test_steps_believe_in_the_character_whose_template_fits_and_in_nothing_where_none_does() -> None:
    cells = np.array([[0.95, 0.6, 0.5], [0.6, 0.93, 0.9], [0.1, 0.05, 0.0]])
    steps = steps_of(cells, "ABC", np.array([20.0, 45.0, 70.0]), chars="ABCD")
    places = np.exp(steps.log_chars[1::2])
    assert places[0, 0] > 0.99
    assert places[1, 1] > places[1, 2] > 0.001
    assert np.exp(steps.log_blank[[0, 2, 4, 5, 6]]) == pytest.approx(1.0, abs=0.01)
    assert steps.columns[1::2].tolist() == [20.0, 45.0, 70.0]
    assert int(steps.count().argmax()) == 2
