"""Judge a text by the rules that it must keep; each rule is one function of the evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeAlias

from recognition.decide.choice import Choice
from recognition.decide.decision import BESIDE_SERIAL, Decision, Finding, ReadingFlag, decision_of, flags_of
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.judges.depths import depth_rules
from recognition.decide.judges.format import check_digit, format_not_met, no_characters, small_letter
from recognition.decide.judges.lines import (
    layout,
    longer_line,
    orientation,
    other_lines,
    struck_out,
    unread_photograph,
)
from recognition.decide.judges.score import (
    accepted_risk,
    certificate,
    low_confidence,
    other_texts,
    too_few_lines,
)
from recognition.decide.judges.senses import (
    code_disagrees,
    lines_disagree,
    log_of_sense,
    search_stopped,
    senses_disagree,
    senses_together,
    spots,
)
from recognition.decide.judges.strokes import (
    covered_characters,
    cut_characters,
    guessed_characters,
    missing_strokes,
    named_font,
    undecided_strokes,
)

Judge: TypeAlias = Callable[[Evidence, Choice, DecisionSettings], Iterator[Finding]]

JUDGES: tuple[Judge, ...] = (
    no_characters, format_not_met, check_digit, small_letter,
    other_lines, longer_line, orientation, layout, unread_photograph,
    cut_characters, missing_strokes, undecided_strokes, named_font, guessed_characters,
    accepted_risk, depth_rules,
    log_of_sense, search_stopped, spots, senses_together, lines_disagree, senses_disagree, code_disagrees,
    low_confidence,
)  # fmt: skip
"""Rules that a text must keep, family by family."""
JUDGES_OF_SURE: tuple[Judge, ...] = (
    other_texts, struck_out, covered_characters, too_few_lines, certificate,
)  # fmt: skip
"""Rules for a text that would be sure otherwise, in turn."""


def judge(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    without: ReadingFlag = ReadingFlag.NONE,
    certify: bool = True,
) -> tuple[list[Finding], bool]:
    """Findings of all rules, and whether the text is accepted."""
    states = [place.state for place in choice.characters]

    def is_accepted(flags: ReadingFlag) -> bool:
        decision = decision_of(states, score=choice.score, threshold=choice.threshold, flags=flags)
        return decision is Decision.ACCEPT

    def report(*rules: Judge) -> list[Finding]:
        every = (finding for rule in rules for finding in rule(evidence, choice, settings))
        return [finding for finding in every if not finding.flag & without]

    findings = report(*JUDGES)
    for rule in JUDGES_OF_SURE:
        # rules for the mark and the orientation do not matter here
        if is_accepted(flags_of(findings) & ~BESIDE_SERIAL) and (certify or rule is not certificate):
            findings += report(rule)
    return findings, is_accepted(flags_of(findings))
