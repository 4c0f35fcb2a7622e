"""From evidence to a reading: posteriors, the grammar's choice, and accept, review or reject.

    LineEvidence --calibrate--> Lattice --choose under the grammar--> Choice --> Reading

Accepted is only what is sure (the probability of the whole serial), stands clear of its rivals at every place,
is of the font's own shapes where the surface is clean, and leaves nothing beside it unread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recognition.acceptance import (
    ACCEPT_MEAN_SCORE,
    CANDIDATES,
    Decided,
    ScoredLine,
    beliefs,
    crowded,
    word_gaps,
)
from recognition.box import Box
from recognition.calibrate import DEFAULT_WEIGHTS, Scored, Weights, lattice_of, residual_of
from recognition.confusions import state_of
from recognition.constrained_decoding import Choice, choose
from recognition.decision import Thresholds, decided
from recognition.evidence import LineEvidence
from recognition.frames import LineImage
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.place_evidence import PlaceEvidence
from recognition.reading import Candidate, CharacterReading, Decision, Reading, ReadingFlag
from recognition.refine import Cell
from recognition.search import LineFit
from recognition.template_variants import TemplateVariants
from recognition.templates import TemplateSet

SAME_PLACE_HEIGHTS = 0.3
"""A correlation counts for a place if it was taken no further away."""
CLEAN_SCORE, CLEAN_QUANTILE = 0.8, 0.75
"""A quarter of the characters must correlate so well: dirt spoils some of them, a foreign font all."""
COUNTED_WORST = 0.85
"""Least correlation of every character where no format limits what it may be."""
BESIDE_SHARE = 0.42
"""Share of its ideal that a template may reach beside the line before something is held to be unread."""
UNTROUBLED_SCORE, UNTROUBLED_MARGIN = 0.9, 0.98


@dataclass(frozen=True, eq=False)
class RobustReading:
    """A reading by evidence and what it rests on.

    Attributes:
        reading: the answer.
        lattice: beliefs of the places, before the grammar.
        choice: what the grammar made of them.
        judged: line, templates and one cell a character, as `decide` has them.
    """

    reading: Reading
    lattice: Lattice
    choice: Choice
    judged: ScoredLine


def read_robustly(
    evidence: LineEvidence,
    judged: ScoredLine,
    image: LineImage,
    *,
    grammar: Grammar | None,
    gaps: frozenset[int] | None,
    settings: Thresholds,
    flags: ReadingFlag = ReadingFlag.NONE,
    weights: Weights = DEFAULT_WEIGHTS,
) -> RobustReading | None:
    """The reading that the evidence of a line makes; None where no serial of the grammar can be made of it.

    Args:
        evidence: of the line's places.
        judged: the line as correlation has it: its cells' scores join the evidence.
        image: line image at the edge map's own pitch.
        grammar: what the serial obeys.
        gaps: places before word gaps, if the format says; found out otherwise.
        settings: thresholds of acceptance.
        flags: known of the scan.
        weights: what the scores are worth.
    """
    line, templates, cells = judged
    height = line.hypothesis.height_mm
    near = [_nearest(cells, place, height) for place in evidence.places]
    scored = [_scored(place, cell) for place, cell in zip(evidence.places, near, strict=True)]
    found = tuple(_cell(place, cell) for place, cell in zip(evidence.places, near, strict=True))
    boxes = tuple(_box(image, cell, height) for cell in found)
    spaces = gaps if gaps is not None else word_gaps(found, height)
    lattice = lattice_of(templates.chars, scored, boxes=boxes, spaces_after=spaces, weights=weights)
    choice = choose(lattice, grammar)
    if not choice.text:
        return None
    characters = tuple(_character(k, choice, lattice, evidence.places[k]) for k in range(len(found)))
    if _foreign_shapes(choice, templates, near, counted=gaps is None):
        flags |= ReadingFlag.FOREIGN_SHAPES
    if crowded(found, height):
        flags |= ReadingFlag.AMBIGUOUS
    if evidence.beside > BESIDE_SHARE:
        flags |= ReadingFlag.UNREAD_MARKS
    reading = decided(
        characters,
        choice.probability,
        settings,
        flags=flags,
        choice=choice,
        grammar=grammar,
        font=templates.font,
        height_mm=height,
        rotation_deg=line.hypothesis.rotation_deg,
        raised=line.raised,
        box=_hull(boxes),
        spaces_after=spaces,
    )
    return RobustReading(reading, lattice, choice, (line, templates, found))


def _nearest(cells: Sequence[Cell], place: PlaceEvidence, height_mm: float) -> Cell | None:
    close = [c for c in cells if abs(c.u_mm - place.u_mm) < SAME_PLACE_HEIGHTS * height_mm]
    return min(close, key=lambda c: abs(c.u_mm - place.u_mm), default=None)


def _scored(place: PlaceEvidence, cell: Cell | None) -> Scored:
    residual = residual_of(cell.scores) if cell is not None else np.zeros(place.evidence.size)
    return Scored(evidence=place.evidence, residual=residual, ideal=place.ideal)


def _cell(place: PlaceEvidence, cell: Cell | None) -> Cell:
    """The place as a cell; correlations where there are any, the share of evidence elsewhere."""
    share = np.clip(place.evidence / np.maximum(place.ideal, 1e-9), -1.0, 1.0)
    return Cell(
        scores=cell.scores if cell is not None else share,
        u_mm=place.u_mm,
        v_mm=place.v_mm,
        turn_deg=place.turn_deg,
        half_width_mm=place.half_width_mm,
    )


def _box(image: LineImage, cell: Cell, height_mm: float) -> Box:
    half, tall = cell.half_width_mm, 0.5 * height_mm
    return image.plate_box(cell.u_mm - half, cell.v_mm - tall, cell.u_mm + half, cell.v_mm + tall)


def _hull(boxes: Sequence[Box]) -> Box:
    return Box(
        min(b.x0_mm for b in boxes),
        min(b.y0_mm for b in boxes),
        max(b.x1_mm for b in boxes),
        max(b.y1_mm for b in boxes),
    )


def _character(k: int, choice: Choice, lattice: Lattice, place: PlaceEvidence) -> CharacterReading:
    """The chosen character first, its rivals as the grammar leaves them."""
    beliefs = choice.place(k)
    chosen = choice.text[k]
    share = np.clip(place.evidence / np.maximum(place.ideal, 1e-9), -1.0, 1.0)
    order = [chosen, *(c for c in beliefs if c != chosen)][:CANDIDATES]
    candidates = tuple(
        Candidate(c, float(share[lattice.chars.index(c)]), float(beliefs.get(c, 0.0))) for c in order
    )
    return CharacterReading(candidates=candidates, box=lattice.boxes[k], state=state_of(beliefs))


def _foreign_shapes(
    choice: Choice, templates: TemplateSet, near: Sequence[Cell | None], *, counted: bool
) -> bool:
    """Whether too few characters have the font's own shapes; where no format counts them, nearly all must."""
    scores = [
        float(cell.scores[templates.chars.index(char)]) if cell is not None else 0.0
        for cell, char in zip(near, choice.text, strict=True)
    ]
    if not scores or float(np.quantile(scores, CLEAN_QUANTILE)) < CLEAN_SCORE:
        return True
    return counted and (float(np.mean(scores)) < ACCEPT_MEAN_SCORE or min(scores) < COUNTED_WORST)


