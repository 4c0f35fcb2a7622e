"""Rules for marks and what they make of a reading."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from glyphs.stamping.faces import Face
from recognition.decide.decision import Decision, Finding, ReadingFlag
from recognition.decide.depth_rules import (
    DEPTH_RULES,
    DepthRule,
    DepthRuleError,
    DepthWindow,
    depth_rule,
    least_depth,
)
from recognition.decide.judges.depths import depth_rules, print_size_mm, violations
from recognition.decide.reading import Box, Candidate, CharacterReading, Reading
from recognition.marks.depth import MarkDepth, depth_bias_mm
from recognition.marks.no_depth import NoDepth
from recognition.settings import ReaderSettings
from tests.support.evidence import judged, text_of

FIREARMS = depth_rule("27CFR478.92")
ENGINES = depth_rule("70-16-05")


def reading(
    *marks: tuple[str, float | None], height_mm: float = 5.0, burr_mm: float | None = 0.01
) -> Reading:
    characters = tuple(
        CharacterReading(
            (Candidate(char, 0.9, 0.99),),
            Box(0.0, 0.0, 1.0, 1.0),
            None if depth is None else MarkDepth(depth + 0.02, depth, depth + 0.03, burr_mm),
        )
        for char, depth in marks
    )
    findings = (Finding.of(ReadingFlag.DROPOUTS),)
    return Reading(characters, 0.97, findings, height_mm=height_mm, font="gothic")


def judged_by(reading: Reading, rules: Sequence[DepthRule]) -> Reading:
    """The reading of a mark under rules."""
    broken = (f for rule in rules for f in violations(rule, reading.characters, reading.height_mm))
    return replace(reading, findings=(*reading.findings, *broken))


def said(reading: Reading) -> tuple[str, ...]:
    return tuple(finding.text for finding in reading.findings if finding.flag is not ReadingFlag.DROPOUTS)


def test_the_rule_for_firearms() -> None:
    # .003 inch and 1/16 inch
    (window,) = FIREARMS.windows
    assert window == DepthWindow(0.003 * 25.4)
    assert FIREARMS.least_height_mm == pytest.approx(1.5875)
    assert "478.92" in FIREARMS.source


@pytest.mark.parametrize(
    ("name", "height_mm", "window"),
    [
        ("CONTRAN 24/98", 7.0, (0.2, math.inf)),
        ("mil-std-792", 3.0, (0.10, 0.25)),
        ("70-16-05", 0.8, (0.05, 0.15)),
        # a height is read to five per cent: 2.0 mm may be read as 2.08
        ("70-16-05", 2.08, (0.05, 0.15)),
        ("70-16-05", 2.25, None),
        ("70-16-05", 2.5, (0.15, 0.30)),
        ("70-16-05", 5.0, None),
    ],
)
def test_windows_of_the_built_in_rules(
    name: str, height_mm: float, window: tuple[float, float] | None
) -> None:
    found = depth_rule(name).window(height_mm)
    assert (None if found is None else (found.least_mm, found.most_mm)) == window


@pytest.mark.parametrize("name", ["27CFR478.92", "27 CFR 478.92", " 27cfr478.92"])
def test_rules_by_name(name: str) -> None:
    assert depth_rule(name) is FIREARMS


def test_an_unknown_rule_tells_the_known_ones() -> None:
    with pytest.raises(DepthRuleError, match="'VIN'") as caught:
        depth_rule("VIN")
    for rule in DEPTH_RULES:
        assert rule.name in str(caught.value)
        assert rule.source


def test_a_rule_written_out() -> None:
    assert depth_rule("press-7=0.05:0.15@0.8:2 0.15:0.3@2.5:4 burr=0.05 height=1.6") == DepthRule(
        "press-7",
        (DepthWindow(0.05, 0.15, (0.8, 2.0)), DepthWindow(0.15, 0.3, (2.5, 4.0))),
        least_height_mm=1.6,
        most_burr_mm=0.05,
    )
    assert depth_rule("0.2:").windows == (DepthWindow(0.2),)
    assert depth_rule(":0.3@4:").windows == (DepthWindow(0.0, 0.3, (4.0, math.inf)),)
    assert depth_rule("burr=0.03") == DepthRule("own rule", most_burr_mm=0.03)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("0.3:0.2", "from 0.3 to 0.2 mm"),
        (":", "from 0.0 to inf mm"),
        ("0.1:0.2@4:3", "heights from 4.0 to 3.0 mm"),
        ("0.1:0.2 0.3", "'0.3' is not a limit of the depth rule"),
        ("0.1:0.2 burr=thin", "'burr=thin' is not a limit"),
        ("0.1:0.2 burr=-1", "'burr=-1' is not a limit"),
        ("0.1:0.2 burr=0", "0.0 of burr"),
        ("0.1:.", "'0.1:.' is not a limit"),
    ],
)
def test_a_rule_written_wrongly(written: str, message: str) -> None:
    with pytest.raises(DepthRuleError, match=message):
        depth_rule(written)


@pytest.mark.parametrize("depth", [0.0, -0.1, float("nan"), float("inf")])
def test_rules_have_positive_depths(depth: float) -> None:
    with pytest.raises(DepthRuleError, match="depth window"):
        least_depth(depth)
    with pytest.raises(DepthRuleError, match=r"asks for -1\.0 mm"):
        DepthRule("x", (DepthWindow(0.1),), -1.0)
    with pytest.raises(DepthRuleError, match="the rule x limits nothing"):
        DepthRule("x")


def test_without_rules_nothing_is_said() -> None:
    plain = reading(("K", 0.01), ("7", None))
    assert judged_by(plain, ()) == plain
    unread = text_of((), source="tactile")
    assert judged(unread, depth_rules, settings=ReaderSettings(depth_rules=(FIREARMS,))) == ()


def test_the_note_names_rule_place_and_depth() -> None:
    marked = judged_by(reading(("K", 0.2), ("7", 0.061), ("B", 0.07)), (FIREARMS,))
    assert marked.flags == ReadingFlag.DROPOUTS | ReadingFlag.TOO_SHALLOW
    assert said(marked) == (
        "too shallow for 27CFR478.92: 7 at place 2 0.061 mm, B at place 3 0.070 mm (at least 0.0762)",
    )
    assert set(marked.messages()) == {ReadingFlag.DROPOUTS.text, *said(marked)}
    # the text is as sure as before, but the part is not as it should be
    assert (marked.decision, marked.confidence) == (Decision.REVIEW, 0.97)


@pytest.mark.parametrize(
    ("least_mm", "bias_mm", "sd_mm", "words"),
    [
        (0.102, 0.0, 0.005, ()),
        (
            0.102,
            0.006,
            0.005,
            ("too shallow for MIL-STD-792: K at place 1 0.096 +- 0.005 mm (at least 0.1)",),
        ),
        (0.107, 0.006, 0.012, ()),
        (0.225, 0.006, 0.008, ()),
        (0.225, 0.0, 0.008, ("too deep for MIL-STD-792: K at place 1 0.255 +- 0.008 mm (at most 0.25)",)),
    ],
)
def test_a_depth_is_compared_without_its_known_error_and_told_with_its_uncertainty(
    least_mm: float, bias_mm: float, sd_mm: float, words: tuple[str, ...]
) -> None:
    plain = reading(("K", least_mm))
    depth = replace(plain.characters[0].depth, bias_mm=bias_mm, sd_mm=sd_mm)  # type: ignore[type-var]
    marked = replace(plain, characters=(replace(plain.characters[0], depth=depth),))
    rule = depth_rule("MIL-STD-792")
    judged_mark = judged_by(marked, (rule,))
    assert said(judged_mark) == words
    assert (judged_mark.decision is Decision.ACCEPT) == (words == ())


def test_the_known_error_is_that_of_face_and_height() -> None:
    assert depth_bias_mm(Face.FLAT, 5.0) == pytest.approx(0.006)
    assert depth_bias_mm(Face.FLAT, 6.0) == pytest.approx(0.00665)
    assert depth_bias_mm(Face.FLAT, 30.0) == pytest.approx(0.0122)
    assert depth_bias_mm(Face.SHARP, 5.0) == depth_bias_mm(Face.DOTTED, 5.0) == 0.0


def test_a_mark_may_be_too_deep() -> None:
    marked = judged_by(reading(("K", 0.11), ("7", 0.24)), (depth_rule("MIL-STD-792"),))
    assert marked.flags & ReadingFlag.TOO_DEEP
    assert said(marked) == ("too deep for MIL-STD-792: 7 at place 2 0.270 mm (at most 0.25)",)
    assert marked.decision is Decision.REVIEW


def test_the_window_is_that_of_the_height() -> None:
    marks = (("K", 0.08), ("7", 0.1))
    assert judged_by(reading(*marks, height_mm=1.9), (ENGINES,)).decision is Decision.ACCEPT
    marked = judged_by(reading(*marks, height_mm=3.0), (ENGINES,))
    assert said(marked) == (
        "too shallow for 70-16-05: K at place 1 0.080 mm, 7 at place 2 0.100 mm (at least 0.15)",
    )
    unruled = judged_by(reading(*marks, height_mm=5.0), (ENGINES,))
    assert unruled.flags & ReadingFlag.NO_DEPTH_RULE
    assert said(unruled) == (
        "70-16-05 has no depth for characters 5.00 mm high (only for 0.8 to 2, 2.5 to 4 mm)",
    )


def test_a_burr_may_be_too_high() -> None:
    rule = depth_rule("burr=0.03")
    assert said(judged_by(reading(("K", 0.2), burr_mm=0.03), (rule,))) == ()
    marked = judged_by(reading(("K", 0.2), burr_mm=0.041), (rule,))
    assert marked.flags & ReadingFlag.BURR_TOO_HIGH
    assert said(marked) == ("burr too high for own rule: K at place 1 0.041 mm (at most 0.03)",)
    unknown = judged_by(reading(("K", 0.2), burr_mm=None), (rule,))
    assert said(unknown) == ("depth not measured for own rule: K at place 1 (scan it again)",)


def test_every_rule_speaks_for_itself() -> None:
    marked = judged_by(reading(("K", 0.2), ("7", 0.07)), (FIREARMS, least_depth(0.3)))
    assert [note.split(":")[0] for note in said(marked)] == [
        "too shallow for 27CFR478.92",
        "too shallow for min_depth_mm",
    ]
    assert said(judged_by(reading(("K", 0.31)), (FIREARMS, least_depth(0.3)))) == ()


def test_a_depth_not_felt_is_not_a_depth_met() -> None:
    marked = judged_by(reading(("K", 0.2), ("7", None)), (FIREARMS,))
    assert marked.flags & ReadingFlag.DEPTH_UNKNOWN
    assert not marked.flags & ReadingFlag.TOO_SHALLOW
    assert said(marked) == ("depth not measured for 27CFR478.92: 7 at place 2 (scan it again)",)


def test_the_reason_says_what_to_do_about_a_depth_that_was_not_measured() -> None:
    plain = reading(("K", 0.2), ("7", None), ("B", None), ("1", None))
    causes = (None, NoDepth.FONT, NoDepth.SATURATED, NoDepth.FONT)
    characters = (replace(c, no_depth=why) for c, why in zip(plain.characters, causes, strict=True))
    marked = judged_by(replace(plain, characters=tuple(characters)), (FIREARMS,))
    assert marked.decision is Decision.REVIEW
    assert said(marked) == (
        "depth not measured for 27CFR478.92: 7 at place 2, 1 at place 4 (name the font)",
        "depth not measured for 27CFR478.92: B at place 3 (lower the gain, scan it again)",
    )


def test_a_print_size_at_the_bottoms_needs_a_depth() -> None:
    rule = depth_rule("height=1.6")
    assert said(judged_by(reading(("K", 0.2), ("7", None)), (rule,))) == ()
    marked = judged_by(reading(("K", None), ("7", None)), (rule,))
    assert marked.flags & ReadingFlag.DEPTH_UNKNOWN


@pytest.mark.parametrize(("height", "small"), [(1.5, True), (1.7, True), (1.9, False)])
def test_print_size_is_that_of_the_bottoms(height: float, small: bool) -> None:
    # mean depth 0.1: walls of 45 degrees take 0.2 mm off the height at the surface
    tried = reading(("K", 0.08), ("7", 0.08), height_mm=height)
    assert print_size_mm(tried.characters, height) == pytest.approx(height - 0.2)
    marked = judged_by(tried, (FIREARMS,))
    assert bool(marked.flags & ReadingFlag.TOO_SMALL) is small
    assert any("too small for 27CFR478.92" in note for note in said(marked)) is small
