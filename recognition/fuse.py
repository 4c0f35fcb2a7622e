"""Touch and sight read as one.

    touch.lattice ------------------------------+
        |  places, characters                   |
        v                                       v
    register --> sight at those places --> fuse_lattices --> choose under the grammar --> Reading
                 ("edges", the default),
                 or the photograph's own reading ("decision")

Asked at the places of touch, sight reads far more of a dirty line than by itself: it need not find the line.
Where the picture cannot be laid over the map, its own reading has its say instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from glyphs.glyph import Font, FontError
from glyphs.outlines import BUILTIN_FONTS, load_font
from recognition.choice import Choice, ChoiceFlag, blind_warnings, choose
from recognition.decide import CANDIDATES
from recognition.felt_line import FeltLine, felt_line
from recognition.fuse_lattices import SIGHT_ALONE, SIGHT_AT_TOUCH, Reliability, aligned, fuse_lattices, tempered
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.reader import ReaderSettings, ReadingWithEvidence
from recognition.reading import Candidate, CharacterReading, Decision, Reading, ReadingFlag
from recognition.register import Registration, matched_boxes, register, same_field
from recognition.register_line import register_line
from recognition.sight import SightReading
from recognition.sight_at import sight_at
from recognition.sight_combine import as_reading
from recognition.sight_templates import SightBasis, predict_basis
from recognition.swaps import CharacterState, state_of

Level = Literal["decision", "edges"]
DEFAULT_LEVEL: Level = "edges"
"""The better one, see `docs`; level with the other on clean parts."""
CONTRADICTS = 0.9
"""Belief in one character by touch and in another by sight, as it is tempered, from which the senses disagree."""
HOPELESS_SHARE = 0.5
"""Share of places that neither sense can read from which a part is rejected."""
LEAST_VALID_MASS = 0.02
"""Belief in all serials of the format together below which another one stands there."""
_DOUBTS = (
    ReadingFlag.LOW_CONFIDENCE
    | ReadingFlag.AMBIGUOUS
    | ReadingFlag.FOREIGN_SHAPES
    | ReadingFlag.UNREAD_MARKS
    | ReadingFlag.FORMAT_OVERRULED
    | ReadingFlag.SEARCH_EXHAUSTED
    | ReadingFlag.CHECK_BLIND
    | ReadingFlag.SENSES_DISAGREE
)
_ANEW = (
    ReadingFlag.LOW_CONFIDENCE
    | ReadingFlag.AMBIGUOUS
    | ReadingFlag.FORMAT_OVERRULED
    | ReadingFlag.SEARCH_EXHAUSTED
    | ReadingFlag.CHECK_BLIND
)


def fuse(
    touch: ReadingWithEvidence,
    sight: SightReading,
    settings: ReaderSettings,
    *,
    level: Level = DEFAULT_LEVEL,
    fonts: Sequence[Font] = (),
) -> Reading:
    """One reading of both senses; of the one that has read where the other has not.

    Args:
        touch: as felt.
        sight: as seen.
        settings: thresholds, grammar, fonts.
        level: sight asked at the places of touch ("edges"), or its own reading ("decision").
        fonts: fonts already loaded, beside those the settings name.

    Returns:
        A reading of source "fused" in the plate frame. Accepted by the settings' thresholds, and never where both
        senses are sure of different characters.
    """
    grammar = _grammar(settings)
    if touch.lattice is None or not touch.reading.characters:
        return _by_sight_alone(touch, sight, settings, grammar)
    found = fused_lattice(touch, sight, settings, level=level, fonts=fonts)
    if found is None:
        note = "the camera has read nothing; read by touch alone"
        return replace(touch.reading, source="fused", notes=(*touch.reading.notes, note))
    lattice, contradicted = found
    choice = choose(lattice, grammar)
    if not choice.text:
        return replace(touch.reading, source="fused")
    return _reading(touch.reading, touch.lattice, lattice, choice, contradicted, settings, grammar, sight)


def fused_lattice(
    touch: ReadingWithEvidence,
    sight: SightReading,
    settings: ReaderSettings,
    *,
    level: Level = DEFAULT_LEVEL,
    fonts: Sequence[Font] = (),
) -> tuple[Lattice, tuple[str, ...]] | None:
    """The beliefs of both, and where they contradict each other in words; None where sight has nothing to say."""
    felt = touch.lattice
    if felt is None:
        return None
    line = _line(touch, settings, fonts) if sight.edges is not None else None
    where = registered(touch, sight, line)
    if level == "edges" and line is not None and where is not None and where.failure is None:
        assert sight.edges is not None
        seen = seen_at(line, sight, where, _allowed(_grammar(settings), felt.n_places, line.basis.chars))
        return fuse_lattices(felt, seen, reliability=SIGHT_AT_TOUCH), _contradictions(felt, seen, SIGHT_AT_TOUCH)
    if sight.lattice is None:
        return None
    seen = sight.lattice
    if where is not None and where.failure is None:
        seen = replace(seen, boxes=tuple(where.box(b) for b in seen.boxes))
    elif seen.n_places == felt.n_places:
        seen = replace(seen, boxes=())
    return fuse_lattices(felt, seen), _contradictions(felt, seen, SIGHT_ALONE)


def registered(
    touch: ReadingWithEvidence, sight: SightReading, line: FeltLine | None = None
) -> Registration | None:
    """Sight laid over touch, by the characters felt where there are any; None without edge maps of both."""
    if touch.edge_map is None or sight.edges is None:
        return None
    starts = [np.eye(3), same_field(touch.edge_map, sight.edges)]
    if (
        touch.lattice is not None
        and sight.lattice is not None
        and touch.lattice.boxes
        and len(touch.lattice.boxes) == len(sight.lattice.boxes)
    ):
        from_boxes = matched_boxes(touch.lattice.boxes, sight.lattice.boxes)
        if from_boxes is not None:
            starts.append(from_boxes)
    if line is not None:
        return register_line(line, sight.edges, starts)
    return register(touch.edge_map, sight.edges, height_mm=touch.reading.height_mm, starts=starts)


def seen_at(
    line: FeltLine, sight: SightReading, where: Registration, allowed: NDArray[np.bool_] | None = None
) -> Lattice:
    """Posteriors of sight at the places of touch; "nothing readable" competes as a character of no edges.

    Raises:
        ValueError: sight has no edge map.
    """
    if sight.edges is None:
        raise ValueError("sight has no edge map; read the photograph first")
    evidence = sight_at(line, sight.edges, where.plate_from_photo, allowed=allowed)
    if allowed is not None:
        evidence = np.where(allowed, evidence, -np.inf)
    count = np.isfinite(evidence).sum(axis=1)
    total = np.logaddexp.reduce(evidence, axis=1)
    nothing = np.log(np.maximum(count, 1))
    return Lattice(line.basis.chars, evidence - np.logaddexp(total, nothing)[:, None])


def _line(touch: ReadingWithEvidence, settings: ReaderSettings, fonts: Sequence[Font]) -> FeltLine | None:
    """The line of touch with pictures of its font; None where that is not known or does not fit the marks."""
    if touch.lattice is None or touch.reading.height_mm <= 0.0:
        return None
    font = _font(touch.reading.font, settings, fonts)
    if font is None:
        return None
    chars = tuple(c for c in touch.lattice.chars if c in font.glyphs)
    return felt_line(
        touch.lattice,
        _basis(font, "".join(chars)),
        height_mm=touch.reading.height_mm,
        rotation_deg=touch.reading.rotation_deg,
    )


def _font(name: str, settings: ReaderSettings, fonts: Sequence[Font]) -> Font | None:
    for font in fonts:
        if font.name == name:
            return font
    for given in settings.fonts or BUILTIN_FONTS:
        try:
            font = _loaded(given)
        except FontError:
            continue
        if font.name == name:
            return font
    return None


@lru_cache(maxsize=16)
def _loaded(name: str) -> Font:
    return load_font(name)


_BASES: dict[tuple[str, str], SightBasis] = {}
_MOST_BASES = 8


def _basis(font: Font, chars: str) -> SightBasis:
    """Pictures of a font, kept from part to part."""
    key = (font.name, chars)
    if key not in _BASES:
        while len(_BASES) >= _MOST_BASES:
            _BASES.pop(next(iter(_BASES)))
        _BASES[key] = predict_basis(font, chars)
    return _BASES[key]


def _grammar(settings: ReaderSettings) -> Grammar | None:
    if settings.grammar is not None:
        return settings.grammar
    return Grammar(mask=settings.mask) if settings.mask is not None else None


def _allowed(grammar: Grammar | None, n_places: int, chars: tuple[str, ...]) -> NDArray[np.bool_] | None:
    """(places, chars) what the format lets stand where; None where it says nothing of so many places."""
    if grammar is None:
        return None
    lengths = grammar.lengths()
    if lengths is not None and n_places not in lengths:
        return None
    sets = grammar.strings(n_places, chars).places()
    table = np.array([[c in place for c in chars] for place in sets], dtype=np.bool_)
    return table if table.shape == (n_places, len(chars)) and table.any(axis=1).all() else None


def _contradictions(felt: Lattice, seen: Lattice, reliability: Reliability) -> tuple[str, ...]:
    """Where both senses are sure of different characters."""
    doubted = tempered(seen, reliability)
    out = []
    for k, j in enumerate(aligned(felt, seen)):
        if j is None:
            continue
        a, b = int(felt.log_belief[k].argmax()), int(doubted.log_belief[j].argmax())
        sure = min(felt.log_belief[k, a], doubted.log_belief[j, b]) >= np.log(CONTRADICTS)
        if sure and felt.chars[a] != doubted.chars[b]:
            out.append(f"place {k + 1}: touch has {felt.chars[a]}, the camera {doubted.chars[b]}")
    return tuple(out)


def _reading(
    told: Reading,
    felt: Lattice,
    lattice: Lattice,
    choice: Choice,
    contradicted: tuple[str, ...],
    settings: ReaderSettings,
    grammar: Grammar | None,
    sight: SightReading,
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
    flags = told.flags & ~_ANEW
    if ReadingFlag.AMBIGUOUS in told.flags and all(c.margin >= settings.accept_margin for c in told.characters):
        # not for its margins but for ink that two characters claim
        flags |= ReadingFlag.AMBIGUOUS
    if choice.probability < settings.accept_confidence:
        flags |= ReadingFlag.LOW_CONFIDENCE
    if min(c.margin for c in characters) < settings.accept_margin:
        flags |= ReadingFlag.AMBIGUOUS
    if choice.valid_mass < LEAST_VALID_MASS:
        flags |= ReadingFlag.FORMAT_OVERRULED
    if ChoiceFlag.EXHAUSTED in choice.flags:
        flags |= ReadingFlag.SEARCH_EXHAUSTED
    blind = blind_warnings(choice, grammar) if grammar is not None else ()
    if blind:
        flags |= ReadingFlag.CHECK_BLIND
    if contradicted:
        flags |= ReadingFlag.SENSES_DISAGREE
    decision = Decision.REVIEW if flags & _DOUBTS else Decision.ACCEPT
    unread = sum(c.state is not None and c.state.state is CharacterState.NOT_READ for c in characters)
    if unread >= HOPELESS_SHARE * len(characters):
        decision = Decision.REJECT
    old_blind = told.notes if ReadingFlag.CHECK_BLIND not in told.flags else ()
    return replace(
        told,
        characters=tuple(characters),
        decision=decision,
        confidence=choice.probability,
        flags=flags,
        source="fused",
        notes=(*old_blind, *blind, *contradicted),
        seconds=MappingProxyType({**told.seconds, **{f"sight {k}": v for k, v in sight.reading.seconds.items()}}),
    )


def _by_sight_alone(
    touch: ReadingWithEvidence, sight: SightReading, settings: ReaderSettings, grammar: Grammar | None
) -> Reading:
    """Sight's reading, doubted as sight is; nothing where it has read nothing either."""
    if sight.lattice is None or not sight.reading.characters:
        flags = touch.reading.flags | ReadingFlag.NO_CHARACTERS
        return replace(touch.reading, decision=Decision.REJECT, flags=flags, source="fused")
    lattice = tempered(sight.lattice, replace(SIGHT_ALONE, power=1.0))
    doubts = sight.reading.flags & ~_ANEW
    made = as_reading(lattice, settings, flags=doubts or None, source="fused")
    choice = choose(lattice, grammar)
    if choice.text and choice.text != "".join(c.char for c in made.characters):
        made = replace(made, decision=Decision.REVIEW, flags=made.flags | ReadingFlag.FORMAT_OVERRULED)
    note = "touch has found no characters; read by the camera alone"
    return replace(
        made,
        font=sight.reading.font,
        height_mm=sight.reading.height_mm,
        rotation_deg=sight.reading.rotation_deg,
        notes=(*sight.reading.notes, note),
        seconds=sight.reading.seconds,
    )
