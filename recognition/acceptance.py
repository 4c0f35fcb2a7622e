"""From scores to a reading: beliefs, confidence, and accept, review or reject."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from glyphs.stamping.die import Face
from recognition.decision import Thresholds, decided
from recognition.reading import Candidate, CharacterReading, Reading, ReadingFlag
from recognition.refine import Cell
from recognition.search import LineFit
from recognition.template_variants import TemplateVariants
from recognition.templates import TemplateSet

INDEPENDENT_SAMPLES = 40.0
"""Independent values in a cell: residuals of neighbouring pixels go together."""
MIN_LINE_SCORE = 0.58
"""Lines whose characters correlate less on average are no text."""
TRUST_SCORE = 0.62
TRUST_WIDTH = 0.04
ACCEPT_MEAN_SCORE = 0.84
ACCEPT_WORST_SCORE = 0.72
"""A line that its templates fit less well is of another font or hand; it is never accepted unseen."""
END_SHARE, FOREIGN_END_SHARE = 0.72, 0.86
"""Of the median score, which the first and last character of a line of unknown length must reach.

Stricter where the font is not the mark's own: there, things beside the line pass for characters more easily."""
SWAP = {"0": "O", "O": "0", "1": "I", "I": "1"}
SWAP_SCORE = 0.08
"""Characters that fonts tell apart in different ways, and the lead in score within which context decides."""
CROWDED_HEIGHTS = 0.12
CANDIDATES = 5
UNREAD_WIDTH_HEIGHTS, UNREAD_REACH_HEIGHTS, UNREAD_SHARE = 0.3, 2.0, 0.2
"""How wide a window is looked at beside the characters, how far, and the energy that counts as a mark."""
WORD_GAP_HEIGHTS = 0.6
WORD_STEP = 1.3


ScoredLine = tuple[LineFit, TemplateSet, tuple[Cell, ...]]


class Decided(NamedTuple):
    """A reading and what it rests on.

    Attributes:
        reading: the answer.
        support_mm: length of line that the templates explain, weighted by how well.
        judged: the line that was read, a cell a character; None when none was.
    """

    reading: Reading
    support_mm: float
    judged: ScoredLine | None


