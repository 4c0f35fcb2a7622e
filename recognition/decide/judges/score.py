"""Judges of the score: a low one, and rules for a text that would otherwise be accepted."""

from __future__ import annotations

from collections.abc import Iterator

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.judges.words import ranges_text
from recognition.decide.risk import risk_findings
from recognition.decide.risk_text import risk_in_words
from recognition.decide.score import DIGITS
from recognition.marks.lines_felt import places_lacking_lines


def accepted_risk(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report that the sense whose score applies was not shown to keep the accepted risk."""
    if choice.characters:
        yield from risk_findings(choice.scored_as, choice.accept_risk)


def low_confidence(
    evidence: Evidence, choice: Choice, settings: DecisionSettings, *, sure_count: float = 0.9
) -> Iterator[Finding]:
    """Report a score below the threshold: the doubtful characters, or their number."""
    if not choice.is_low:
        return
    digits = next((n for n in range(3, 7) if round(choice.score, n) < choice.threshold), 6)
    least_score = f"{choice.threshold:g} for {risk_in_words(choice.accept_risk)}"
    why = f"confidence {choice.score:.{digits}f} is below the threshold {least_score}"
    low, places = ReadingFlag.LOW_CONFIDENCE, tuple(enumerate(choice.characters, start=1))
    unread = [k for k, c in places if c.is_unread]
    rivals = _rivals(choice)
    if rivals:
        yield Finding(low, f"{why}: {', '.join(rivals.values())}?", tuple(rivals))
    if unread:
        text = f"no character can be made out: {ranges_text(unread)} (look at the part)"
        yield Finding(low, text, tuple(unread))
    if rivals or unread:
        return
    if choice.line is not None and choice.line.count_probability < sure_count:
        yield Finding(low, f"{why}: are there {len(places)} characters?")
    elif len(places) > 1:
        k, least = min(places, key=lambda place: place[1].confidence)
        yield Finding(low, f"{why}: {least.char} at place {k} is the least certain", (k,))
    else:
        yield Finding(low, why)


def _rivals(choice: Choice, *, doubted: float = 0.05, most_places: int = 2) -> dict[int, str]:
    places = [
        (c.margin, f"{c.char} or {c.candidates[1].char} at place {k}", k)
        for k, c in enumerate(choice.characters, start=1)
        if len(c.candidates) > 1 and c.candidates[1].probability >= doubted and not c.is_unread
    ]
    return {k: text for _, text, k in sorted(places)[:most_places]}


def other_texts(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Raise the threshold for a text that was chosen among k: 1/k of the error is allowed (Bonferroni).

    Looks differ in height, row order or passes by touch, in stains by camera; an earlier pass over the lot counts too.
    """
    looks = (sense.log.other_texts for sense in choice.senses)
    texts = {choice.text}.union(evidence.other_texts, *looks)
    if choice.score < 1.0 - (1.0 - choice.threshold) / len(texts):
        yield Finding(ReadingFlag.BELIEVED_OTHERWISE, "low confidence: an earlier look read another text")


def too_few_lines(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report places where the passes of active touch do not distinguish the text from its rivals."""
    log = choice.sense.log
    if not log.chosen_passes or log.scan is None or not choice.strokes:
        return
    missing = places_lacking_lines(
        log.scan, [place.box for place in choice.characters], choice.strokes, height_mm=choice.height_mm
    )
    # of two axes that lack lines at a place, the first is named
    by_place = {lacking.place: lacking for lacking in reversed(missing)}
    for k, lacking in sorted(by_place.items()):
        likeliest = max(choice.strokes[k].rivals, key=lambda rival: rival.belief, default=None)
        pair = choice.text[k] if likeliest is None else f"{choice.text[k]} or {likeliest.char}"
        what = f"{pair} at place {k + 1}: too few lines {lacking.axis} were felt over it (feel more lines)"
        yield Finding(ReadingFlag.TOO_FEW_LINES, what, (k + 1,))


def certificate(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report a text that the certificate does not cover."""
    allowed = settings.certified
    if allowed is None:
        return
    if evidence.source not in allowed.sources:
        why = f"the certificate does not cover this sense ({evidence.source})"
    elif round(choice.score, DIGITS) < allowed.confidence:
        why = f"confidence {choice.score:.4f}, certified from {allowed.confidence:g}"
    else:
        return
    yield Finding(ReadingFlag.NOT_CERTIFIED, why)
