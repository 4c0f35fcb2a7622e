"""How amounts are fitted to severities, on made-up losses; and that the table kept is the one that was measured."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.soiling.severity import AMOUNTS, KNOTS, amount_of
from glyphs.soiling.soiled import WORKSHOP
from glyphs.soiling.soils import SOILS
from tests.benchmarks import soil_severity
from tests.benchmarks.soil_severity import (
    CHECK_SEED,
    GRID,
    MANIFEST,
    SEED,
    Curves,
    _keep,
    _short,
    amount_with,
    fitted,
    rising,
)


def _curve(losses: NDArray[np.float64], *, parts: int = 1, noise: float = 0.0) -> NDArray[np.float64]:
    """(parts, amounts, 2): those losses and noise of mean 0 over the parts; the wrong characters are no matter."""
    off = np.random.default_rng(1).normal(0.0, noise, (parts, losses.size))
    off -= off.mean(axis=0)
    return np.stack([losses + off, np.full_like(off, np.nan)], axis=-1)


def _curves(*, parts: int = 1, noise: float = 0.0) -> Curves:
    """The workshop costs half its amount; `square` the square of it, `weak` at most 0.32, `twice` its amount."""
    knots, grid = np.array(KNOTS), np.array(GRID)
    return {
        WORKSHOP: _curve(0.5 * knots, parts=parts, noise=noise),
        "square": _curve(grid**2, parts=parts, noise=noise),
        "weak": _curve(0.32 * grid, parts=parts, noise=noise),
        "twice": _curve(grid, parts=parts, noise=noise),
    }


@pytest.mark.parametrize("amount", [0.0, 0.03, 0.2, 0.42, 0.99, 1.0])
def test_a_loss_is_traced_back_to_its_amount(amount: float) -> None:
    losses = np.exp(3.0 * np.array(GRID)) - 1.0
    target = float(np.interp(amount, GRID, losses))
    assert amount_with(target, GRID, losses) == pytest.approx(amount, abs=1e-12)


def test_a_loss_out_of_reach_has_the_largest_amount_and_one_below_all_the_least() -> None:
    losses = 0.1 + 0.3 * np.array(GRID)
    assert amount_with(0.41, GRID, losses) == 1.0
    assert amount_with(0.05, GRID, losses) == 0.0


def test_where_a_curve_is_level_the_least_amount_counts() -> None:
    losses = np.array([0.0, 0.1, 0.2, 0.2, 0.2, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert amount_with(0.2, GRID, losses) == GRID[2]


def test_a_noisy_curve_is_made_to_rise_and_a_rising_one_is_left() -> None:
    true = np.array(GRID) ** 2
    np.testing.assert_allclose(rising(GRID, true), true, atol=1e-12)
    rng = np.random.default_rng(3)
    for _ in range(20):
        noisy = true + rng.normal(0.0, 0.05, true.size)
        risen = rising(GRID, noisy)
        assert (np.diff(risen) >= 0.0).all()
        # pooling neighbours keeps the mean, and comes no further from any rising curve than the noisy one was
        assert risen.mean() == pytest.approx(noisy.mean(), abs=1e-12)
        assert np.linalg.norm(risen - true) <= np.linalg.norm(noisy - true) + 1e-12


def test_amounts_are_the_exact_inverse_of_known_losses() -> None:
    table = fitted(_curves())
    assert set(table) == {"square", "weak", "twice"}
    # the losses are straight, so the inverse is exact but for the four decimals that are kept
    assert table["twice"] == pytest.approx(0.5 * np.array(KNOTS), abs=5e-5)
    # between grid points the square is a chord, which lies above it: by at most a quarter of 0.15 squared
    assert np.square(table["square"]) == pytest.approx(0.5 * np.array(KNOTS), abs=0.15**2 / 4 + 1e-4)


def test_parts_that_differ_change_nothing_where_their_mean_does_not() -> None:
    noisy = fitted(_curves(parts=7, noise=0.2))
    for soil, amounts in fitted(_curves()).items():
        # float64 means of seven parts; what they leave is the fourth decimal, rounded either way
        assert noisy[soil] == pytest.approx(amounts, abs=1.01e-4)


def test_a_soil_that_cannot_cost_as_much_stops_at_one_and_is_reported() -> None:
    curves = _curves()
    weak = fitted(curves)["weak"]
    reach = [0.5 * knot < 0.32 for knot in KNOTS]
    assert [amount < 1.0 for amount in weak] == reach
    short = _short(curves)
    assert set(short) == {"weak"}
    assert short["weak"] == {
        f"{knot:g}": pytest.approx(0.5 * knot - 0.32)
        for knot, reached in zip(KNOTS, reach, strict=True)
        if not reached
    }


def test_a_table_is_kept_and_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = tmp_path / "severity.py"
    copy.write_text(soil_severity.TABLE.read_text("utf-8"), encoding="utf-8")
    monkeypatch.setattr(soil_severity, "TABLE", copy)
    table = fitted(_curves())
    _keep(table)
    found: dict[str, object] = {}
    exec(compile(copy.read_text("utf-8"), str(copy), "exec"), found)
    assert found["AMOUNTS"] == table
    assert found["KNOTS"] == KNOTS


def test_the_amounts_in_use_are_those_that_were_measured() -> None:
    manifest = json.loads(MANIFEST.read_text("utf-8"))
    assert {soil: list(amounts) for soil, amounts in AMOUNTS.items()} == manifest["amounts"]
    assert list(KNOTS) == manifest["knots"]
    assert manifest["soils"] == list(SOILS)
    assert manifest["seeds"] == {"fit": SEED, "check": CHECK_SEED}
    assert manifest["fit"].keys() == manifest["check"].keys() == set(SOILS)


def test_the_amounts_follow_from_the_losses_that_are_kept() -> None:
    """The losses are kept to four decimals, so a level stretch of a curve may shift an amount a little."""
    manifest = json.loads(MANIFEST.read_text("utf-8"))
    curves = {
        soil: np.stack([each["loss"], each["characters_wrong"]], axis=-1)[None]
        for soil, each in manifest["fit"].items()
    }
    for soil, amounts in fitted(curves).items():
        # 5e-5 of loss, on the least slope between two knots of the workshop: 0.0047 in 0.15 costs 0.002 of an amount
        assert amounts == pytest.approx(AMOUNTS[soil], abs=0.005), soil
    assert _short(curves).keys() == manifest["cannot_lose_as_much"].keys()


@pytest.mark.parametrize("soil", SOILS)
def test_severity_runs_from_nothing_upwards(soil: str) -> None:
    amounts = AMOUNTS.get(soil, KNOTS)
    assert len(amounts) == len(KNOTS)
    assert amounts[0] == 0.0 == amount_of(soil, 0.0)
    assert all(a < b for a, b in pairwise(amounts))
    assert amounts[-1] <= 1.0
    assert amount_of(soil, KNOTS[3]) == amounts[3]


def test_the_workshops_severity_is_its_amount() -> None:
    assert WORKSHOP not in AMOUNTS
    assert set(AMOUNTS) == set(SOILS) - {WORKSHOP}
    assert amount_of(WORKSHOP, 0.37) == pytest.approx(0.37)
