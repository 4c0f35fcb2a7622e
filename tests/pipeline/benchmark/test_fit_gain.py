"""The command that fits what a step of touch brings."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.active.gain import Gain, WayGain
from recognition.active.moves import Way
from tests.benchmarks.fit_gain import Tried, fit_gain, loss_nats


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
    found = fit_gain(tried)
    # no fit may be worse than the truth on its own steps
    assert loss_nats(found, tried) <= loss_nats(true, tried) + 0.001
    probe = ((Way.CROSS, {Way.ALONG: 8}, (0.3, 0.4)), (Way.ALONG, {Way.ALONG: 8}, (0.02,) * 4))
    for case in probe:
        assert found.chance(*case) == pytest.approx(true.chance(*case), abs=0.08)
    with pytest.raises(ValueError, match="some made the serial sure"):
        fit_gain(tried[:0])
