"""Judges of the format: other text than it allows, signs outside it, check digits that cannot decide."""

from __future__ import annotations

import math
import string
from collections.abc import Iterator, Sequence
from functools import reduce
from operator import and_
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from recognition.decide.choice import Choice
from recognition.decide.decision import CHECK_FORMAT, Finding, ReadingFlag, flags_of
from recognition.decide.evidence import DecisionSettings, Evidence, SenseEvidence
from recognition.language.constrained_decoding import blind_warnings, choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.recogniser.read_line import ReadLine, greatest_between
from recognition.recogniser.steps import Steps

LEAST_VALID_MASS = 0.02
"""Total probability of all serials of the format, below which the line has another text."""
TWINS = ("0O", "1I")
"""Characters that most dies cut with the same shape."""
KINDS = {
    "a letter": string.ascii_uppercase,
    "a small letter": string.ascii_lowercase,
    "a digit": string.digits,
}
"""Kinds of characters that a format with an error confuses."""
IN_FORMAT = MappingProxyType({"tactile": -1.5, "vision": -2.5})
"""Log probability of the format on its line, twins included, below which the line may have another text. 1 in 100 of
the exam's lines accepted by touch has less; none of 48 photographs has. Of 134 felt lines with a sign outside the
alphabet, 22 were accepted without this rule and 12 with it: an Θ for a 0 or a Λ for an A."""
LEAST_READ = 0.52
"""Least probability of the most certain character of a text outside the format. Pictures of other things reach 0.51."""


