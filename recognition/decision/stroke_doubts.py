"""Doubts about the strokes of a reading: missing ones, and ones that leave two characters undecided.

The prior is ignored here: a J whose hook is filled looks like an I.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import repeat
from statistics import fmean, mode

from recognition.decision.decide import BROKEN, EXPLANATIONS, Decision, Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.reasons import places_text
from recognition.language.confusions import CharacterState
from recognition.marks.grade import Action
from recognition.marks.no_depth import NoDepth
from recognition.marks.strokes import LIVE, PlaceStrokes, RivalStrokes

_REMEDIES = {
    Action.NONE: "look at the part",
    Action.CLEAN: "clean it and scan it again",
    Action.CLEAN_FIRST: "clean it and scan it again",
    Action.RE_STRIKE: "strike it again",
}


LEFT = 0.002
"""Greatest posterior of a rival after the strokes are weighed."""
HIDDEN_MARGIN = 2.5
"""Margin, nats, from which covered strokes of a rival are no reason for doubt."""


def add_stroke_findings(reading: Reading, *, text_felt: float = 0.35) -> Reading:
    """Add findings about the strokes: most of a character is missing, or they fit a rival as well.

    Args:
        reading: with grades of its marks, and with strokes in its trace.
        text_felt: share of strokes felt below which an unreadable line is not text but dirt or land.
    """
    reading = reading.without_flags(EXPLANATIONS | ReadingFlag.NOT_WHOLE | ReadingFlag.TOO_FEW_LINES)
    felt = [place.felt for place in reading.trace.strokes if place.felt is not None]
    readable = any(
        c.state is None or c.state.state is not CharacterState.NOT_READ for c in reading.characters
    )
    if reading.decision is Decision.REJECT and not readable and felt and fmean(felt) < text_felt:
        return no_text(reading)
    return reading.with_findings(*_cut_characters(reading), *_missing(reading), *_undecided_strokes(reading))


def no_text(reading: Reading, *, least_open: float = 0.5) -> Reading:
    """The reading of a part without text: no characters, and no doubts about them.

    Text that was read with certainty but does not fit the format is named.

    Args:
        reading: reading of the part.
        least_open: probability of the text without the format above which it is named.
    """
    openly = reading.trace.open_lattice
    bare = reading.without_flags(BROKEN | EXPLANATIONS | ReadingFlag.LOW_CONFIDENCE)
    sure = openly is not None and float(openly.log_belief.max(axis=1).sum()) > math.log(least_open)
    about_format = ReadingFlag.FORMAT_OVERRULED | ReadingFlag.FORMAT_NOT_MET
    outside = [f for f in reading.findings if sure and f.flag & about_format]
    return replace(
        bare.with_findings(*(replace(f, flag=ReadingFlag.NO_CHARACTERS) for f in outside)),
        characters=(),
        confidence=0.0,
        flags=bare.flags | ReadingFlag.NO_CHARACTERS,
        box=None,
        spaces_after=frozenset(),
    )


def _cut_characters(reading: Reading) -> Iterator[Finding]:
    """Find characters that cross the edge of the area that was felt."""
    places = tuple(k for k, place in enumerate(reading.trace.strokes, start=1) if not place.whole)
    if places:
        what = f"not felt to the edge: {places_text(reading, places)} (scan a longer or wider stretch)"
        yield Finding(ReadingFlag.NOT_WHOLE, what, places)


def only_whole(reading: Reading) -> Reading:
    """Remove the grade and depth of characters that were not felt from edge to edge."""
    cut = {k for k, place in enumerate(reading.trace.strokes) if not place.whole}
    characters = (
        replace(c, grade=None, depth=None, no_depth=NoDepth.NOT_FELT) if k in cut else c
        for k, c in enumerate(reading.characters)
    )
    return replace(reading, characters=tuple(characters))


def _missing(
    reading: Reading,
    *,
    least_edges: float = 0.5,
    least_felt: float = 0.4,
    suited: float = 0.35,
    all_there: float = 0.6,
    least_foreign: int = 2,
) -> Iterator[Finding]:
    """Find characters most of whose strokes are missing, or are those of another font than the named one.

    Args:
        reading: with grades and strokes.
        least_edges: least share of a character's edges that must be there, in a font that explains the marks.
        least_felt: least share of the depth of a character's strokes that must be there, in the best-fitting font,
            which may differ from the part's.
        suited: template score from which a character counts as there, however shallow it is.
        all_there: share of strokes felt, by depth or by edges, from which none counts as missing.
        least_foreign: least number of characters that must differ from the named font: a single one may be a bad
            blow or misplaced dots.
    """
    lacking: dict[int, Action] = {}
    foreign: list[int] = []
    strokes = reading.trace.strokes or repeat(PlaceStrokes(None))
    for k, (c, place) in enumerate(zip(reading.characters, strokes, strict=False), start=1):
        edges = None if c.grade is None else c.grade.value("completeness")
        shallow = place.felt is not None and place.felt < least_felt and place.score < suited
        if shallow and (edges is None or edges < all_there):
            lacking[k] = Action.CLEAN if c.grade is None else c.grade.action
        elif c.grade is not None and edges is not None and edges < least_edges:
            if (place.felt or 0.0) >= all_there:
                foreign.append(k)
            else:
                lacking[k] = c.grade.action
    if lacking:
        remedy = _REMEDIES[mode(lacking.values())]
        what = f"most strokes are missing: {places_text(reading, [*lacking])} ({remedy})"
        yield Finding(ReadingFlag.STROKES_MISSING, what, tuple(lacking))
    laid = reading.trace.laid
    if len(foreign) >= least_foreign and laid is not None and laid.font.name != reading.font:
        what = f"another font than {reading.font} explains the marks better"
        what = f"{what}: {places_text(reading, foreign)} (name the right font)"
        yield Finding(ReadingFlag.FOREIGN_SHAPES, what, tuple(foreign))


def _undecided_strokes(reading: Reading) -> Iterator[Finding]:
    pairs = zip(reading.characters, reading.trace.strokes, strict=False)
    for k, (c, place) in enumerate(pairs, start=1):
        doubts = [(rival, why) for rival in place.rivals if (why := _why_undecided(rival))]
        if place.too_few_lines:
            likeliest = max(place.rivals, key=lambda r: r.belief, default=None)
            pair = c.char if likeliest is None else f"{c.char} or {likeliest.char}"
            what = f"{pair} at place {k}: {place.too_few_lines} (feel more lines)"
            yield Finding(ReadingFlag.TOO_FEW_LINES, what, (k,))
        elif doubts:
            rival, why = min(doubts, key=lambda one: one[0].excluded_nats)
            what = f"{c.char} or {rival.char} at place {k}: {why}"
            yield Finding(ReadingFlag.STROKES_UNDECIDED, what, (k,))


def _why_undecided(
    rival: RivalStrokes,
    *,
    distinct_heights: float = 0.25,
    least_belief: float = 0.03,
    hidden_share: float = 0.5,
) -> str:
    """Explain why strokes do not exclude a rival; empty if they do.

    Args:
        rival: with its evidence.
        distinct_heights: least length of strokes that differ between two characters if touch is to decide, character
            heights.
        least_belief: posterior from which a rival is not excluded if touch cannot decide.
        hidden_share: share of a rival's strokes that could not be felt, from which the rival is not excluded.
    """
    if rival.apart_heights < distinct_heights:
        return "touch hardly tells them apart (look at the part)" if rival.belief >= least_belief else ""
    covered = rival.more_heights >= distinct_heights and rival.hidden >= hidden_share
    if covered and rival.margin < HIDDEN_MARGIN:
        return "the strokes that tell them apart are covered (clean it and scan it again)"
    if rival.belief < LIVE or rival.excluded_nats >= -math.log(LEFT):
        return ""
    if rival.margin < 0.0:
        return "the strokes that were felt fit both (look at the part)"
    return "the strokes that tell them apart may be filled (clean it and scan it again)"
