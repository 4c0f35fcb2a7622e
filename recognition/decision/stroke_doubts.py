"""Doubts about the strokes of a reading: missing ones, and ones that leave two characters undecided.

The prior is ignored here: a J whose hook is filled looks like an I.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from recognition.decision.decide import BROKEN, Decision
from recognition.decision.flags import EXPLANATIONS, Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.reasons import places_text
from recognition.marks.grade import Action
from recognition.marks.strokes_felt import LIVE, RivalStrokes

LEAST_STROKES = 0.5
"""Least share of a character's edges that must be there, in a font that explains the marks."""
LEAST_FELT = 0.4
"""Least share of the depth of a character's strokes that must be there, in the font that fits best, which is
not quite the part's."""
SUITED = 0.35
"""Template score of a character from which the surface shows its shape, however shallow."""
ALL_THERE = 0.6
"""Share of strokes felt, by depth or by edges, from which none is missing, whatever the other share is."""
LEAST_FOREIGN = 2
"""Least number of characters that must differ from the named font: one alone is a blow, or misplaced dots."""
OTHER_FONT = 0.06
"""Mean score of a line by which another font must explain it better.

Of 24 lines of the exam whose right font was named, 19 fit it best, 3 fit another one better by less than
this, and 2 by 0.08."""
TEXT_FELT = 0.35
"""Share of strokes felt below which a mostly unreadable line is not text but dirt or land."""
READ_OPENLY = 0.5
"""Posterior of the reading without the format from which it is text, although it does not fit the format."""
RIVAL_LEFT = 0.002
"""Most posterior that a live rival may keep once the strokes are weighed."""
DISTINCT_HEIGHTS = 0.25
"""Least length of strokes that differ between two characters if touch is to decide, character heights."""
UNTOLD = 0.03
"""Posterior from which a rival is not excluded if touch cannot decide."""
HIDDEN_SHARE = 0.5
"""Share of a rival's strokes that could not be felt, from which the rival is not excluded."""
HIDDEN_MARGIN = 2.5
"""Margin from which a stroke of the other character was felt after all, nats; even a piece gives more."""
_REMEDIES = {
    Action.NONE: "look at the part",
    Action.CLEAN: "clean it and scan it again",
    Action.CLEAN_FIRST: "clean it and scan it again",
    Action.RE_STRIKE: "strike it again",
    Action.SCAN_AGAIN: "scan it again",
}


def add_stroke_findings(reading: Reading) -> Reading:
    """Add findings about the strokes: most of a character is missing, or they fit a rival as well.

    Args:
        reading: with grades of its marks, and with strokes in its trace.
    """
    reading = reading.without_flags(EXPLANATIONS | ReadingFlag.NOT_WHOLE | ReadingFlag.UNTOLD)
    felt = reading.strokes_felt
    if reading.decision is Decision.REJECT and felt is not None and felt < TEXT_FELT:
        return no_text(reading)
    found = (*_cut_characters(reading), *_missing(reading), *_undecided_strokes(reading))
    return reading.with_findings(*found)


def no_text(reading: Reading) -> Reading:
    """The reading of a part without text: it has no characters, and no doubts about them.

    Text that is surely read but does not fit the format is named.
    """
    openly, bare = (
        reading.trace.open_lattice,
        reading.without_flags(BROKEN | EXPLANATIONS | ReadingFlag.LOW_CONFIDENCE),
    )
    sure = openly is not None and float(openly.log_belief.max(axis=1).sum()) > math.log(READ_OPENLY)
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


def _missing(reading: Reading) -> Iterator[Finding]:
    strokes = reading.trace.strokes
    lacking, foreign = {}, []
    for k, c in enumerate(reading.characters):
        place = strokes[k] if k < len(strokes) else None
        edges = None if c.grade is None else (c.grade.value("completeness") or 0.0)
        shallow = place is not None and place.felt is not None and place.felt < LEAST_FELT
        if shallow and strokes[k].score < SUITED and (edges is None or edges < ALL_THERE):
            lacking[k] = Action.CLEAN if c.grade is None else c.grade.action
        elif edges is not None and edges < LEAST_STROKES:
            if place is not None and (place.felt or 0.0) >= ALL_THERE:
                foreign.append(k)
            elif c.grade is not None:
                lacking[k] = c.grade.action
    if lacking:
        remedy = _REMEDIES[max(lacking.values(), key=list(lacking.values()).count)]
        where = places_text(reading, list(lacking))
        yield Finding(
            ReadingFlag.STROKES_MISSING, f"most strokes are missing: {where} ({remedy})", _from_1(lacking)
        )
    if len(foreign) >= LEAST_FOREIGN and _another_font(reading):
        where = places_text(reading, foreign)
        what = f"another font than {reading.font} explains the marks better"
        yield Finding(ReadingFlag.FOREIGN_SHAPES, f"{what}: {where} (name the right font)", _from_1(foreign))


def _another_font(reading: Reading) -> bool:
    """Whether another font explains the whole text better than the named one."""
    line = reading.trace.felt_line
    scores = {} if line is None else line.by_font([c.char for c in reading.characters])
    named = scores.get(reading.font)
    return named is not None and max(scores.values()) >= named + OTHER_FONT


def _undecided_strokes(reading: Reading) -> Iterator[Finding]:
    for k, (c, place) in enumerate(zip(reading.characters, reading.trace.strokes, strict=False)):
        rivals = [r for r in place.rivals if _remains(r)]
        if place.untold:
            likeliest = max(place.rivals, key=lambda r: r.belief, default=None)
            pair = c.char if likeliest is None else f"{c.char} or {likeliest.char}"
            what = f"{pair} at place {k + 1}: {place.untold} (feel more lines)"
            yield Finding(ReadingFlag.UNTOLD, what, (k + 1,))
        elif rivals:
            rival = min(rivals, key=lambda r: r.excluded_nats)
            yield Finding(
                ReadingFlag.STROKES_UNDECIDED,
                f"{c.char} or {rival.char} at place {k + 1}: {_why(rival)}",
                (k + 1,),
            )


def _remains(rival: RivalStrokes) -> bool:
    """Whether a rival is not excluded."""
    if rival.apart_heights < DISTINCT_HEIGHTS:
        return rival.belief >= UNTOLD
    return (rival.belief >= LIVE and rival.excluded_nats < -math.log(RIVAL_LEFT)) or _is_hidden(rival)


def _is_hidden(rival: RivalStrokes) -> bool:
    """Whether the rival's additional strokes could not be felt, and nothing else excludes it."""
    covered = rival.more_heights >= DISTINCT_HEIGHTS and rival.hidden >= HIDDEN_SHARE
    return covered and rival.margin < HIDDEN_MARGIN


def _why(rival: RivalStrokes) -> str:
    if rival.apart_heights < DISTINCT_HEIGHTS:
        return "touch hardly tells them apart (look at the part)"
    if _is_hidden(rival):
        return "the strokes that tell them apart are covered (clean it and scan it again)"
    if rival.margin < 0.0:
        return "the strokes that were felt fit both (look at the part)"
    return "the strokes that tell them apart may be filled (clean it and scan it again)"
