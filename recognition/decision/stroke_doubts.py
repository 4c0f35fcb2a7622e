"""Doubts about the strokes of a reading: those that are missing, and those that leave two characters undecided.

The prior does not count here: a J whose hook is filled looks like an I.
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

LEAST_STROKES, LEAST_FELT = 0.5, 0.4
"""Share of a character's strokes that must be there: of the edges of a font that explains the marks, and of the depth
of the strokes of whichever font suits best, which is not quite the part's."""
SUITED = 0.35
"""Score of a font's character over the surface from which there is something in its shape, however shallow."""
ALL_THERE = 0.6
"""Share of strokes felt, by their depth or by their edges, from which none is missing whatever the other says."""
LEAST_FOREIGN = 2
"""Characters that must differ from the font that was named: one alone is a blow, or dots that fell otherwise."""
OTHER_FONT = 0.06
"""Mean score of a line by which another font must explain it better. Of 24 lines of the exam whose right font was named
19 lie best in it, 3 better in another by less than this, and 2 by 0.08."""
TEXT_FELT = 0.35
"""Share of strokes felt below which a line of which most cannot be read is none: dirt, and land."""
READ_OPENLY = 0.5
"""Belief in all that is read without the format, from which it is text although it does not fit the format."""
LEFT = 0.002
"""Belief that may be left in a live rival once strokes have spoken."""
TOLD_HEIGHTS = 0.25
"""Length of the strokes that tell two characters apart below which touch says nothing of them."""
UNTOLD = 0.03
"""Belief in a rival from which it is not excluded where touch says nothing."""
HIDDEN_SHARE = 0.5
"""Share of a rival's strokes that could not be felt, from which the rival is not excluded."""
HIDDEN_MARGIN = 2.5
"""Nats from which a stroke of the other character was felt all the same: less than a piece of one."""
_REMEDIES = {
    Action.NONE: "look at the part",
    Action.CLEAN: "clean it and scan it again",
    Action.CLEAN_FIRST: "clean it and scan it again",
    Action.RE_STRIKE: "strike it again",
    Action.SCAN_AGAIN: "scan it again",
}


def strokes_asked(reading: Reading) -> Reading:
    """The reading, with what is found of the strokes: most of a character missing, or a rival that they fit as well.

    Args:
        reading: with the grades of its marks, and the strokes in its trace.
    """
    reading = reading.without_flags(EXPLANATIONS | ReadingFlag.NOT_WHOLE | ReadingFlag.UNTOLD)
    felt = reading.strokes_felt
    if reading.decision is Decision.REJECT and felt is not None and felt < TEXT_FELT:
        return no_text(reading)
    found = (*_places_cut(reading), *_missing(reading), *_undecided_strokes(reading))
    return reading.with_findings(*found)


def no_text(reading: Reading) -> Reading:
    """The reading of a part on which there is no text: without characters, and without doubts about them.

    What is surely read there, and is only no serial of the format, is named.
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


def _places_cut(reading: Reading) -> Iterator[Finding]:
    """Characters that lie over the edge of what was felt."""
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
    """The reading without grade and depth of characters that were not felt from edge to edge."""
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
    """Whether the whole text lies better in what was felt in another font than in the one named."""
    line = reading.trace.felt_line
    scores = {} if line is None else line.by_font([c.char for c in reading.characters])
    named = scores.get(reading.font)
    return named is not None and max(scores.values()) >= named + OTHER_FONT


def _undecided_strokes(reading: Reading) -> Iterator[Finding]:
    for k, (c, place) in enumerate(zip(reading.characters, reading.trace.strokes, strict=False)):
        rivals = [r for r in place.rivals if _stands(r)]
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


def _stands(rival: RivalStrokes) -> bool:
    """Whether a rival is not excluded."""
    if rival.apart_heights < TOLD_HEIGHTS:
        return rival.belief >= UNTOLD
    return (rival.belief >= LIVE and rival.excluded_nats < -math.log(LEFT)) or _hides(rival)


def _hides(rival: RivalStrokes) -> bool:
    """Whether what the rival has more of could not be felt, and nothing else speaks against it."""
    covered = rival.more_heights >= TOLD_HEIGHTS and rival.hidden >= HIDDEN_SHARE
    return covered and rival.margin < HIDDEN_MARGIN


def _why(rival: RivalStrokes) -> str:
    if rival.apart_heights < TOLD_HEIGHTS:
        return "touch hardly tells them apart (look at the part)"
    if _hides(rival):
        return "the strokes that tell them apart are covered (clean it and scan it again)"
    if rival.margin < 0.0:
        return "the strokes that were felt fit both (look at the part)"
    return "the strokes that tell them apart may be filled (clean it and scan it again)"
