"""Decide on a part: every rule is a judge of the evidence, and the reading is built once, at the end.

    evidence --choose_text--> text --measure_text--> score --judge--> findings --\\
                                                                                  Reading: accept, review or reject
                              expected text --verify--> verdict ----------------/
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import MappingProxyType

from recognition.decide.build_reading import build_reading
from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag, flags_of
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.judges import judge
from recognition.decide.measures import measure_text
from recognition.decide.reading import Reading
from recognition.decide.score import Measure
from recognition.decide.text import choose_text
from recognition.decide.verify import Verdict, verify


def decide(
    evidence: Evidence,
    settings: DecisionSettings,
    *,
    without: ReadingFlag = ReadingFlag.NONE,
    without_measures: frozenset[Measure] = frozenset(),
    certify: bool = True,
) -> Reading:
    """Decide on the evidence of a part; `without` some of them, to see what each is worth. Raises VerifyError."""
    start = time.perf_counter()
    senses = evidence.senses if len(evidence.senses) > 1 else ()
    alone: dict[str, Reading] = {
        sense.source: decide(Evidence.of(sense), settings, certify=False) for sense in senses
    }
    choice = score_text(evidence, settings, alone, without=without_measures)
    findings, accepted = judge(evidence, choice, settings, without=without, certify=certify)
    verification = None
    if evidence.expected:
        same_text = choice.text == "".join(evidence.expected.split())
        verification = verify(
            choice.open_lattice,
            evidence.expected,
            grammar=settings.grammar,
            contradicted=bool(flags_of(findings) & ReadingFlag.SENSES_DISAGREE),
            accepted=choice.score if accepted and same_text else 0.0,
        )
        if verification.verdict is Verdict.REFUTED and not ReadingFlag.MISMATCH & without:
            findings.append(Finding.of(ReadingFlag.MISMATCH))
    seconds = {**evidence.seconds, "decide": time.perf_counter() - start}
    return build_reading(evidence, choice, findings, verification, seconds)


def score_text(
    evidence: Evidence,
    settings: DecisionSettings,
    alone: Mapping[str, Reading] = MappingProxyType({}),
    *,
    without: frozenset[Measure] = frozenset(),
) -> Choice:
    """Choose the text of a part, and score it, without any judge; `alone` is what each of two senses reads."""
    return measure_text(choose_text(evidence, settings, alone), evidence, settings, without=without)
