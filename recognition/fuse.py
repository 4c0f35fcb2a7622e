"""Touch and sight read as one.

    touch.lattice ------------------------------+
        |  places, characters                   |
        v                                       v
    register --> sight at those places --> fuse_lattices --> choose under the grammar --> Reading
                 ("edges"), or the photograph's own
                 reading ("decision", the default)

Asked at the places of touch, templates read far more of a dirty line than the camera's own reader, which must find
the line first. But that reader has a network beside its templates; fused with touch, it adds as many characters,
and more readings are accepted. Where the picture cannot be laid over the map, it speaks at either level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from glyphs.fonts.glyph import Font
from recognition.acceptance import CANDIDATES
from recognition.confusions import state_of
from recognition.constrained_decoding import Choice, blind_warnings, choose
from recognition.fuse_lattices import (
    VISION_ALONE,
    VISION_AT_TOUCH,
    Reliability,
    contradictions,
    fuse_lattices,
    tempered,
)
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.overlay import allowed_at, line_of, registered, seen_at
from recognition.reader import ReaderSettings, ReadingTrace
from recognition.reading import Candidate, CharacterReading, Decision, Reading, ReadingFlag
from recognition.verdict import CHOICE_FLAGS, choice_flags, decision_of
from recognition.vision import VisionReading
from recognition.vision_combine import as_reading

Level = Literal["decision", "edges"]
DEFAULT_LEVEL: Level = "decision"
"""As many characters right as by edges, and more readings accepted where touch is in doubt."""
ALONE_WRONG = 0.02
"""Share of places at which the camera may be wrong whatever it believes, with no touch to compare it with."""


def fuse(
    touch: ReadingTrace,
    vision: VisionReading,
    settings: ReaderSettings,
    *,
    level: Level = DEFAULT_LEVEL,
    fonts: Sequence[Font] = (),
) -> Reading:
    """One reading of both senses; of the one that has read where the other has not.

    Args:
        touch: as felt.
        vision: as seen.
        settings: thresholds, grammar, fonts.
        level: its own reading ("decision"), or sight asked at the places of touch ("edges").
        fonts: fonts already loaded, beside those the settings name.

    Returns:
        A reading of source "fused" in the plate frame. Accepted by the settings' thresholds, and never where both
        senses are sure of different characters.
    """
    grammar = _grammar(settings)
    if touch.lattice is None or not touch.reading.characters:
        return _by_vision_alone(touch, vision, settings, grammar)
    found = fused_lattice(touch, vision, settings, level=level, fonts=fonts)
    if found is None:
        note = "the camera has read nothing; read by touch alone"
        return replace(touch.reading, source="fused", notes=(*touch.reading.notes, note))
    lattice, contradicted = found
    choice = choose(lattice, grammar)
    if not choice.text:
        return replace(touch.reading, source="fused")
    return _reading(touch.reading, touch.lattice, lattice, choice, contradicted, settings, grammar, vision)


def fused_lattice(
    touch: ReadingTrace,
    vision: VisionReading,
    settings: ReaderSettings,
    *,
    level: Level = DEFAULT_LEVEL,
    fonts: Sequence[Font] = (),
) -> tuple[Lattice, tuple[str, ...]] | None:
    """The beliefs of both, and where they contradict each other in words; None where sight has nothing to say."""
    felt = touch.lattice
    if felt is None:
        return None
    line = line_of(touch, settings, fonts) if vision.edges is not None else None
    where = registered(touch, vision, line)
    if level == "edges" and line is not None and where is not None and where.failure is None:
        assert vision.edges is not None
        seen = seen_at(line, vision, where, allowed_at(_grammar(settings), felt.n_places, line.basis.chars))
        return _joined(felt, seen, VISION_AT_TOUCH)
    if vision.lattice is None:
        return None
    seen = vision.lattice
    if where is not None and where.failure is None:
        seen = replace(seen, boxes=tuple(where.box(b) for b in seen.boxes))
    elif seen.n_places == felt.n_places:
        # the frames may differ; as many places are then taken for the same ones
        seen = replace(seen, boxes=())
    else:
        return None
    return _joined(felt, seen, VISION_ALONE)


def _grammar(settings: ReaderSettings) -> Grammar | None:
    if settings.grammar is not None:
        return settings.grammar
    return Grammar(mask=settings.mask) if settings.mask is not None else None


def _joined(felt: Lattice, seen: Lattice, reliability: Reliability) -> tuple[Lattice, tuple[str, ...]]:
    words = tuple(
        f"place {k + 1}: touch has {ours}, the camera {theirs}"
        for k, ours, theirs in contradictions(felt, seen, reliability=reliability)
    )
    return fuse_lattices(felt, seen, reliability=reliability), words


def _reading(
    told: Reading,
    felt: Lattice,
    lattice: Lattice,
    choice: Choice,
    contradicted: tuple[str, ...],
    settings: ReaderSettings,
    grammar: Grammar | None,
    vision: VisionReading,
) -> Reading:
    """Touch's reading with the beliefs of both."""
    characters = []
    for k in range(lattice.n_places):
        # what was measured at the place stays with it
        old = told.characters[k] if k < len(told.characters) else None
        beliefs = choice.place(k)
        chosen = choice.text[k]
        order = [chosen, *(c for c in beliefs if c != chosen)][:CANDIDATES]
        scores = {c.char: c.score for c in old.candidates} if old is not None else {}
        candidates = tuple(Candidate(c, scores.get(c, 0.0), min(1.0, beliefs.get(c, 0.0))) for c in order)
        box = old.box if old is not None else felt.boxes[k]
        same = old is not None and old.char == chosen
        characters.append(
            CharacterReading(
                candidates,
                box,
                depth=old.depth if old is not None and same else None,
                state=state_of(beliefs),
                grade=old.grade if old is not None and same else None,
            )
        )
    flags = told.flags & ~CHOICE_FLAGS
    if ReadingFlag.AMBIGUOUS in told.flags and all(
        c.margin >= settings.accept_margin for c in told.characters
    ):
        # not for its margins but for ink that two characters claim
        flags |= ReadingFlag.AMBIGUOUS
    flags |= choice_flags(choice, grammar, characters, settings)
    blind = blind_warnings(choice, grammar) if grammar is not None else ()
    if contradicted:
        flags |= ReadingFlag.SENSES_DISAGREE
    old_blind = told.notes if ReadingFlag.CHECK_BLIND not in told.flags else ()
    return replace(
        told,
        characters=tuple(characters),
        decision=decision_of(flags, characters),
        confidence=choice.probability,
        flags=flags,
        source="fused",
        notes=(*old_blind, *blind, *contradicted),
        seconds=_seconds(told, vision),
    )


