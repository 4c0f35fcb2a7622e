"""Judges of what stands beside the serial, and of how the part lies: other lines, orientations, layouts."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.reading import OtherLine
from recognition.decide.text import LEAST_PLACES
from recognition.find.layouts import Layout, LayoutKind
from recognition.find.orientation import LEAST_LEAD_NATS, other_reading, ways_possible
from recognition.find.part_lines import PartLines
from recognition.language.code_text import holds
from recognition.language.orientation import Way, other_text, readable
from recognition.see.photo_frame import photo_origin_mm, photo_pitch_mm
from recognition.see.photo_sizes import shrunk
from recognition.see.strike_through import strike_through

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
    for name in settings.line_formats:
        if name not in names:
            yield Finding(ReadingFlag.LINE_MISSING, f"no text was read for the line {name}")
    for line in choice.others:
        if line.name and line.confidence < choice.threshold:
            yield Finding(ReadingFlag.LINE_MISSING, f"low confidence: {line.name} {line.text}?")


def orientation(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report other orientations in which the marks can be read, unless a code shows which way up the part lies.

    Of two senses, one that has read this text and can be read in no other orientation knows how the part lies, however
    dirty the other one is. Otherwise all that either reports, and those in which the text has exact images.
    """
    if not choice.characters or any(holds(code.text, choice.spaced_text) for code in choice.codes):
        return
    if not choice.is_fused:
        yield from _other_orientations(choice, settings)
        return
    felt, seen = (choice.alone[sense.source] for sense in choice.senses)
    by_touch, by_camera = (
        [finding for finding in reading.findings if finding.flag & ReadingFlag.ORIENTATION_UNKNOWN]
        for reading in (felt, seen)
    )
    by_sense = ((felt, by_touch), (seen, by_camera))
    if any(reading.plain_text == choice.text and not doubts for reading, doubts in by_sense):
        return
    findings = [*by_touch, *by_camera]
    for way in ways_possible(settings.orientation, turned_deg=choice.rotation_deg):
        other = other_text(choice.text, way, settings.grammar)
        if other is not None and other.exact:
            findings.append(_also_readable(way, other.text))
    yield from dict.fromkeys(findings)


def _other_orientations(choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    part, main = choice.sense.lines, choice.line
    if part is None or main is None:
        return
    sure_lines = [line for line in choice.others if line.confidence >= choice.threshold]
    rows_known, turned_deg = choice.sense.log.rows_known, main.line.turned_deg
    for way in ways_possible(settings.orientation, rows_known=rows_known, turned_deg=turned_deg):
        other = other_text(choice.text, way, settings.grammar)
        if other is None:
            continue
        text = other.text
        # an orientation that was not looked at, because the line had another text then, stays possible
        if not other.exact and way in main.other_ways:
            there = other_reading(main, way, choice.text, settings.grammar)
            if there is None or there.text == choice.text or there.lead_nats >= LEAST_LEAD_NATS:
                continue
            text = there.text
        if not any(_excludes(way, line, turned_deg, part, settings) for line in sure_lines):
            yield _also_readable(way, text)


def _excludes(
    way: Way, line: OtherLine, serial_deg: float, part: PartLines, settings: DecisionSettings
) -> bool:
    if line.line is None or math.cos(math.radians(line.line.turned_deg - serial_deg)) <= 0.0:
        return False
    grammar = settings.line_formats[line.name].grammar if line.name else None
    text = "".join(line.text.split())
    if readable(text, way, grammar, exact=True):
        return False
    if not readable(text, way, grammar):
        return True
    read = next(read for read in (*part.named.values(), *part.others) if read.line is line.line)
    if way not in read.other_ways:
        return False
    there = other_reading(read, way, text, grammar)
    return there is None or there.lead_nats >= LEAST_LEAD_NATS


def _also_readable(way: Way, text: str) -> Finding:
    return Finding(ReadingFlag.ORIENTATION_UNKNOWN, f"also readable {way}: {text} ({_SET[way]})")


def struck_out(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    least_felt: float = 0.35,
    least_seen: float = 0.7,
) -> Iterator[Finding]:
    """Report a line through the serial with some share of the characters' contrast, by touch or by camera.

    Of 168 felt lines that were read right one had 0.2 and more, of 13 that were struck out none less than 0.44. Ink is
    seen best: 11 lines of it had 0.94 and more, 208 photographs without such a line 0.52 at most.
    """
    for sense in choice.senses:
        line = sense.main
        if not sense.views or line is None:
            continue
        least = least_seen if sense.source == "vision" else least_felt
        if strike_through(sense.views[0], line.line, line.columns) >= least:
            yield Finding.of(ReadingFlag.STRUCK_OUT)
            return


def layout(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report another layout in which the marks read well; a sure short text may be a piece of a column."""
    if choice.layout:
        yield Finding(ReadingFlag.LAYOUT, _layout_text(choice.layout))
    elif choice.sense.layout and settings.grammar is None and len(choice.text) < LEAST_PLACES:
        yield Finding(ReadingFlag.UNREAD_MARKS, _layout_text(choice.sense.layout))


def longer_line(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report that the serial may be only a piece of its line."""
    lines = choice.sense.lines
    if choice.characters and lines is not None and lines.longer is not None:
        text = lines.longer.open_places[0].text
        yield Finding(
            ReadingFlag.UNREAD_MARKS,
            f"a longer line reads “{text}” about as well (give the format, or a narrower one)",
        )


def _layout_text(layout: Layout) -> str:
    texts = [f"“{text}”" for text in layout.texts]
    if layout.kind is LayoutKind.UPSIDE_DOWN:
        return f"the part lies upside down: from its other end it reads {texts[0]} (turn it, or the picture)"
    if layout.kind is LayoutKind.MIRRORED:
        return f"the marks look mirrored: in a mirror they read {texts[0]} (mirror the picture or the map)"
    if layout.kind is LayoutKind.COLUMN:
        return (
            f"the characters stand below each other and read {texts[0]} (columns are not accepted; type it)"
        )
    what = f"two lines read {texts[0]} and {texts[1]}, which fit the format together"
    return f"{what} (give --format for one and --line for the other)"


def unread_photograph(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    pixels: int = 4_000,
    least_contrast: float = 0.01,
) -> Iterator[Finding]:
    """Note why no text was read in a photograph: it shows nothing, or several places may be the line."""
    photo, part = choice.sense.log.photo, choice.sense.lines
    if choice.characters or photo is None or part is None:
        return
    if shrunk(photo, pixels).grey().std() < least_contrast:
        yield Finding(ReadingFlag.NONE, DARK)
    elif len(part.candidates) > 1:
        whole = choice.sense.log.whole_photo or photo
        rows, columns = whole.shape
        size_mm = np.multiply((columns - 1, rows - 1), photo_pitch_mm(whole))
        middles = [line.centre_mm.mean(axis=0) for line in part.candidates]
        shares = [(middle - photo_origin_mm(whole)) / size_mm for middle in middles]
        places = ", ".join(f"{x:.2f} {y:.2f}" for x, y in shares)
        text = (
            f"several candidates: {len(shares)} places look like a line of text, centred at {places} (shares of "
            "the photograph's width and height); give the right one as the region (--region)"
        )
        yield Finding(ReadingFlag.NONE, text)
