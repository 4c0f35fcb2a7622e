"""Judges of the senses: what happened to scan and bench, whether touch, camera and codes agree."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.fuse_lattices import contradict, lead_nats
from recognition.decide.judges.words import places_text
from recognition.decide.reading import Reading
from recognition.decide.score import log_odds
from recognition.language.code_text import holds
from recognition.see.spots import spots_on


def log_of_sense(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report faults of the scan, the bench and the stage."""
    for sense in choice.senses:
        yield from sense.log.findings


def search_stopped(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report a search that a time limit cut short, unless a sense whose search is whole accepts the same text."""
    for sense in choice.senses:
        whole = (choice.alone[other.source] for other in choice.senses if not other.log.stopped)
        if sense.log.stopped and not any(w.serial_is_sure and w.plain_text == choice.text for w in whole):
            yield Finding(ReadingFlag.SEARCH_STOPPED, f"the search {sense.log.stopped} (allow more time)")


def spots(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report characters of the photograph on which a glint or a spot lies, unless touch is sure of the text alone."""
    if evidence.vision is None or evidence.vision.log.photo is None or choice.scored_as == "tactile":
        return
    felt, seen = (choice.alone.get(source) for source in ("tactile", "vision"))
    if felt is not None and felt.serial_is_sure and felt.plain_text == choice.text:
        return
    characters = choice.characters if seen is None else seen.characters
    covered = spots_on(evidence.vision.log.photo, [place.box for place in characters])
    places = tuple(int(place) + 1 for place in np.flatnonzero(covered))
    if places:
        text = "".join(place.char for place in characters)
        what = f"a glint or a spot lies on {places_text(text, places)} (move the lamp, or clean the part)"
        yield Finding(ReadingFlag.SPOT, what, places)


def senses_together(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Note that one sense alone has read the part, though both have looked."""
    if not choice.alone or choice.is_fused:
        return
    if choice.sense.source == "vision":
        note = "touch has found no characters, so the camera alone has read it"
    elif not choice.characters:
        return
    else:
        text = choice.alone["vision"].text
        seen = f"{text}, which has another number of characters" if text else "nothing"
        note = f"the camera has read {seen}; read by touch alone"
    yield Finding(ReadingFlag.NONE, note)


def lines_disagree(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report requested lines that touch and camera read differently."""
    if not choice.is_fused:
        return
    felt = {line.key: line.text for line in choice.alone["tactile"].others}
    for line in choice.alone["vision"].others:
        text = felt.get(line.key, line.text)
        if text != line.text:
            what = f"{line.name}: touch has {text}, the camera {line.text}"
            yield Finding(ReadingFlag.SENSES_DISAGREE, what)


def senses_disagree(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    sure: float = 0.97,
    # ratio of a sense's probabilities of its text and of the fused one from which it is sure of its text. Dirt makes
    # the camera take two characters for others at ten to one each; from 300 on it is not dirt.
    ratio: float = 300.0,
) -> Iterator[Finding]:
    """Report a sense that is sure of another text than the fused one: it may have read another part.

    A sense is sure of its text if its score says so, or if it holds the text for far likelier than the fused one. They
    also disagree if both are sure of different characters at one place: serials of one lot often differ at one only.
    """
    if not choice.alone:
        return
    touch, vision = choice.alone["tactile"], choice.alone["vision"]
    (camera_text, camera_lead), (touch_text, touch_lead) = (
        _text_and_lead(reading, choice.text) for reading in (vision, touch)
    )
    if not camera_text or not touch_text or camera_text == touch_text:
        return
    nats = math.log(ratio)
    outvoted = (
        text != choice.text and (reading.confidence >= sure or lead > nats)
        for reading, text, lead in ((vision, camera_text, camera_lead), (touch, touch_text, touch_lead))
    )
    lattices = [
        reading.trace.lattice
        for reading in (touch, vision)
        if reading.characters and reading.trace.lattice is not None and len(camera_text) == len(touch_text)
    ]
    if not any(outvoted) and not (len(lattices) == 2 and contradict(*lattices)):
        return
    pairs = zip(camera_text, touch_text, strict=False)
    places = tuple(k for k, (seen, felt) in enumerate(pairs, start=1) if seen != felt)
    what = f"camera reads {vision.text}, touch {touch.text or touch_text}: are they of one part?"
    same_length = len(camera_text) == len(touch_text)
    yield Finding(ReadingFlag.SENSES_DISAGREE, what, places if same_length else ())


def _text_and_lead(reading: Reading, text: str, *, least_places: int = 4) -> tuple[str, float]:
    read_text, trace = reading.plain_text, reading.trace
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


def code_disagrees(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report codes that hold another serial, unless one holds this serial."""
    held = [holds(code.text, choice.spaced_text) for code in choice.codes]
    if not choice.characters or True in held:
        return
    for code, same in zip(choice.codes, held, strict=True):
        if same is False:
            what = f"the {code.kind} holds “{code.text}”, the marks read “{choice.spaced_text}” (look at the part)"
            yield Finding(ReadingFlag.CODE_DISAGREES, what)
