"""Turn the posteriors of a line into a reading: the text that the format allows, its confidence and its warnings."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recognition.decision.decide import CHECK_FORMAT, Finding, ReadingFlag
from recognition.decision.reading import Candidate, CharacterReading, OtherLine, Reading, with_spaces
from recognition.decision.score import Score, log_odds, score_of
from recognition.find.part_lines import PartLines
from recognition.find.request import LineFormat
from recognition.language.box import Box
from recognition.language.confusions import state_of
from recognition.language.constrained_decoding import Choice, blind_warnings, choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.recogniser.read_line import ReadLine, greatest_between, word_gaps
from recognition.recogniser.steps import Steps
from recognition.views.places import boxes_of

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


class LineSettings(Protocol):
    """Settings that a line's reading needs."""

    @property
    def accept_confidence(self) -> float:
        """Least confidence for acceptance."""

    @property
    def grammar(self) -> Grammar | None:
        """Format of the serials; None without one."""

    @property
    def asked(self) -> Mapping[str, LineFormat]:
        """Further lines that the part should have, by name."""

    @property
    def orientation(self) -> Orientation:
        """Orientation of the parts."""


def reading_of_line(
    part: PartLines,
    settings: LineSettings,
    *,
    source: str,
    flags: ReadingFlag = ReadingFlag.NONE,
    least_places: int = 4,
    least_serial_evidence: float = -12.0,
) -> Reading:
    """Make the reading of a part's line under its format, with findings on broken contracts; `with_score` comes later.

    Args:
        part: the part's lines.
        settings: acceptance threshold, format of the serial, further lines that the part should have.
        source: source of the reading: "tactile" or "vision".
        flags: flags that are set already.
        least_places: length from which a line without a format counts as text even if it is unsure.
        least_serial_evidence: log probability of the format on a line, below which the line is not the serial. In the
            exam, 41 second lines of six characters, under a format of eight, have -19.5 at most; their serials have
            -5.5 at least.
    """
    main, grammar, asked = part.main, settings.grammar, settings.asked
    nothing = Reading((), 0.0, flags | ReadingFlag.NO_CHARACTERS, source=source)
    if main is None:
        return nothing
    choice = choose(main.lattice, grammar)
    spaces = spaces_of(main, choice.text, grammar)
    lattice = replace(main.lattice, boxes=boxes_of(main.line, main.columns))
    openly, columns = main.open_places
    openly = replace(openly, boxes=boxes_of(main.line, columns))
    if not choice.text or not main.is_text:
        found = _outside_format(openly, grammar)
        return nothing.with_findings(*found).with_trace(lattice=lattice, open_lattice=openly)
    unsure = choice.probability < settings.accept_confidence
    if grammar is None and len(choice.text) < least_places and unsure:
        # a scratch is read as a 1, two dents as OO
        return nothing.with_trace(lattice=lattice)
    changed = _check_format_evidence(main, choice.text, grammar, least=IN_FORMAT[source])
    small = small_letters(main.looks, main.columns, choice.text) if grammar is None else ()
    worth = score_of(source)
    others = [
        _named_line(name, one, asked[name].grammar, worth) for name, one in part.named.items() if one.is_text
    ]
    others += [_unassigned_line(one, grammar, worth, least_serial_evidence) for one in part.others]
    belief = choice.probability * main.likely
    reading = Reading(
        tuple(characters_of(choice, lattice)),
        0.0,
        flags,
        others=tuple(others),
        height_mm=main.line.height_mm,
        rotation_deg=main.line.turned_deg,
        box=hull(lattice.boxes),
        spaces_after=spaces,
        source=source,
        threshold=settings.accept_confidence,
    ).with_findings(*changed, *small, *doubts_of_lines(others, settings))
    reading = contracts_of_choice(reading.with_confidence(worth.of_belief(belief)), choice, grammar)
    by_expert = {name: replace(own, boxes=lattice.boxes) for name, own in main.by_expert.items()}
    return reading.with_trace(
        lattice=lattice, open_lattice=openly, choice=choice, line=main.line, by_expert=by_expert,
        odds=log_odds(belief), evidence=main.evidence,
    )  # fmt: skip


