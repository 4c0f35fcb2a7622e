"""Decide on a part: every rule is a judge of the evidence, and the reading is built once, at the end.

    evidence --choose_text--> choice: text, marks, score --JUDGES--> findings --\\
                                                                                 Reading: accept, review or reject
                              expected text --verify--> verdict ---------------/
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import TypeAlias

from recognition.decide.choice import Choice, choose_text, hull
from recognition.decide.decision import BESIDE_SERIAL, Decision, Finding, ReadingFlag, decision_of, flags_of
from recognition.decide.deferred import deferred
from recognition.decide.depth_judges import depth_rules
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.format_judges import check_digit, format_not_met, no_characters, small_letter
from recognition.decide.line_judges import layout, orientation, other_lines, unread_photograph
from recognition.decide.reading import CharacterReading, Reading, ReadingTrace
from recognition.decide.score import Measure
from recognition.decide.score_judges import (
    accepted_risk,
    certificate,
    low_confidence,
    other_texts,
    too_few_lines,
)
from recognition.decide.sense_judges import (
    code_disagrees,
    lines_disagree,
    log_of_sense,
    search_stopped,
    senses_disagree,
    senses_together,
)
from recognition.decide.stroke_judges import (
    cut_characters,
    guessed_characters,
    missing_strokes,
    named_font,
    undecided_strokes,
)
from recognition.decide.verify import Verdict, Verification, verify

Judge: TypeAlias = Callable[[Evidence, Choice, DecisionSettings], Iterator[Finding]]

JUDGES: tuple[Judge, ...] = (
    no_characters, format_not_met, check_digit, small_letter,
    other_lines, orientation, layout, unread_photograph,
    cut_characters, missing_strokes, undecided_strokes, named_font, guessed_characters,
    accepted_risk, depth_rules,
    log_of_sense, search_stopped, senses_together, lines_disagree, senses_disagree, code_disagrees,
)  # fmt: skip
"""Rules that a text must keep, family by family."""
JUDGES_OF_SURE: tuple[Judge, ...] = (other_texts, too_few_lines, certificate)
"""Rules for a text that would be sure otherwise, in turn."""


def decide(
    evidence: Evidence,
    settings: DecisionSettings,
    *,
    without: ReadingFlag | frozenset[Measure] = ReadingFlag.NONE,
    certify: bool = True,
) -> Reading:
    """Decide on the evidence of a part.

    Args:
        evidence: evidence of one sense or both.
        settings: settings of the reader.
        without: flags that do not count, or measures that count as unknown, to see what each is worth.
        certify: whether the certificate of the settings must cover the reading.

    Raises:
        VerifyError: the expected text cannot be verified.
    """
    start = time.perf_counter()
    alone = _alone(evidence, settings)
    measures = without if isinstance(without, frozenset) else frozenset[Measure]()
    left_out = ReadingFlag.NONE if isinstance(without, frozenset) else without
    choice = choose_text(evidence, settings, alone, without=measures)
    findings: list[Finding] = []
    for judge in JUDGES:
        findings += judge(evidence, choice, settings)
    findings += low_confidence(choice)
    findings = [finding for finding in findings if not finding.flag & left_out]
    for judge in (judge for judge in JUDGES_OF_SURE if certify or judge is not certificate):
        # rules for the mark and the orientation do not matter here
        beside = [finding for finding in findings if not finding.flag & BESIDE_SERIAL]
        if _decision(choice, beside) is Decision.ACCEPT:
            findings += (f for f in judge(evidence, choice, settings) if not f.flag & left_out)
    verification = None
    if evidence.expected:
        accepted = choice.score if _decision(choice, findings) is Decision.ACCEPT else 0.0
        verification = _verified(evidence, choice, findings, settings, accepted=accepted)
        choice = replace(choice, characters=_checked(choice, verification))
        if verification.verdict is Verdict.REFUTED and not ReadingFlag.MISMATCH & left_out:
            findings.append(Finding.of(ReadingFlag.MISMATCH))
    seconds = {**_seconds(evidence), "decide": time.perf_counter() - start}
    return _reading(evidence, choice, findings, verification, MappingProxyType(seconds))


def _alone(evidence: Evidence, settings: DecisionSettings) -> Mapping[str, Reading]:
    """Readings of each sense alone; empty if there is only one."""
    if len(evidence.senses) == 1:
        return MappingProxyType({})
    return MappingProxyType(
        {sense.source: decide(Evidence.of(sense), settings, certify=False) for sense in evidence.senses}
    )


def _decision(choice: Choice, findings: list[Finding]) -> Decision:
    states = [place.state for place in choice.characters]
    return decision_of(states, score=choice.score, threshold=choice.threshold, flags=flags_of(findings))


def _verified(
    evidence: Evidence,
    choice: Choice,
    findings: list[Finding],
    settings: DecisionSettings,
    *,
    accepted: float,
) -> Verification:
    """The verdict on the expected text, by the posteriors without the format."""
    same_text = choice.text == "".join(evidence.expected.split())
    contradicted = bool(flags_of(findings) & ReadingFlag.SENSES_DISAGREE)
    return verify(
        choice.open_lattice, evidence.expected, grammar=settings.grammar, contradicted=contradicted,
        accepted=accepted if same_text else 0.0,
    )  # fmt: skip


def _checked(choice: Choice, verification: Verification) -> tuple[CharacterReading, ...]:
    """The characters with their states for the expected text."""
    if verification.places != len(choice.characters):
        return choice.characters
    states = {check.place: check.state for check in verification.characters}
    return tuple(replace(c, state=states.get(k, c.state)) for k, c in enumerate(choice.characters))


def _reading(
    evidence: Evidence,
    choice: Choice,
    findings: list[Finding],
    verification: Verification | None,
    seconds: Mapping[str, float],
) -> Reading:
    sense, vision = choice.sense, evidence.vision
    notes = (finding.text for finding in findings if not finding.flag)
    return Reading(
        choice.characters,
        choice.score,
        tuple(finding for finding in findings if finding.flag),
        font=deferred(lambda: choice.font),
        height_mm=deferred(lambda: choice.height_mm),
        rotation_deg=deferred(lambda: choice.rotation_deg),
        raised=choice.marks is not None and sense.marks is not None and sense.marks.felt.raised,
        box=hull([place.box for place in choice.characters]),
        source=evidence.source,
        spaces_after=choice.spaces_after,
        seconds=seconds,
        notes=(*sense.log.notes, *notes, *evidence.notes),
        unit="mm" if sense.scaled else "px",
        others=choice.others,
        photos=0 if vision is None else vision.log.photos,
        codes=choice.codes,
        accept_risk=choice.accept_risk,
        threshold=choice.threshold,
        measures=choice.measures,
        trace=_trace(evidence, choice, verification),
        evidence=evidence,
    )


def _seconds(evidence: Evidence) -> Mapping[str, float]:
    """Times of both senses, step by step."""
    touch, vision = evidence.touch, evidence.vision
    if touch is None or vision is None:
        return evidence.senses[0].log.seconds
    seen = {f"vision {step}": seconds for step, seconds in vision.log.seconds.items()}
    return {**touch.log.seconds, **seen}


def _trace(evidence: Evidence, choice: Choice, verification: Verification | None) -> ReadingTrace:
    sense, line, vision = choice.sense, choice.line, evidence.vision
    trace = partial(
        ReadingTrace,
        photo=None if vision is None else vision.log.whole_photo or vision.log.photo,
        odds=choice.odds,
        evidence=None if line is None or choice.decoding is None else line.evidence,
        strokes=deferred(lambda: choice.strokes),
        verification=verification,
    )
    if choice.alone:
        return trace(touch=choice.alone["tactile"], vision=choice.alone["vision"])
    view = sense.views[0] if sense.views else None
    by_expert = {} if line is None or choice.decoding is None else dict(line.by_expert)
    boxes = () if choice.lattice is None else choice.lattice.boxes
    return trace(
        edge_map=None if view is None else view.edges,
        relief=None if view is None else view.relief,
        scan=sense.log.scan,
        height_map=sense.log.surface,
        lattice=choice.lattice,
        open_lattice=choice.open_lattice,
        choice=choice.decoding,
        line=None if line is None or choice.decoding is None else line.line,
        by_expert=MappingProxyType({name: replace(own, boxes=boxes) for name, own in by_expert.items()}),
        faces=choice.faces,
        laid=deferred(lambda: None if choice.marks is None else choice.marks.laid),
    )
