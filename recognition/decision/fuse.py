"""Combine the readings of touch and vision.

touch's lattice --+
                  +--> fuse_lattices --> choose under the grammar --> Reading
vision's lattice -+
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

from recognition.decision.contracts import checked_by_codes
from recognition.decision.decide import USUAL_THRESHOLD, Finding, ReadingFlag, flags_of
from recognition.decision.fuse_lattices import contradict, fuse_lattices, lead_nats
from recognition.decision.reading import OtherLine, Reading, ReadingTrace
from recognition.decision.reading_of_line import (
    LineSettings,
    characters_of,
    contracts_of_choice,
    doubts_of_lines,
)
from recognition.decision.score import log_odds, score_of, with_score
from recognition.decision.stroke_doubts import add_stroke_findings
from recognition.decision.which_way_up import also_readable, plain_text
from recognition.find.orientation import ways_possible
from recognition.language.constrained_decoding import choose
from recognition.language.lattice import Lattice
from recognition.language.orientation import other_text
from recognition.marks.strokes import strokes_of

CHOICE_FLAGS = (
    ReadingFlag.LOW_CONFIDENCE
    | ReadingFlag.FORMAT_OVERRULED
    | ReadingFlag.FORMAT_NOT_MET
    | ReadingFlag.SEARCH_EXHAUSTED
    | ReadingFlag.CHECK_BLIND
)
"""Flags that fusion computes anew."""


def fuse(touch: Reading, vision: Reading, settings: LineSettings) -> Reading:
    """Combine the readings of both senses; if only one has read, return that one.

    Args:
        touch: the reading of touch.
        vision: the reading of vision.
        settings: thresholds, grammar.

    Returns:
        A reading of source "fused" in the plate frame, whose trace holds both. It is accepted by the settings'
        threshold, and never if a sense that is sure of another text is outvoted.
    """
    reading = _fuse_lines(touch, vision, settings)
    trace = ReadingTrace(
        touch=touch, vision=vision, photo=vision.trace.photo, strokes=reading.trace.strokes,
        evidence=reading.trace.evidence, odds=_odds_of(touch, reading.text), camera_odds=_odds_of(vision, reading.text),
    )  # fmt: skip
    reading = replace(
        reading, source="fused", photos=vision.photos, trace=trace, threshold=settings.accept_confidence
    )
    reading = with_score(reading).with_findings(*disagreement(touch, vision, plain_text(reading)))
    # a photograph without a scale has a frame of its own
    codes = vision.codes if vision.unit == reading.unit else [replace(c, corners=()) for c in vision.codes]
    return checked_by_codes(reading, codes)


def disagreement(
    touch: Reading, vision: Reading, text: str, *, sure: float = USUAL_THRESHOLD, ratio: float = 1000.0
) -> tuple[Finding, ...]:
    """Report a sense that is sure of another text than the fused one: it may have read another part.

    A sense is sure of its text if its score says so, or if it holds the text for far likelier than the fused one. They
    also disagree if both are sure of different characters at one place: serials of one lot often differ at one only.

    Args:
        touch: reading by touch.
        vision: reading by camera.
        text: fused text.
        sure: least score of a text that is sure.
        ratio: ratio of a sense's probabilities of its text and of the fused one from which it is sure of its text. Dirt
            makes the camera take two or three characters for others at ten to one each; from 1,000 on it is not dirt.
    """
    nats = math.log(ratio)
    (camera_text, camera_lead), (touch_text, touch_lead) = (
        _text_and_lead(sense, text) for sense in (vision, touch)
    )
    if not camera_text or not touch_text or camera_text == touch_text:
        return ()
    outvoted = (
        sense_text != text and (sense.confidence >= sure or lead > nats)
        for sense, sense_text, lead in ((vision, camera_text, camera_lead), (touch, touch_text, touch_lead))
    )
    lattices = [
        sense.trace.lattice
        for sense in (touch, vision)
        if sense.characters and sense.trace.lattice is not None and len(camera_text) == len(touch_text)
    ]
    if not any(outvoted) and not (len(lattices) == 2 and contradict(*lattices)):
        return ()
    places = tuple(
        k for k, (a, b) in enumerate(zip(camera_text, touch_text, strict=False), start=1) if a != b
    )
    what = f"camera reads {vision.text}, touch {touch.text or touch_text}: are they of one part?"
    return (
        Finding(ReadingFlag.SENSES_DISAGREE, what, places if len(camera_text) == len(touch_text) else ()),
    )


def _text_and_lead(reading: Reading, text: str, *, least_places: int = 4) -> tuple[str, float]:
    """Text of a sense, and the log ratio of its probability to that of another one, or of all others together."""
    read_text, trace = plain_text(reading), reading.trace
    if read_text and trace.lattice is not None and len(read_text) == len(text):
        return read_text, lead_nats(trace.lattice, read_text, text)
    if read_text:
        return read_text, -math.inf if trace.odds is None else trace.odds
    # touch may have felt another text than the format allows; a scratch is read as a 1
    if (
        reading.source != "tactile"
        or trace.open_lattice is None
        or trace.open_lattice.n_places < least_places
    ):
        return "", -math.inf
    probability = math.exp(trace.open_lattice.log_belief.max(axis=1).sum())
    return trace.open_lattice.text, log_odds(probability)


def _odds_of(reading: Reading, text: str) -> float | None:
    """Log odds of a text by one sense; None if it has read nothing, or another number of characters."""
    lattice, plain = reading.trace.lattice, "".join(text.split())
    if lattice is None or not reading.characters or lattice.n_places != len(plain):
        return None
    if not set(plain) <= set(lattice.chars):
        return -math.inf
    logs = (lattice.log_belief[k, lattice.chars.index(c)] for k, c in enumerate(plain))
    odds, own = log_odds(math.exp(sum(logs))), reading.trace.odds
    # without a format the number of characters is uncertain too; the reading's own odds include that
    return odds if own is None or plain_text(reading) != plain else min(odds, own)


def _fuse_lines(tactile: Reading, vision: Reading, settings: LineSettings) -> Reading:
    """Touch's reading with the combined posteriors; if only one sense has read the part, its reading."""
    if tactile.trace.lattice is None or not tactile.characters:
        return _by_vision_alone(tactile, vision)
    lattice = fused_lattice(tactile, vision)
    if lattice is None:
        seen = f"{vision.text}, which has another number of characters" if vision.text else "nothing"
        return replace(tactile, notes=(*tactile.notes, f"the camera has read {seen}; read by touch alone"))
    choice = choose(lattice, settings.grammar)
    if not choice.text:
        return tactile
    others, other_contradictions = _joined_lines(tactile, vision)
    # a place keeps its depth and grade if its character is the same
    characters = tuple(
        replace(new, depth=old.depth, grade=old.grade, no_depth=old.no_depth) if old.char == new.char else new
        for new, old in zip(characters_of(choice, lattice), tactile.characters, strict=True)
    )
    known = None if settings.grammar is None else settings.grammar.spaces(choice.text)
    laid = tactile.trace.laid
    laid = None if laid is None else replace(laid, text=tuple(choice.text))
    strokes = () if laid is None else strokes_of(laid, lattice, slope=score_of("fused").slope)
    # the format counts as overruled only if both senses say so
    overruled = (ReadingFlag.FORMAT_OVERRULED | ReadingFlag.FORMAT_NOT_MET) & vision.flags
    # touch's findings on characters, format and lines are computed anew for both senses
    own = doubts_of_lines(tactile.others, settings)
    kept = tactile.without_flags(CHOICE_FLAGS | flags_of(own) | ReadingFlag.ORIENTATION_UNKNOWN)
    made = replace(
        kept,
        characters=characters,
        others=others,
        seconds=_seconds(tactile, vision),
        spaces_after=tactile.spaces_after if known is None else known,
    ).with_findings(
        *(finding for finding in tactile.findings if finding.flag & overruled),
        *doubts_of_lines(others, settings),
        *other_contradictions,
        *_orientation_doubts(tactile, vision, choice.text, settings),
    )
    made = contracts_of_choice(made, choice, settings.grammar)
    return add_stroke_findings(made.with_trace(choice=choice, laid=laid, strokes=strokes))