def doubts_of_lines(others: Sequence[OtherLine], settings: LineSettings) -> tuple[Finding, ...]:
    """Check the contracts about a part's other lines, and return the broken ones.

    Args:
        others: other lines that were read.
        settings: lines that the part should have, and the acceptance threshold.
    """
    least, names = settings.accept_confidence, {other.name for other in others}
    unread = [other.text for other in others if not other.name and other.may_be_serial]
    unsure = [f"{other.name} {other.text}" for other in others if other.name and other.confidence < least]
    return (
        *(Finding(ReadingFlag.UNREAD_MARKS, f"another line reads “{text}”") for text in unread),
        *(
            Finding(ReadingFlag.LINE_MISSING, f"no text was read for the line {name}")
            for name in settings.asked
            if name not in names
        ),
        *(Finding(ReadingFlag.LINE_MISSING, f"low confidence: {line}?") for line in unsure),
    )


def contracts_of_choice(reading: Reading, choice: Choice, grammar: Grammar | None) -> Reading:
    """Add the contracts about format and check digit that a choice breaks to its reading."""
    flags = ReadingFlag.NONE
    if choice.valid_mass < LEAST_VALID_MASS or not choice.text:
        flags |= ReadingFlag.FORMAT_OVERRULED
    if choice.exhausted:
        flags |= ReadingFlag.SEARCH_EXHAUSTED
    blind = {} if grammar is None else blind_warnings(choice, grammar)
    made = replace(reading, flags=reading.flags | flags)
    return made.with_findings(*(Finding(ReadingFlag.CHECK_BLIND, text, (k,)) for k, text in blind.items()))


def _outside_format(openly: Lattice, grammar: Grammar | None) -> tuple[Finding, ...]:
    """Report a text that can be read but breaks the format."""
    broken = () if grammar is None or not openly.text else grammar.objections(openly.text)
    if not broken or openly.surest < LEAST_READ:
        return ()
    what = f"{_describe_found(openly.text)}: {'; '.join(broken)} {CHECK_FORMAT}"
    return (Finding(ReadingFlag.NO_CHARACTERS, what),)


def _describe_found(text: str) -> str:
    """Describe a text, such as "found 1 character (“8”)"."""
    return f"found {len(text)} character{'' if len(text) == 1 else 's'} (“{text}”)"


def _check_format_evidence(
    line: ReadLine, text: str, grammar: Grammar | None, *, least: float
) -> tuple[Finding, ...]:
    """Report that the line may hold another text, or a sign outside the format."""
    if line.evidence >= least:
        return ()
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


def format_misfits(
    openly: Lattice, grammar: Grammar | None, *, sure: float = 0.8, clear: float = 0.8, most_places: int = 3
) -> tuple[Finding, ...]:
    """Report where a clear text is of another kind than the format: the format may be wrong, not the part dirty.

    Apart from what is quoted, a finding has the same words on every part, so that they can be counted over a lot.

    Args:
        openly: posteriors without the format.
        grammar: the format.
        sure: least probability of another kind of character at a place.
        clear: least mean probability of the best characters, at which a text is clear.
        most_places: most places that are named.
    """
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
                what = f"place {k + 1} reads as {kind} (“{openly.text[k]}”), which the format does not allow"
                findings.append(Finding(ReadingFlag.FORMAT_NOT_MET, f"{what} {CHECK_FORMAT}", (k + 1,)))
    return tuple(findings[:most_places])


def _other_length(openly: Lattice, lengths: frozenset[int], flag: ReadingFlag) -> Finding:
    some = f"{min(lengths)} to {max(lengths)}" if len(lengths) > 1 else f"{min(lengths)}"
    return Finding(flag, f"{_describe_found(openly.text)}, but the format has {some} {CHECK_FORMAT}")