def no_characters(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report that nothing was read, and what can be read that breaks the format."""
    if choice.characters:
        return
    flag, texts = ReadingFlag.NO_CHARACTERS, list[str]()
    line = choice.line
    if line is not None and choice.decoding is not None:
        # dirt: a text that was read with certainty but does not fit the format is named
        sure = float(line.open_places[0].log_belief.max(axis=1).sum()) > math.log(0.5)
        texts += [finding.text for finding in _format_findings(choice.sense, settings) if sure]
    elif choice.open_lattice is not None and (text := _outside_format(choice.open_lattice, settings.grammar)):
        texts.append(text)
    failed = any(finding.flag & flag for finding in choice.sense.log.findings)
    yield from (Finding(flag, text) for text in texts)
    if not texts and not failed:
        yield (
            Finding(flag, "no characters found in this time")
            if choice.sense.log.stopped
            else Finding.of(flag)
        )


def format_not_met(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report that the line may hold another text than the format allows; of two senses only if both say so."""
    if not choice.characters or choice.decoding is None:
        return
    by_sense = [tuple(_format_findings(sense, settings)) for sense in choice.senses]
    agreed = reduce(and_, map(flags_of, by_sense))
    if choice.layout:
        agreed &= ~ReadingFlag.FORMAT_NOT_MET
    findings = [finding for finding in by_sense[0] if finding.flag & agreed]
    yield from findings
    low = choice.decoding.valid_mass < LEAST_VALID_MASS
    if low and not flags_of(findings) & ReadingFlag.FORMAT_OVERRULED:
        yield Finding.of(ReadingFlag.FORMAT_OVERRULED)


def check_digit(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report a check digit that cannot tell likely serials apart, or could not be tested on all."""
    if not choice.characters or choice.decoding is None:
        return
    if choice.decoding.exhausted:
        yield Finding.of(ReadingFlag.SEARCH_EXHAUSTED)
    if settings.grammar is not None:
        for k, text in blind_warnings(choice.decoding, settings.grammar).items():
            yield Finding(ReadingFlag.CHECK_BLIND, text, (k,))


def small_letter(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report a capital that may be a small letter; without a format small letters count as capitals."""
    if choice.characters and choice.line is not None and settings.grammar is None:
        yield from small_letters(choice.line.looks, choice.line.columns, choice.text)


def _format_findings(sense: SenseEvidence, settings: DecisionSettings) -> tuple[Finding, ...]:
    line, grammar, least = sense.main, settings.grammar, IN_FORMAT[sense.source]
    if line is None or line.evidence >= least:
        return ()
    text = choose(line.lattice, grammar).text
    changed = format_misfits(line.open_places[0], grammar)
    if not changed and line.evidence < math.log(LEAST_VALID_MASS):
        changed = format_changed(line, text)
    if changed or line.evidence_of(grammar, alike=TWINS) >= least:
        return changed
    k = line.least_read()
    there = k < len(text)
    sign = f"{text[k]} at place {k + 1} may be a sign" if there else "there may be a sign"
    what = f"{sign} outside the format (compare it with the part)"
    return (Finding(ReadingFlag.FORMAT_OVERRULED, what, (k + 1,) if there else ()),)


def _outside_format(openly: Lattice, grammar: Grammar | None) -> str:
    broken = () if grammar is None or not openly.text else grammar.objections(openly.text)
    if not broken or openly.surest < LEAST_READ:
        return ""
    return f"{_describe_found(openly.text)}: {'; '.join(broken)} {CHECK_FORMAT}"


def _describe_found(text: str) -> str:
    return f"found {len(text)} character{'' if len(text) == 1 else 's'} (“{text}”)"


def format_misfits(
    openly: Lattice, grammar: Grammar | None, *, sure: float = 0.8, clear: float = 0.8, most_places: int = 3
) -> tuple[Finding, ...]:
    """Report where a clear text is of another kind than the format: the format may be wrong, not the part dirty."""
    belief = np.exp(openly.log_belief)
    if grammar is None or not belief.size or belief.max(axis=1).mean() < clear:
        return ()
    lengths = grammar.lengths()
    if lengths is not None and openly.n_places not in lengths:
        return (_other_length(openly, lengths, ReadingFlag.FORMAT_NOT_MET),)
    findings = []
    for k, allowed in enumerate(grammar.places(openly.n_places) or ()):
        for kind, members in KINDS.items():
            strange = set(members).difference(*map(_twins, allowed))
            believed = sum(belief[k, openly.chars.index(c)] for c in strange if c in openly.chars)
            if believed >= sure and not set(members) & set(allowed):
                # but for what is quoted, the same words on every part, so that they can be counted over a lot
                what = f"place {k + 1} reads as {kind} (“{openly.text[k]}”), which the format does not allow"
                findings.append(Finding(ReadingFlag.FORMAT_NOT_MET, f"{what} {CHECK_FORMAT}", (k + 1,)))
    return tuple(findings[:most_places])


def _other_length(openly: Lattice, lengths: frozenset[int], flag: ReadingFlag) -> Finding:
    some = f"{min(lengths)} to {max(lengths)}" if len(lengths) > 1 else f"{min(lengths)}"
    return Finding(flag, f"{_describe_found(openly.text)}, but the format has {some} {CHECK_FORMAT}")


def format_changed(line: ReadLine, text: str, *, unchanged: float = 0.5) -> tuple[Finding, ...]:
    """Report where the format has changed the text of a line, twins apart: only a format can tell O from 0."""
    lattice, _ = line.open_places
    open_text = lattice.text
    if len(open_text) != len(text):
        return (_other_length(lattice, frozenset({len(text)}), ReadingFlag.FORMAT_OVERRULED),)
    belief, chars = np.exp(lattice.log_belief), np.array(lattice.chars)
    same = np.array([belief[k, np.isin(chars, list(_twins(c)))].sum() for k, c in enumerate(text)])
    if np.prod(same) >= unchanged:
        return ()
    allowed = line.lattice
    changes = {
        k: f"{was} to {char} at place {k}"
        for k, (was, char) in enumerate(zip(open_text, text, strict=True), start=1)
        if was not in _twins(char)
        # no change: the format allows this character here
        and not (was in allowed.chars and np.isfinite(allowed.log_belief[k - 1, allowed.chars.index(was)]))
    }
    if not changes:
        least = int(same.argmin())
        changes = {least + 1: f"{text[least]} at place {least + 1} is unsure without the format"}
    what = f"the format changed what was read: {', '.join(changes.values())} (compare it with the part)"
    return (Finding(ReadingFlag.FORMAT_OVERRULED, what, tuple(changes)),)


def _twins(char: str) -> str:
    return next((twins for twins in TWINS if char in twins), char)


def small_letters(
    looks: Sequence[Steps], columns: NDArray[np.float64], text: str, *, least_small: float = 0.5
) -> tuple[Finding, ...]:
    """Report a capital that may be a small letter: many letters have the same shape in both cases."""
    if columns.size < 2:
        return ()
    half = 0.5 * float(np.diff(columns).min())
    believed = greatest_between([(c - half, c + half) for c in columns], looks, "small")
    if believed is None or not (small := np.flatnonzero(believed > least_small)).size:
        return ()
    k = int(small[0])
    words = f"{text[k]} at place {k + 1} may be a small letter (a format says which: A or a)"
    return (Finding(ReadingFlag.CASE_UNKNOWN, words, (k + 1,)),)
