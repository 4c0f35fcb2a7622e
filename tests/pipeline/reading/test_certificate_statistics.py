"""Whether parts are like the certified ones."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.reading.certificate_statistics import LEAST_PARTS, KindOfParts, unlike
from recognition.decide.measures import roughness
from recognition.decide.score import Measure


def parts(n: int, seed: int, *, rough_um: float = 1.0) -> list[dict[Measure, float]]:
    rng = np.random.default_rng(seed)
    return [
        {
            Measure.CONFIDENCE: float(np.round(1.0 - 0.1 * rng.beta(1, 8), 6)),
            Measure.FINE: float(rough_um * rng.lognormal(0.0, 0.2)),
        }
        for _ in range(n)
    ]


def test_rougher_parts_are_unlike_and_it_says_in_what() -> None:
    kind = KindOfParts.of(parts(40, 1))
    (found,) = unlike(kind, parts(20, 2, rough_um=3.0))
    assert found.measure is Measure.FINE
    assert found.certified == pytest.approx(1.0, rel=0.15)
    assert found.now == pytest.approx(3.0, rel=0.2)
    assert "fine roughness" in str(found)


def test_too_few_parts_are_not_judged() -> None:
    kind = KindOfParts.of(parts(40, 1))
    assert not unlike(kind, parts(LEAST_PARTS - 1, 2, rough_um=9.0))
    assert not KindOfParts.of(parts(LEAST_PARTS - 1, 1)).values


def test_parts_of_the_same_kind_are_hardly_ever_called_unlike() -> None:
    # 300 tests at 1 in 10,000: one false alarm has a chance of 3 %, two of 0.04 %
    alarms = sum(bool(unlike(KindOfParts.of(parts(60, 2 * k)), parts(40, 2 * k + 1))) for k in range(300))
    assert alarms <= 1


def test_of_many_parts_quantiles_are_kept() -> None:
    kind = KindOfParts.of(parts(3000, 1), most_kept=200)
    assert {len(values) for values in kind.values.values()} == {200}
    assert not unlike(kind, parts(200, 2))
    assert unlike(kind, parts(200, 3, rough_um=1.3))


def test_values_that_are_no_summary_are_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        KindOfParts({Measure.FINE: (0.0, float("nan"))})
    with pytest.raises(ValueError, match="are not ascending"):
        KindOfParts({Measure.FINE: (1.0, 0.0)})


def test_roughness_is_that_of_the_land_and_not_of_the_marks() -> None:
    rng = np.random.default_rng(5)
    land = rng.normal(0.0, 2.0, (200, 300))
    tilted = land + np.arange(300) * 0.7
    tilted[80:120, ::30] -= 200.0
    # a median of 1e5 dependent values; grooves over 0.7 % of the samples add a little
    assert roughness(tilted, 2) == pytest.approx(2.0, rel=0.05)
    tilted[:, 250:] = np.nan
    assert roughness(tilted, 2) == pytest.approx(2.0, rel=0.05)
    assert np.isnan(roughness(np.zeros((2, 2)), 4))