def format_changed(line: ReadLine, text: str, *, unchanged: float = 0.5) -> tuple[Finding, ...]:
    """Report where the format has changed the text of a line; nothing if it has not.

    Twins, which most dies cut with the same shape, do not count as a change: only a format can tell O from 0.

    Args:
        line: the line as read.
        text: text chosen by the format.
        unchanged: least probability of the chosen text without the format, twins included, at which nothing counts as
            changed.
    """
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


def _named_line(name: str, one: ReadLine, grammar: Grammar, worth: Score) -> OtherLine:
    """Read a requested line under its format."""
    choice = choose(one.lattice, grammar)
    text = with_spaces(choice.text, spaces_of(one, choice.text, grammar)).rstrip()
    box = hull(boxes_of(one.line, one.columns))
    return OtherLine(name, text, worth.of_belief(choice.probability), box, line=one.line)


def _unassigned_line(
    one: ReadLine, grammar: Grammar | None, worth: Score, least_serial_evidence: float
) -> OtherLine:
    """Read a line that was not requested, without a format."""
    lattice, columns = one.open_places
    text = with_spaces(lattice.text, word_gaps(columns, one.looks))
    sure = float(np.exp(lattice.log_belief.max(axis=1).sum()))
    meant, box = one.evidence_of(grammar) >= least_serial_evidence, hull(boxes_of(one.line, columns))
    return OtherLine("", text, worth.of_belief(sure), box, may_be_serial=meant, line=one.line)


def characters_of(choice: Choice, lattice: Lattice, *, most_candidates: int = 5) -> list[CharacterReading]:
    """List the candidates of each place: the chosen character first, then its rivals under the grammar."""
    made = []
    for k, chosen in enumerate(choice.text):
        beliefs = choice.place(k)
        order = [chosen, *(c for c in beliefs if c != chosen)][:most_candidates]
        shares = [min(1.0, beliefs.get(c, 0.0)) for c in order]
        candidates = tuple(map(Candidate, order, shares, shares))
        made.append(CharacterReading(candidates, lattice.boxes[k], state=state_of(beliefs)))
    return made


def spaces_of(line: ReadLine, text: str, grammar: Grammar | None) -> frozenset[int]:
    """Find the places that a word gap follows: from the format if it fixes them, or else from the line.

    Args:
        line: the line that was read.
        text: text without blanks.
        grammar: format of the text.
    """
    known = None if grammar is None else grammar.spaces(text)
    return word_gaps(line.columns, line.looks) if known is None else known


def small_letters(
    looks: Sequence[Steps], columns: NDArray[np.float64], text: str, *, least_small: float = 0.5
) -> tuple[Finding, ...]:
    """Report a capital that may be a small letter; small letters count as capitals without a format.

    Many dies have small capitals, and many letters have the same shape in both cases. A person who knows the marking
    decides once, by giving a format.

    Args:
        looks: the recogniser's outputs along the line.
        columns: (places,) column of each place.
        text: text of the line.
        least_small: probability of a small letter above which it is reported.
    """
    if columns.size < 2:
        return ()
    half = 0.5 * float(np.diff(columns).min())
    believed = greatest_between([(c - half, c + half) for c in columns], looks, "small")
    if believed is None or not (small := np.flatnonzero(believed > least_small)).size:
        return ()
    k = int(small[0])
    words = f"{text[k]} at place {k + 1} may be a small letter (a format says which: A or a)"
    return (Finding(ReadingFlag.CASE_UNKNOWN, words, (k + 1,)),)


def hull(boxes: Sequence[Box]) -> Box | None:
    """Return the common hull of boxes; None if there are none."""
    if not boxes:
        return None
    corners = np.array([astuple(box) for box in boxes])
    return Box(*corners[:, :2].min(axis=0).tolist(), *corners[:, 2:].max(axis=0).tolist())
