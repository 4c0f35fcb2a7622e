"""How amounts are fitted to severities, on made-up losses; and that the table kept is the one that was measured."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.soiling.severity import AMOUNTS, KNOTS, amount_of
from glyphs.soiling.soiled import WORKSHOP
from glyphs.soiling.soils import SOILS
from tests.benchmarks.soil_severity import (
    CHECK_SEED,
    GRID,
    MANIFEST,
    SEED,
    Curves,
    _short,
    fitted,
)


def _curve(losses: NDArray[np.float64]) -> NDArray[np.float64]:
    """(1, amounts, 2) those losses of one part; the wrong characters do not matter."""
    return np.stack([losses, np.full_like(losses, np.nan)], axis=-1)[None]


def _curves() -> Curves:
    """The workshop costs half its amount; `square` the square of it, `weak` at most 0.32, `twice` its amount."""
    knots, grid = np.array(KNOTS), np.array(GRID)
    return {
        WORKSHOP: _curve(0.5 * knots),
        "square": _curve(grid**2),
        "weak": _curve(0.32 * grid),
        "twice": _curve(grid),
    }


def test_amounts_are_the_exact_inverse_of_known_losses() -> None:
    table = fitted(_curves())
    assert set(table) == {"square", "weak", "twice"}
    # the losses are straight, so the inverse is exact but for the four decimals that are kept
    assert table["twice"] == pytest.approx(0.5 * np.array(KNOTS), abs=5e-5)
    # between grid points the square is a chord, which lies above it: by at most a quarter of 0.15 squared
    assert np.square(table["square"]) == pytest.approx(0.5 * np.array(KNOTS), abs=0.15**2 / 4 + 1e-4)


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
