"""Doubts about the strokes of a reading: missing ones, and ones that leave two characters undecided.

The prior is ignored here: a J whose hook is filled looks like an I.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from pydantic.dataclasses import dataclass as checked

from recognition.decision.decide import Decision
from recognition.decision.flags import BROKEN, EXPLANATIONS, Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.reasons import places_text
from recognition.marks.grade import Action
from recognition.marks.strokes_felt import LIVE, RivalStrokes
from recognition.ranges import Chance

_REMEDIES = {
    Action.NONE: "look at the part",
    Action.CLEAN: "clean it and scan it again",
    Action.CLEAN_FIRST: "clean it and scan it again",
    Action.RE_STRIKE: "strike it again",
}


@dataclass(frozen=True, kw_only=True)
class MissingLimits:
    """Limits from which strokes of a character are missing, or are those of another font.

    Attributes:
        least_edges: least share of a character's edges that must be there, in a font that explains the marks.
        least_felt: least share of the depth of a character's strokes that must be there, in the font that fits best,
            which is not quite the part's.
        suited: template score of a character from which the surface shows its shape, however shallow.
        all_there: share of strokes felt, by depth or by edges, from which none is missing, whatever the other share is.
        least_foreign: least number of characters that must differ from the named font: one alone is a blow, or
            misplaced dots.
        other_font: mean score of a line by which another font must explain it better. Of 24 lines of the exam whose
            right font was named, 19 fit it best, 3 fit another one better by less than this, and 2 by 0.08.
    """

    least_edges: float = 0.5
    least_felt: float = 0.4
    suited: float = 0.35
    all_there: float = 0.6
    least_foreign: int = 2
    other_font: float = 0.06


@checked(frozen=True, kw_only=True)
class RivalLimits:
    """Limits from which strokes do not exclude a rival of a character.

    Attributes:
        left: most posterior that a live rival may keep once the strokes are weighed.
        distinct_heights: least length of strokes that differ between two characters if touch is to decide, character
            heights.
        least_belief: posterior from which a rival is not excluded if touch cannot decide.
        hidden_share: share of a rival's strokes that could not be felt, from which the rival is not excluded.
        hidden_margin: margin from which a stroke of the other character was felt after all, nats; even a piece
            gives more.

    Raises:
        ValueError: a number out of its range.
    """

    left: Chance = 0.002
    distinct_heights: float = 0.25
    least_belief: float = 0.03
    hidden_share: float = 0.5
    hidden_margin: float = 2.5


RIVAL_LIMITS = RivalLimits()


def add_stroke_findings(
    reading: Reading,
    *,
    text_felt: float = 0.35,
    missing: MissingLimits = MissingLimits(),
    rivals: RivalLimits = RIVAL_LIMITS,
) -> Reading:
    """Add findings about the strokes: most of a character is missing, or they fit a rival as well.

    Args:
        reading: with grades of its marks, and with strokes in its trace.
        text_felt: share of strokes felt below which a mostly unreadable line is not text but dirt or land.
        missing: limits from which strokes are missing.
        rivals: limits from which a rival is not excluded.
    """
    reading = reading.without_flags(EXPLANATIONS | ReadingFlag.NOT_WHOLE | ReadingFlag.TOO_FEW_LINES)
    felt = reading.strokes_felt
    if reading.decision is Decision.REJECT and felt is not None and felt < text_felt:
        return no_text(reading)
    found = (*_cut_characters(reading), *_missing(reading, missing), *_undecided_strokes(reading, rivals))
    return reading.with_findings(*found)


def no_text(reading: Reading, *, least_open: float = 0.5) -> Reading:
    """The reading of a part without text: it has no characters, and no doubts about them.

    Text that is surely read but does not fit the format is named.

    Args:
        reading: of the part.
        least_open: posterior of the reading without the format from which it is text, although it does not fit the
            format.
    """
    openly, bare = (
        reading.trace.open_lattice,
        reading.without_flags(BROKEN | EXPLANATIONS | ReadingFlag.LOW_CONFIDENCE),
    )
    sure = openly is not None and float(openly.log_belief.max(axis=1).sum()) > math.log(least_open)
    outside = [f for f in reading.findings if sure and f.flag is ReadingFlag.FORMAT_OVERRULED]
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
    places = [k for k, place in enumerate(reading.trace.strokes) if not place.whole]
    if places:
        where = places_text(reading, places)
        yield Finding(
            ReadingFlag.NOT_WHOLE,
            f"not felt to the edge: {where} (scan a longer or wider stretch)",
            _from_1(places),
        )


def _from_1(places: Iterable[int]) -> tuple[int, ...]:
    return tuple(k + 1 for k in places)


def only_whole(reading: Reading) -> Reading:
    """Remove the grade and depth of characters that were not felt from edge to edge."""
    places = reading.trace.strokes
    if all(place.whole for place in places):
        return reading
    characters = (
        c if place.whole else replace(c, grade=None, depth=None)
        for c, place in zip(reading.characters, places, strict=True)
    )
    return replace(reading, characters=tuple(characters))


def _missing(reading: Reading, limits: MissingLimits) -> Iterator[Finding]:
    strokes = reading.trace.strokes
    lacking, foreign = {}, []
    for k, c in enumerate(reading.characters):
        place = strokes[k] if k < len(strokes) else None
        edges = None if c.grade is None else c.grade.value("completeness")
        shallow = place is not None and place.felt is not None and place.felt < limits.least_felt
        if shallow and strokes[k].score < limits.suited and (edges is None or edges < limits.all_there):
            lacking[k] = Action.CLEAN if c.grade is None else c.grade.action
        elif edges is not None and edges < limits.least_edges:
            if place is not None and (place.felt or 0.0) >= limits.all_there:
                foreign.append(k)
            elif c.grade is not None:
                lacking[k] = c.grade.action
    if lacking:
        remedy = _REMEDIES[max(lacking.values(), key=list(lacking.values()).count)]
        where = places_text(reading, list(lacking))
        yield Finding(
            ReadingFlag.STROKES_MISSING, f"most strokes are missing: {where} ({remedy})", _from_1(lacking)
        )
    if len(foreign) >= limits.least_foreign and _another_font(reading, limits.other_font):
        where = places_text(reading, foreign)
        what = f"another font than {reading.font} explains the marks better"
        yield Finding(ReadingFlag.FOREIGN_SHAPES, f"{what}: {where} (name the right font)", _from_1(foreign))


def _another_font(reading: Reading, lead: float) -> bool:
    """Whether another font explains the whole text better than the named one, by this mean score."""
    line = reading.trace.felt_line
    scores = {} if line is None else line.by_font([c.char for c in reading.characters])
    named = scores.get(reading.font)
    return named is not None and max(scores.values()) >= named + lead


def _undecided_strokes(reading: Reading, limits: RivalLimits) -> Iterator[Finding]:
    for k, (c, place) in enumerate(zip(reading.characters, reading.trace.strokes, strict=False)):
        rivals = [r for r in place.rivals if _remains(r, limits)]
        if place.too_few_lines:
            likeliest = max(place.rivals, key=lambda r: r.belief, default=None)
            pair = c.char if likeliest is None else f"{c.char} or {likeliest.char}"
            what = f"{pair} at place {k + 1}: {place.too_few_lines} (feel more lines)"
            yield Finding(ReadingFlag.TOO_FEW_LINES, what, (k + 1,))
        elif rivals:
            rival = min(rivals, key=lambda r: r.excluded_nats)
            yield Finding(
                ReadingFlag.STROKES_UNDECIDED,
                f"{c.char} or {rival.char} at place {k + 1}: {_why(rival, limits)}",
                (k + 1,),
            )


def _remains(rival: RivalStrokes, limits: RivalLimits) -> bool:
    """Whether a rival is not excluded."""
    if rival.apart_heights < limits.distinct_heights:
        return rival.belief >= limits.least_belief
    live = rival.belief >= LIVE and rival.excluded_nats < -math.log(limits.left)
    return live or _is_hidden(rival, limits)


def _is_hidden(rival: RivalStrokes, limits: RivalLimits) -> bool:
    """Whether the rival's additional strokes could not be felt, and nothing else excludes it."""
    covered = rival.more_heights >= limits.distinct_heights and rival.hidden >= limits.hidden_share
    return covered and rival.margin < limits.hidden_margin


def _why(rival: RivalStrokes, limits: RivalLimits) -> str:
    if rival.apart_heights < limits.distinct_heights:
        return "touch hardly tells them apart (look at the part)"
    if _is_hidden(rival, limits):
        return "the strokes that tell them apart are covered (clean it and scan it again)"
    if rival.margin < 0.0:
        return "the strokes that were felt fit both (look at the part)"
    return "the strokes that tell them apart may be filled (clean it and scan it again)"