def _by_vision_alone(
    touch: ReadingTrace, vision: VisionReading, settings: ReaderSettings, grammar: Grammar | None
) -> Reading:
    """Sight's reading, doubted as sight is; nothing where it has read nothing either."""
    if vision.lattice is None or not vision.reading.characters:
        flags = touch.reading.flags | ReadingFlag.NO_CHARACTERS
        return replace(touch.reading, decision=Decision.REJECT, flags=flags, source="fused")
    lattice = tempered(vision.lattice, Reliability(rates=(ALONE_WRONG,)))
    doubts = vision.reading.flags & ~CHOICE_FLAGS
    made = as_reading(lattice, settings, flags=doubts or None, source="fused")
    choice = choose(lattice, grammar)
    if choice.text and choice.text != "".join(c.char for c in made.characters):
        made = replace(made, decision=Decision.REVIEW, flags=made.flags | ReadingFlag.FORMAT_OVERRULED)
    note = "touch has found no characters; read by the camera alone"
    return replace(
        made,
        font=vision.reading.font,
        height_mm=vision.reading.height_mm,
        rotation_deg=vision.reading.rotation_deg,
        notes=(*vision.reading.notes, note),
        seconds=_seconds(touch.reading, vision),
    )


def _seconds(felt: Reading, vision: VisionReading) -> MappingProxyType[str, float]:
    """What both senses took, step by step."""
    return MappingProxyType({**felt.seconds, **{f"sight {k}": v for k, v in vision.reading.seconds.items()}})