def beliefs(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probabilities of candidates from their correlations, (T,) -> (T,), if one of them is the truth.

    A template with correlation r leaves the share 1 - r^2 of the cell's energy as residual; for n independent
    Gaussian residuals the likelihood goes as (1 - r^2)^(-n/2).
    """
    residual = np.log(np.maximum(1.0 - np.clip(scores, 0.0, 0.9999) ** 2, 1e-6))
    exponent = -0.5 * INDEPENDENT_SAMPLES * (residual - residual.min())
    weight = np.exp(exponent)
    return np.asarray(weight / weight.sum())


def decide(
    judged: Sequence[ScoredLine],
    *,
    places: Sequence[str] | None,
    gaps: frozenset[int],
    settings: Thresholds,
    flags: ReadingFlag = ReadingFlag.NONE,
) -> Decided:
    """The reading of the line that its cells support best."""
    if places is None:
        judged = [
            (line, templates, trimmed(cells, share=FOREIGN_END_SHARE if _foreign(line) else END_SHARE))
            for line, templates, cells in judged
        ]
    line, templates, cells = max(judged, key=lambda j: _support(j, places))
    support = _support((line, templates, cells), places)
    copies = TemplateVariants(templates.chars)
    chars = copies.chars
    results, confidence = [], 1.0
    mean_score, worst = 0.0, 1.0
    for k, cell in enumerate(cells):
        allowed = (
            np.array([c in places[k] for c in chars])
            if places is not None
            else np.ones(chars.size, dtype=bool)
        )
        scores = np.where(allowed, copies.best(cell.scores), -1.0)
        belief = beliefs(scores)
        order = np.argsort(-scores)[: min(CANDIDATES, int(allowed.sum()))]
        best = float(scores[order[0]])
        trust = 1.0 / (1.0 + math.exp(-(best - TRUST_SCORE) / TRUST_WIDTH))
        shared = trust * belief
        candidates = tuple(Candidate(str(chars[i]), float(scores[i]), float(shared[i])) for i in order)
        half, tall = cell.half_width_mm, 0.5 * line.hypothesis.height_mm
        box = line.image.plate_box(cell.u_mm - half, cell.v_mm - tall, cell.u_mm + half, cell.v_mm + tall)
        character = CharacterReading(candidates=candidates, box=box)
        results.append(character)
        confidence *= character.confidence
        mean_score += best / len(cells)
        worst = min(worst, best)
    if mean_score < MIN_LINE_SCORE or not results:
        return Decided(decided((), 0.0, settings, flags=flags), 0.0, None)
    gaps_found = gaps if places is not None else word_gaps(cells, line.hypothesis.height_mm)
    if _foreign(line) or mean_score < ACCEPT_MEAN_SCORE or worst < ACCEPT_WORST_SCORE:
        flags |= ReadingFlag.FOREIGN_SHAPES
    if crowded(cells, line.hypothesis.height_mm):
        flags |= ReadingFlag.AMBIGUOUS
    if unread_marks(line, cells):
        flags |= ReadingFlag.UNREAD_MARKS
    tall = 0.5 * line.hypothesis.height_mm
    whole = line.image.plate_box(
        cells[0].u_mm - cells[0].half_width_mm,
        min(c.v_mm for c in cells) - tall,
        cells[-1].u_mm + cells[-1].half_width_mm,
        max(c.v_mm for c in cells) + tall,
    )
    reading = decided(
        results,
        confidence,
        settings,
        flags=flags,
        font=templates.font,
        height_mm=line.hypothesis.height_mm,
        rotation_deg=line.hypothesis.rotation_deg,
        raised=line.raised,
        box=whole,
        spaces_after=gaps_found,
    )
    if places is None and _foreign(line):
        reading = replace(reading, characters=tuple(swapped(results, gaps_found)))
    return Decided(reading, support, (line, templates, cells))


def _support(judged: ScoredLine, places: Sequence[str] | None) -> float:
    """Length of line explained, weighted by the squared correlations of the second look."""
    line, templates, cells = judged
    total = 0.0
    for k, cell in enumerate(cells):
        scores = cell.scores
        if places is not None:
            scores = scores[[c in places[k] for c in templates.chars]]
        best = float(scores.max(initial=0.0))
        total += (2.0 * cell.half_width_mm + 0.1 * line.hypothesis.height_mm) * (best * abs(best) - 0.25)
    return total


def swapped(characters: list[CharacterReading], gaps: frozenset[int]) -> list[CharacterReading]:
    """Figures that look like a letter, among letters, and the reverse, in a font we have not got.

    Which of 0 and O, 1 and I is the wider or has the flag differs from font to font, so there the rest of the
    word decides between the two, if it is all of one kind and the scores are close.
    """
    out = list(characters)
    starts = [0, *(g + 1 for g in sorted(gaps)), len(characters)]
    for first, last in pairwise(starts):
        for k in range(first, last):
            others = [characters[i].char for i in range(first, last) if i != k]
            partner = SWAP.get(characters[k].char)
            if (
                partner is None
                or len(others) < 2
                or not all(o.isalpha() == partner.isalpha() for o in others)
            ):
                continue
            rest = [c for c in characters[k].candidates if c.char == partner]
            if rest and characters[k].candidates[0].score - rest[0].score < SWAP_SCORE:
                kept = [c for c in characters[k].candidates if c.char != partner]
                out[k] = replace(characters[k], candidates=(rest[0], *kept))
    return out


def _foreign(line: LineFit) -> bool:
    """Whether only templates of dots, or softened or widened at will, fit the line.

    Dots leave the shape between them open: neighbouring strokes can be told apart too seldom to accept unseen.
    """
    h = line.hypothesis
    return h.soften > 0.0 or h.free_widths or h.face is Face.DOTTED


def trimmed(cells: tuple[Cell, ...], *, share: float) -> tuple[Cell, ...]:
    """Without the cells at either end that fit far worse than the line: what lies beside it, taken for a character."""
    kept = list(cells)
    while len(kept) > 1:
        best = [float(c.scores.max()) for c in kept]
        floor = share * float(np.median(best))
        if best[0] < floor:
            kept.pop(0)
        elif best[-1] < floor:
            kept.pop()
        else:
            break
    return tuple(kept)


def crowded(cells: Sequence[Cell], height_mm: float) -> bool:
    """Whether neighbours claim the same ink: one mark read as two characters."""
    overlap = [a.u_mm + a.half_width_mm - b.u_mm + b.half_width_mm for a, b in pairwise(cells)]
    return max(overlap, default=0.0) > CROWDED_HEIGHTS * height_mm


def unread_marks(line: LineFit, cells: Sequence[Cell]) -> bool:
    """Whether the line goes on where nothing was read: a character missed is worse than one in doubt.

    The image's energy in the rows of the line, in windows of a third of a height beside the cells, against the
    least energy so wide a window has in a cell's middle.
    """
    image, height = line.image, line.hypothesis.height_mm
    _, rows, cols = image.channels.shape
    v_mm = float(np.median([c.v_mm for c in cells]))
    row = (v_mm - image.origin_mm[1]) / image.pitch_v_mm
    half = 0.45 * height / image.pitch_v_mm
    band = image.channels[:, max(0, round(row - half)) : min(rows, round(row + half) + 1)]
    energy = (band.astype(np.float64) ** 2).sum(axis=(0, 1))
    width = max(3, round(UNREAD_WIDTH_HEIGHTS * height / image.pitch_u_mm))
    if cols <= width:
        return False
    window = np.convolve(energy, np.ones(width), mode="same")
    u = image.origin_mm[0] + np.arange(cols) * image.pitch_u_mm
    free = np.ones(cols, dtype=np.bool_)
    weakest = np.inf
    for c in cells:
        inside = np.abs(u - c.u_mm) <= c.half_width_mm + 0.1 * height
        free &= ~(np.abs(u - c.u_mm) <= c.half_width_mm + (0.1 + 0.5 * UNREAD_WIDTH_HEIGHTS) * height)
        if inside.any():
            weakest = min(weakest, float(window[inside].max()))
    near = (u > cells[0].u_mm - UNREAD_REACH_HEIGHTS * height) & (
        u < cells[-1].u_mm + UNREAD_REACH_HEIGHTS * height
    )
    near &= (u > u[0] + 0.3 * height) & (u < u[-1] - 0.3 * height)
    return bool((free & near).any() and window[free & near].max() > UNREAD_SHARE * weakest)


def word_gaps(cells: Sequence[Cell], height_mm: float) -> frozenset[int]:
    """Places after which a gap stands out: wide in itself and against the line's usual one."""
    if len(cells) < 2:
        return frozenset()
    gap = np.array([b.u_mm - b.half_width_mm - a.u_mm - a.half_width_mm for a, b in pairwise(cells)])
    step = np.array([b.u_mm - a.u_mm for a, b in pairwise(cells)])
    wide = (gap > WORD_GAP_HEIGHTS * height_mm) & (gap > float(np.median(gap)) + 0.35 * height_mm)
    # between narrow characters the land is wide, but their middles are no further apart than others
    apart = step > WORD_STEP * float(np.median(step))
    return frozenset(int(i) for i in np.flatnonzero(wide & apart))
