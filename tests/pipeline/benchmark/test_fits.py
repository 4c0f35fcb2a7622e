"""Fits of the gain of a step of touch, and of the amounts of dirt to severities; the tables kept are those measured."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

from glyphs.soiling.severity import AMOUNTS, KNOTS, MANIFEST, amount_of
from glyphs.soiling.soils import SOILS
from recognition.active.gain import Gain, WayGain
from recognition.active.moves import Way
from tests.benchmarks.fit_gain import Tried, fit_gain, loss_nats
from tests.benchmarks.soil_severity import _short, fitted


def test_a_fit_finds_the_gain_that_made_its_steps() -> None:
    rng, tried = np.random.default_rng(4), []
    ways = {way: WayGain(-0.5 if way is Way.CROSS else -2.0, 0.0, 0.0) for way in Way}
    true = Gain(ways, sure=3.0, surer=2.0, looks=-1.0)
    for _ in range(2500):
        way = list(Way)[rng.integers(len(Way))]
        confidences = tuple(10.0 ** rng.uniform(-4.0, 0.0, size=rng.integers(1, 12)))
        lines = {Way.ALONG: int(rng.integers(4, 16))}
        sure = rng.random() < true.chance(way, lines, confidences)
        tried.append(Tried(way, lines, confidences, bool(sure)))
    gain = fit_gain(tried)
    # no fit may be worse than the truth on its own steps
    assert loss_nats(gain, tried) <= loss_nats(true, tried) + 0.001
    probe = ((Way.CROSS, {Way.ALONG: 8}, (0.3, 0.4)), (Way.ALONG, {Way.ALONG: 8}, (0.02,) * 4))
    for case in probe:
        assert gain.chance(*case) == pytest.approx(true.chance(*case), abs=0.08)
    with pytest.raises(ValueError, match="some made the serial sure"):
        fit_gain(tried[:0])


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
