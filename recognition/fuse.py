"""Touch and vision read as one.

    touch.trace.lattice ------------------+
        |  places, characters             |
        v                                 v
    register --> vision's lattice --> fuse_lattices --> choose under the grammar --> Reading

Where the photograph cannot be laid over the map, as many places are taken for the same ones.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from recognition.acceptance import CANDIDATES
from recognition.confusions import state_of
from recognition.constrained_decoding import Choice, choose
from recognition.decision import CHOICE_FLAGS, check_doubted, decided
from recognition.fuse_lattices import (
    VISION_ALONE,
    Reliability,
    contradictions,
    fuse_lattices,
    tempered,
)
from recognition.lattice import Lattice
from recognition.overlay import line_of, registered
from recognition.reader_settings import ReaderSettings
from recognition.reading import Candidate, CharacterReading, Decision, Reading, ReadingFlag, ReadingTrace
from recognition.vision_combine import as_reading

ALONE_WRONG = 0.02
"""Share of places at which the camera may be wrong whatever it believes, with no touch to compare it with."""


def fuse(
    touch: Reading,
    vision: Reading,
    settings: ReaderSettings,
) -> Reading:
    """One reading of both senses; of the one that has read where the other has not.

    Args:
        touch: the reading of touch.
        vision: the reading of vision.
        settings: thresholds, grammar, fonts.

    Returns:
        A reading of source "fused" in the plate frame, whose trace holds both. Accepted by the settings' thresholds,
        and never where both senses are sure of different characters.
    """
    made = _fused(touch, vision, settings)
    return replace(
        made, source="fused", trace=ReadingTrace(touch=touch, vision=vision, photo=vision.trace.photo)
    )


def _fused(touch: Reading, vision: Reading, settings: ReaderSettings) -> Reading:
    own = touch.trace.lattice
    if own is None or not touch.characters:
        return _by_vision_alone(touch, vision, settings)
    found = fused_lattice(touch, vision, settings)
    if found is None:
        return replace(touch, notes=(*touch.notes, "the camera has read nothing; read by touch alone"))
    lattice, contradicted = found
    choice = choose(lattice, settings.grammar)
    if not choice.text:
        return touch
    return _reading(touch, own, lattice, choice, contradicted, settings, vision)


def fused_lattice(
    touch: Reading,
    vision: Reading,
    settings: ReaderSettings,
) -> tuple[Lattice, tuple[str, ...]] | None:
    """The beliefs of both, and where they contradict each other in words; None where sight has nothing to say."""
    felt = touch.trace.lattice
    if felt is None:
        return None
    edges, seen = vision.trace.edge_map, vision.trace.lattice
    line = line_of(touch, settings) if edges is not None else None
    where = registered(touch, vision, line)
    if seen is None:
        return None
    if where is not None and where.failure is None:
        seen = replace(seen, boxes=tuple(where.box(b) for b in seen.boxes))
    elif seen.n_places == felt.n_places:
        # the frames may differ; as many places are then taken for the same ones
        seen = replace(seen, boxes=())
    else:
        return None
    return _joined(felt, seen, VISION_ALONE)


def _joined(felt: Lattice, seen: Lattice, reliability: Reliability) -> tuple[Lattice, tuple[str, ...]]:
    words = tuple(
        f"place {k + 1}: touch has {ours}, the camera {theirs}"
        for k, ours, theirs in contradictions(felt, seen, reliability=reliability)
    )
    return fuse_lattices(felt, seen, reliability=reliability), words


def _reading(
    tactile: Reading,
    felt: Lattice,
    lattice: Lattice,
    choice: Choice,
    contradicted: tuple[str, ...],
    settings: ReaderSettings,
    vision: Reading,
) -> Reading:
    """Touch's reading with the beliefs of both."""
    characters = []
    for k in range(lattice.n_places):
        # what was measured at the place stays with it
        old = tactile.characters[k] if k < len(tactile.characters) else None
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
    flags = tactile.flags & ~CHOICE_FLAGS
    if ReadingFlag.AMBIGUOUS in tactile.flags and all(
        c.margin >= settings.accept_margin for c in tactile.characters
    ):
        # not for its margins but for ink that two characters claim
        flags |= ReadingFlag.AMBIGUOUS
    if contradicted:
        flags |= ReadingFlag.SENSES_DISAGREE
    made = decided(
        characters,
        choice.probability,
        settings,
        flags=flags,
        choice=choice,
        grammar=settings.grammar,
        notes=tactile.notes if ReadingFlag.CHECK_BLIND not in tactile.flags else (),
    )
    return replace(
        tactile,
        characters=made.characters,
        decision=made.decision,
        confidence=made.confidence,
        flags=made.flags,
        notes=(*made.notes, *contradicted),
        seconds=_seconds(tactile, vision),
    )


def _by_vision_alone(touch: Reading, vision: Reading, settings: ReaderSettings) -> Reading:
    """Vision's reading, doubted as vision is; nothing where it has read nothing either."""
    seen = vision.trace.lattice
    if seen is None or not vision.characters:
        return replace(touch, decision=Decision.REJECT, flags=touch.flags | ReadingFlag.NO_CHARACTERS)
    lattice = tempered(seen, Reliability(rates=(ALONE_WRONG,)))
    made = as_reading(lattice, settings, flags=vision.flags & ~CHOICE_FLAGS)
    choice = choose(lattice, settings.grammar)
    if settings.grammar is not None:
        made = check_doubted(made, choice, settings.grammar)
    if choice.text and choice.text != "".join(c.char for c in made.characters):
        made = replace(made, decision=Decision.REVIEW, flags=made.flags | ReadingFlag.FORMAT_OVERRULED)
    note = "touch has found no characters; read by the camera alone"
    return replace(
        made,
        font=vision.font,
        height_mm=vision.height_mm,
        rotation_deg=vision.rotation_deg,
        unit=vision.unit,
        notes=tuple(dict.fromkeys((*vision.notes, *made.notes, note))),
        seconds=_seconds(touch, vision),
    )


def _seconds(touch: Reading, vision: Reading) -> MappingProxyType[str, float]:
    """What both senses took, step by step."""
    return MappingProxyType({**touch.seconds, **{f"sight {k}": v for k, v in vision.seconds.items()}})