def fused_lattice(touch: Reading, vision: Reading, *, before_format: bool = False) -> Lattice | None:
    """Combined posteriors of both; None if they cannot be combined.

    They can if both have equally many places. These count as the same, because both senses read the line with the
    format, or the only one.

    Args:
        touch: reading by touch.
        vision: reading by camera.
        before_format: whether to combine the posteriors without the format.
    """
    felt, seen = (r.trace.open_lattice if before_format else r.trace.lattice for r in (touch, vision))
    if felt is None or seen is None or felt.n_places != seen.n_places:
        return None
    return fuse_lattices(felt, seen)


def _orientation_doubts(
    tactile: Reading, vision: Reading, text: str, settings: LineSettings
) -> tuple[Finding, ...]:
    """Report other orientations in which the marks can be read.

    If both senses read this text, only if both report one. Otherwise all that either reports, and those in which the
    text has exact images.
    """
    unknown = ReadingFlag.ORIENTATION_UNKNOWN
    found = [finding for finding in tactile.findings if finding.flag & unknown]
    if plain_text(tactile) == plain_text(vision) == text:
        return tuple(found) if vision.flags & unknown else ()
    found += [finding for finding in vision.findings if finding.flag & unknown]
    for way in ways_possible(settings.orientation, turned_deg=tactile.rotation_deg):
        other = other_text(text, way, settings.grammar)
        if other is not None and other.exact:
            found.append(also_readable(way, other.text))
    return tuple(dict.fromkeys(found))


def _joined_lines(touch: Reading, vision: Reading) -> tuple[tuple[OtherLine, ...], tuple[Finding, ...]]:
    """Join the other lines of both senses, the surer one of each, and report where they disagree."""
    joined = {(line.name, line.name or line.text): line for line in touch.others}
    named, found = {line.text for line in (*touch.others, *vision.others) if line.name}, []
    for line in vision.others:
        own = joined.get((line.name, line.name or line.text))
        box = line.box if vision.unit == touch.unit else None
        if own is not None and own.text != line.text:
            what = f"{line.name}: touch has {own.text}, the camera {line.text}"
            found.append(Finding(ReadingFlag.SENSES_DISAGREE, what))
        if own is None or line.confidence > own.confidence:
            joined[line.name, line.name or line.text] = replace(line, box=box if own is None else own.box)
    # drop unassigned text that the other sense has read as a requested line
    return tuple(line for line in joined.values() if line.name or line.text not in named), tuple(found)


def _by_vision_alone(touch: Reading, vision: Reading) -> Reading:
    """Vision's reading, which may be empty."""
    if vision.trace.lattice is None or not vision.characters:
        return replace(touch, characters=(), flags=touch.flags | ReadingFlag.NO_CHARACTERS)
    note = "touch has found no characters, so the camera alone has read it"
    return replace(vision, notes=(*vision.notes, note), seconds=_seconds(touch, vision))


def _seconds(touch: Reading, vision: Reading) -> MappingProxyType[str, float]:
    """Merge the times of both senses, step by step."""
    return MappingProxyType({**touch.seconds, **{f"vision {k}": v for k, v in vision.seconds.items()}})
