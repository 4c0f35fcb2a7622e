"""Judges of what stands beside the serial, and of how the part lies: other lines, orientations, layouts."""

from __future__ import annotations

from collections.abc import Iterator

from recognition.decide.choice import LEAST_PLACES, Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.find.other_ways import ways_possible
from recognition.language.orientation import Way, other_text
from recognition.views.photo_sizes import shrunk

_SET = {
    Way.UPSIDE_DOWN: "set orientation = upright if parts lie so",
    Way.ROWS_REVERSED: "set rows if their order is known",
    Way.LEFT_RIGHT: "set rows if their order is known",
}
DARK = "the photograph has hardly any contrast (uncover the lens, light the part, expose longer)"


def other_lines(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report requested lines that were not read for sure, and others that may be a serial."""
    if not choice.characters:
        return
    names = {line.name for line in choice.others}
    for line in choice.others:
        if not line.name and line.may_be_serial:
            yield Finding(ReadingFlag.UNREAD_MARKS, f"another line reads “{line.text}”")
    for name in settings.asked:
        if name not in names:
            yield Finding(ReadingFlag.LINE_MISSING, f"no text was read for the line {name}")
    for line in choice.others:
        if line.name and line.confidence < choice.threshold:
            yield Finding(ReadingFlag.LINE_MISSING, f"low confidence: {line.name} {line.text}?")


def orientation(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report other orientations in which the marks can be read, unless a code shows which way up the part lies.

    If both senses read this text, only if both report one. Otherwise all that either reports, and those in which the
    text has exact images.
    """
    if not choice.characters or any(choice.is_held_by(code.text) for code in choice.codes):
        return
    if not choice.is_fused:
        sure = {id(line.line) for line in choice.others if line.confidence >= choice.threshold}
        for other in choice.sense.other_ways:
            if not sure & {id(line) for line in other.excluded_by}:
                yield _also_readable(other.way, other.text)
        return
    felt, seen = (choice.alone[sense.source] for sense in choice.senses)
    by_touch, by_camera = (
        [finding for finding in reading.findings if finding.flag & ReadingFlag.ORIENTATION_UNKNOWN]
        for reading in (felt, seen)
    )
    if felt.plain_text == seen.plain_text == choice.text:
        yield from by_touch if by_camera else ()
        return
    findings = [*by_touch, *by_camera]
    for way in ways_possible(settings.orientation, turned_deg=choice.rotation_deg):
        other_reading = other_text(choice.text, way, settings.grammar)
        if other_reading is not None and other_reading.exact:
            findings.append(_also_readable(way, other_reading.text))
    yield from dict.fromkeys(findings)


def _also_readable(way: Way, text: str) -> Finding:
    return Finding(ReadingFlag.ORIENTATION_UNKNOWN, f"also readable {way}: {text} ({_SET[way]})")


def layout(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report another layout in which the marks read well; a sure short text may be a piece of a column."""
    if choice.layout:
        yield Finding(ReadingFlag.LAYOUT, choice.layout)
    elif choice.sense.layout and settings.grammar is None and len(choice.text) < LEAST_PLACES:
        yield Finding(ReadingFlag.UNREAD_MARKS, choice.sense.layout)


def unread_photograph(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    pixels: int = 4_000,
    least_contrast: float = 0.01,
) -> Iterator[Finding]:
    """Note why no text was read in a photograph: it shows nothing, or several places may be the line.

    Args:
        evidence, choice, settings: as for every judge.
        pixels: number of pixels to which the photograph is shrunk first, which averages noise out.
        least_contrast: standard deviation of brightness, 0 to 1, below which it shows nothing.
    """
    photo, part = choice.sense.log.photo, choice.sense.lines
    if choice.characters or photo is None or part is None:
        return
    if shrunk(photo, pixels).grey().std() < least_contrast:
        yield Finding(ReadingFlag.NONE, DARK)
    elif len(part.candidates) > 1:
        view = choice.sense.views[0]
        middles = [line.centre_mm.mean(axis=0) for line in part.candidates]
        shares = [(middle - view.origin_mm) / view.size_mm for middle in middles]
        places = ", ".join(f"{x:.2f} {y:.2f}" for x, y in shares)
        text = (
            f"several candidates: {len(shares)} places look like a line of text, centred at {places} (shares of "
            "the photograph's width and height); give the right one as the region (--region)"
        )
        yield Finding(ReadingFlag.NONE, text)
