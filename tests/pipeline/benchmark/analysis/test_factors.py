"""What levels cost, and what is accepted at a risk: by hand, and against parts drawn again one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.benchmark.analysis.acceptance import RiskAcceptance, acceptance_at_risks
from pipeline.benchmark.analysis.comparisons import between_givens, between_readers
from pipeline.benchmark.analysis.factors import FactorEffect, factor_effects
from pipeline.benchmark.analysis.groups import GIVEN_FACTOR, group_trials
from pipeline.benchmark.analysis.statistics import statistics_of
from pipeline.benchmark.trials.journal import Trial

MORE = {"font_given": True, "height_given": False, "format_given": True}
LESS = {**MORE, "font_given": False}


def trial(part: int, right: int, **levels: object) -> Trial:
    """`right` of four characters."""
    text = "AAAA"[:right] + "XXXX"[right:]
    mode = str(levels.pop("mode", "tactile"))
    return Trial(f"p{part}", part, levels, mode, "AAAA", text, "review", 0.5)  # type: ignore[arg-type]


def effect(trials: list[Trial], factor: str) -> FactorEffect:
    return next(e for e in factor_effects(trials) if e.factor == factor)


def test_a_level_is_set_against_the_mean_of_the_others_whatever_their_sizes() -> None:
    trials = [
        trial(0, 4, soil="a"),
        trial(1, 4, soil="a"),
        trial(2, 4, soil="a"),
        trial(3, 2, soil="b"),
        trial(4, 1, soil="c"),
    ]
    soil = effect(trials, "soil")
    assert [e.level for e in soil.levels] == ["c", "b", "a"]
    assert [e.difference.value for e in soil.levels] == pytest.approx([0.25 - 0.75, 0.5 - 0.625, 1.0 - 0.375])
    assert [e.parts for e in soil.levels] == [1, 1, 3]
    assert soil.spread == 0.75
    assert {e.difference.low for e in soil.levels} == {None}


def test_a_part_read_twice_is_one_cluster() -> None:
    """Each reading given twice over: the interval is that of the parts, not of twice as many."""
    rng = np.random.default_rng(3)
    once = [trial(k, int(rng.integers(0, 5)), soil="ab"[k % 2], **LESS) for k in range(60)]
    twice = [*once, *(Trial(**{**vars(t), "levels": {**t.levels, **MORE}}) for t in once)]
    single, double = effect(once, "soil"), effect(twice, "soil")
    for a, b in zip(single.levels, double.levels, strict=True):
        assert (a.difference.low, a.difference.high) == pytest.approx((b.difference.low, b.difference.high))
        assert a.parts == b.parts == 30


def test_the_interval_is_that_of_two_means_apart() -> None:
    """1.96 standard errors of a difference of means, which 200 parts a level obey."""
    rng = np.random.default_rng(4)
    right = rng.integers(0, 5, size=400)
    soil = effect([trial(k, int(r), soil="ab"[k % 2]) for k, r in enumerate(right)], "soil")
    error = np.sqrt(sum(np.var(right[k::2] / 4, ddof=1) / 200 for k in (0, 1)))
    width = soil.levels[0].difference.high - soil.levels[0].difference.low
    assert width / 2 == pytest.approx(1.96 * error, rel=0.08)  # 2000 draws: quantiles to some 4 %


def test_a_factor_matters_at_equal_dirt_or_not() -> None:
    """Dirt takes half of the characters; a font one in four at each severity, the light nothing."""
    rng = np.random.default_rng(5)
    trials = [
        trial(
            k, int(rng.binomial(4, (0.9, 0.45)[k % 2] - 0.25 * (k // 2 % 2))),
            severity=(0.3, 0.9)[k % 2], font="ab"[k // 2 % 2], light="xyz"[k % 3],
        )
        for k in range(120)
    ]  # fmt: skip
    p = {e.factor: e.p_matters for e in factor_effects(trials)}
    assert p["severity"] < 0.001
    assert p["font"] < 0.01
    assert p["light"] > 0.05


def test_knowledge_is_compared_on_the_same_parts() -> None:
    trials = [trial(k, r, **levels) for k in range(5) for r, levels in ((3, LESS), (4, MORE))]
    only = list(between_givens(trials))
    assert [(c.first.level("given"), c.second.level("given")) for c in only] == [("font,format", "format")]
    assert (only[0].parts, only[0].serials.only_first, only[0].characters.difference.value) == (5, 5, 0.25)


def test_readers_are_paired_with_the_same_given_only() -> None:
    trials = [
        trial(k, r, mode=mode, **levels)
        for k in range(3)
        for mode, r in (("tactile", 4), ("vision", 3), ("fused", 4), ("rapidocr relief", 2))
        for levels in (LESS, MORE)
    ]
    pairs = list(between_readers(group_trials(trials, (GIVEN_FACTOR,))))
    assert all(c.first.levels == c.second.levels and c.parts == 3 for c in pairs)
    assert [(c.first.mode, c.second.mode) for c in pairs[:4]] == [
        ("fused", "tactile"), ("fused", "rapidocr relief"), ("tactile", "vision"), ("tactile", "rapidocr relief"),
    ]  # fmt: skip
    others = [t for t in trials if t.mode in ("rapidocr relief",)] + [
        trial(k, 1, mode="mine:read", **levels) for k in range(3) for levels in (LESS, MORE)
    ]
    assert len(list(between_readers(group_trials(others, (GIVEN_FACTOR,))))) == 2


def test_no_group_holds_a_part_twice() -> None:
    trials = [
        trial(k, 3, soil="ab"[k % 2], severity=0.3, **levels) for k in range(4) for levels in (LESS, MORE)
    ]
    statistics = statistics_of(trials, ("soil", "severity"))
    assert [g.serials.total for g in statistics.by_mode] == [4, 4]
    assert [c.serials.total for c in statistics.cells] == [2, 2, 2, 2]
    assert [g.key.mode for g in statistics.by_severity] == ["tactile"] * 2


SOILS = ("rust", "mud", "paint")
PARTS = 400
"""Parts of each soil: those of two soils can prove 1 in 100, which takes 628 accepted ones with 2 wrong."""


def trials_of_soils(mode: str = "tactile") -> list[Trial]:
    """Of every soil 350 sure and right, 50 doubtful ones, of which half are wrong."""
    trials = []
    for soil in SOILS:
        for k in range(PARTS):
            sure = k < 350
            text = "A1" if sure or k % 2 else "B1"
            confidence = 0.995 if sure else 0.6
            trials.append(Trial(f"{soil}-{k}", k, {"soil": soil}, mode, "A1", text, "review", confidence))
    return trials


def at_risk(rows: list[Trial], *risks: float) -> list[RiskAcceptance]:
    return list(acceptance_at_risks(group_trials(rows).items(), risks))


def test_the_threshold_of_other_soils_is_used_whatever_the_reader_decided() -> None:
    (acceptance,) = at_risk(trials_of_soils(), 0.01)
    assert (acceptance.risk, acceptance.accepted.count, acceptance.accepted.total) == (0.01, 1050, 1200)
    assert (acceptance.wrong_of_accepted.count, acceptance.wrong_of_accepted.total) == (0, 1050)
    assert 0.6 < acceptance.least[0] <= acceptance.least[1] <= 0.995


def test_wrong_ones_of_the_soil_left_out_are_counted_and_do_not_move_its_own_threshold() -> None:
    rows = [
        replace(t, text="B1") if t.levels["soil"] == "mud" and t.confidence > 0.9 and t.number < 2 else t
        for t in trials_of_soils()
    ]
    (acceptance,) = at_risk(rows, 0.01)
    assert acceptance.wrong_of_accepted.count == 2
    assert acceptance.accepted.count == 1050


def test_a_reading_that_breaks_a_contract_is_never_accepted() -> None:
    rows = [replace(t, broken=t.number % 2 == 0) for t in trials_of_soils()]
    rows[1] = replace(rows[1], error="FileError: x", text="")
    rows[3] = replace(rows[3], decision="reject")
    (acceptance,) = at_risk(rows, 0.01)
    assert (acceptance.accepted.count, acceptance.accepted.total) == (598, 1200)


@pytest.mark.parametrize(
    ("rows", "risk"),
    [(trials_of_soils(), 0.001), ([t for t in trials_of_soils() if t.levels["soil"] == "mud"], 0.01)],
    ids=["too few parts", "one soil"],
)
def test_what_cannot_be_proven_has_no_row(rows: list[Trial], risk: float) -> None:
    assert at_risk(rows, risk) == []