def is_crisp(line: LineFit) -> bool:
    """Whether a line is of a font's own shapes, which evidence can be summed for."""
    h = line.hypothesis
    return not (h.soften > 0.0 or h.free_widths)


def untroubled(decided: Decided, grammar: Grammar | None) -> bool:
    """Whether correlation alone settles the line: every shape is its template's, and the format is a plain format.

    Without a format nothing says how many characters there are, and a faint one may be taken for a gap.
    """
    plain = grammar is not None and grammar == Grammar(format=grammar.format)
    return (
        plain
        and decided.judged is not None
        and decided.reading.decision is Decision.ACCEPT
        and min(c.candidates[0].score for c in decided.reading.characters) > UNTROUBLED_SCORE
        and min(c.margin for c in decided.reading.characters) > UNTROUBLED_MARGIN
    )


def lattice_of_reading(decided: Decided) -> Lattice | None:
    """The lattice of a line that correlation alone has read, over all characters that there are templates of."""
    if decided.judged is None:
        return None
    reading, (_, templates, cells) = decided.reading, decided.judged
    if len(cells) != len(reading.characters):
        return None
    copies = TemplateVariants(templates.chars)
    chars = tuple(str(char) for char in copies.chars)
    rows = []
    for character, cell in zip(reading.characters, cells, strict=True):
        belief = beliefs(copies.best(cell.scores))
        # what stands in the way of belief in the leader stands in the way of all of them
        readable = sum(c.probability for c in character.candidates)
        rows.append(np.log(np.maximum(min(readable, 1.0) * belief, 1e-12)) - 1e-9)
    boxes = tuple(c.box for c in reading.characters)
    log = np.minimum(np.stack(rows), 0.0)
    log = log - np.maximum(np.log(np.exp(log).sum(axis=1, keepdims=True)), 0.0)
    return Lattice(chars, log, boxes, reading.spaces_after)
