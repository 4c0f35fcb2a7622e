"""Rules for marks and what they make of a reading."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recognition.decision.depth_rules import (
    DEPTH_RULES,
    DepthRule,
    DepthRuleError,
    depth_rule,
    judged_by,
    least_depth,
    print_size_mm,
)
from recognition.decision.reading import (
    Box,
    Candidate,
    CharacterReading,
    Decision,
    MarkDepth,
    Reading,
    ReadingFlag,
)

FIREARMS = depth_rule("27CFR478.92")


def reading(*marks: tuple[str, float | None], height_mm: float = 5.0) -> Reading:
    characters = tuple(
        CharacterReading(
            (Candidate(char, 0.9, 0.99),),
            Box(0.0, 0.0, 1.0, 1.0),
            None if depth is None else MarkDepth(depth + 0.02, depth, depth + 0.03),
        )
        for char, depth in marks
    )
    return Reading(characters, Decision.ACCEPT, 0.97, height_mm=height_mm, flags=ReadingFlag.DROPOUTS)


def test_the_rule_for_firearms() -> None:
    # .003 inch and 1/16 inch
    assert FIREARMS.least_depth_mm == pytest.approx(0.0762)
    assert FIREARMS.least_height_mm == pytest.approx(1.5875)
    assert "478.92" in FIREARMS.source


@pytest.mark.parametrize("name", ["27CFR478.92", "27 CFR 478.92", " 27cfr478.92"])
def test_rules_by_name(name: str) -> None:
    assert depth_rule(name) is FIREARMS


def test_an_unknown_rule_tells_the_known_ones() -> None:
    with pytest.raises(DepthRuleError, match="'VIN'") as caught:
        depth_rule("VIN")
    for rule in DEPTH_RULES:
        assert rule.name in str(caught.value)
        assert rule.source


@pytest.mark.parametrize("depth", [0.0, -0.1, float("nan"), float("inf")])
def test_rules_have_positive_depths(depth: float) -> None:
    with pytest.raises(DepthRuleError, match="least_depth_mm"):
        least_depth(depth)
    with pytest.raises(DepthRuleError, match="least_height_mm"):
        DepthRule("x", 0.1, -1.0)


def test_without_rules_nothing_is_said() -> None:
    plain = reading(("K", 0.01), ("7", None))
    assert judged_by(plain, ()) == plain
    assert judged_by(replace(plain, characters=()), (FIREARMS,)).notes == ()


def test_the_note_names_rule_character_and_depth() -> None:
    judged = judged_by(reading(("K", 0.2), ("7", 0.061), ("B", 0.07)), (FIREARMS,))
    assert judged.flags == ReadingFlag.DROPOUTS | ReadingFlag.TOO_SHALLOW
    assert judged.notes == ("too shallow for 27CFR478.92: 7 0.061 mm, B 0.070 mm (at least 0.0762)",)
    assert judged.messages() == (*ReadingFlag.DROPOUTS.messages(), *judged.notes)
    # the text is as sure as before
    assert (judged.decision, judged.confidence) == (Decision.ACCEPT, 0.97)


def test_every_rule_speaks_for_itself() -> None:
    judged = judged_by(reading(("K", 0.2), ("7", 0.07)), (FIREARMS, least_depth(0.3)))
    assert [note.split(":")[0] for note in judged.notes] == [
        "too shallow for 27CFR478.92",
        "too shallow for min_depth_mm",
    ]
    assert judged_by(reading(("K", 0.31)), (FIREARMS, least_depth(0.3))).notes == ()


def test_a_depth_not_felt_is_not_a_depth_met() -> None:
    judged = judged_by(reading(("K", 0.2), ("7", None)), (FIREARMS,))
    assert judged.flags & ReadingFlag.DEPTH_UNKNOWN
    assert not judged.flags & ReadingFlag.TOO_SHALLOW
    assert judged.notes == ("depth not measured for 27CFR478.92: 7",)


@pytest.mark.parametrize(("height", "small"), [(1.5, True), (1.7, True), (1.9, False)])
def test_print_size_is_that_of_the_bottoms(height: float, small: bool) -> None:
    # mean depth 0.1: walls of 45 degrees take 0.2 mm off the height at the surface
    tried = reading(("K", 0.08), ("7", 0.08), height_mm=height)
    assert print_size_mm(tried) == pytest.approx(height - 0.2)
    judged = judged_by(tried, (FIREARMS,))
    assert bool(judged.flags & ReadingFlag.TOO_SMALL) is small
    assert any("too small for 27CFR478.92" in note for note in judged.notes) is small
