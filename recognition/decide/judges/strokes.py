"""Judges of the felt strokes: missing ones, ones that leave two characters undecided, and those of another font.

The prior is ignored: a J with a filled hook looks like an I. Such strokes explain a low score, but break no contract.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import repeat
from statistics import median, mode

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.judges.words import places_text
from recognition.marks.grade import Action
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


def cut_characters(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report characters that cross the edge of the area that was felt."""
    places = tuple(k for k, whole in enumerate(choice.whole, start=1) if not whole)
    if places and choice.characters:
        what = f"not felt to the edge: {places_text(choice.text, places)} (scan a longer or wider stretch)"
        yield Finding(ReadingFlag.NOT_WHOLE, what, places)


def missing_strokes(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    least_edges: float = 0.5,
    # least share of the depth of a character's strokes that must be there, in the best-fitting font, which
    # may differ from the part's
    least_felt: float = 0.4,
    suited: float = 0.35,
    all_there: float = 0.6,
    # least number of characters that must differ from the named font: a single one may be a bad blow or
    # misplaced dots
    least_foreign: int = 2,
) -> Iterator[Finding]:
    """Report characters most of whose strokes are missing, or are those of another font than the named one."""
    if not choice.may_be_explained and not choice.other_font_fits_better:
        return
    lacking: dict[int, Action] = {}
    foreign: list[int] = []
    strokes = choice.strokes or repeat(PlaceStrokes(None))
    for k, (c, place) in enumerate(zip(choice.characters, strokes, strict=False), start=1):
        edges = None if c.grade is None else c.grade.value("completeness")
        shallow = place.felt is not None and place.felt < least_felt and place.score < suited
        if shallow and (edges is None or edges < all_there):
            lacking[k] = Action.CLEAN if c.grade is None else c.grade.action
        elif c.grade is not None and edges is not None and edges < least_edges:
            if (place.felt or 0.0) >= all_there:
                foreign.append(k)
            else:
                lacking[k] = c.grade.action
    if lacking and choice.may_be_explained:
        remedy = _REMEDIES[mode(lacking.values())]
        what = f"most strokes are missing: {places_text(choice.text, [*lacking])} ({remedy})"
        yield Finding(ReadingFlag.STROKES_MISSING, what, tuple(lacking))
    if len(foreign) >= least_foreign and choice.other_font_fits_better:
        what = f"another font than {choice.font} explains the marks better"
        what = f"{what}: {places_text(choice.text, foreign)} (name the right font)"
        yield Finding(ReadingFlag.FOREIGN_SHAPES, what, tuple(foreign))


def covered_characters(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    most_felt: float = 0.05,
    least_covered: float = 0.3,
    others_felt: float = 0.75,
) -> Iterator[Finding]:
    """Report characters that were not felt at all, because something lies on them: its outline may read as a 0.

    The others were felt all but whole, so it is not the marks that are unlike the font. Four drops on a
    character had no stroke felt and 0.4 to 1 covered; of 132 sure parts of four generators none breaks the rule.
    """
    marks, seen = choice.marks, choice.alone.get("vision")
    if marks is None or not marks.has_strokes(choice.posteriors) or marks.marks.surface.is_open:
        return
    if seen is not None and seen.serial_is_sure and seen.plain_text == choice.text:
        return
    shares = [(place.felt or 0.0) * (1.0 - place.covered) for place in choice.strokes]
    if not shares or median(shares) < others_felt:
        return
    places = tuple(
        k
        for k, (felt, place) in enumerate(zip(shares, choice.strokes, strict=True), start=1)
        if place.felt is not None and felt <= most_felt and place.covered >= least_covered
    )
    if places:
        what = f"something lies on {places_text(choice.text, places)} (clean the part and scan it again)"
        yield Finding(ReadingFlag.COVERED, what, places)


def undecided_strokes(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report strokes that do not exclude a rival, if the score is low."""
    if not choice.may_be_explained:
        return
    for k, (c, place) in enumerate(zip(choice.characters, choice.strokes, strict=False), start=1):
        doubts = [(rival, why) for rival in place.rivals if (why := _why_undecided(rival))]
        if doubts:
            rival, why = min(doubts, key=lambda doubt: doubt[0].excluded_nats)
            what = f"{c.char} or {rival.char} at place {k}: {why}"
            yield Finding(ReadingFlag.STROKES_UNDECIDED, what, (k,))


def _why_undecided(
    rival: RivalStrokes,
    *,
    distinct_heights: float = 0.25,
    least_belief: float = 0.03,
    hidden_share: float = 0.5,
) -> str:
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


def named_font(evidence: Evidence, choice: Choice, settings: DecisionSettings) -> Iterator[Finding]:
    """Report a named font that does not fit the marks."""
    marks = choice.marks
    if not settings.fonts or not choice.characters or marks is None:
        return
    if marks.along is not None and not marks.font_fits:
        what = f"the font {marks.along.font.name} does not fit the marks (name the right font, or none)"
        yield Finding(ReadingFlag.FOREIGN_SHAPES, what)


def guessed_characters(
    evidence: Evidence,
    choice: Choice,
    settings: DecisionSettings,
    *,
    # greatest shortfall in correlation of a guess that may still be right; where an enrolled character won over
    # the right guess, it won by 0.01 or 0.02 (E for F, Q for O)
    near_fit: float = 0.05,
) -> Iterator[Finding]:
    """Report characters that may be missing from their learned font, if templates alone have read them.

    If O was never enrolled, its shape comes from another font, and an enrolled Q fits a true O about as well. A
    character is doubtful if it is such a guess, or if a guess fits nearly as well.
    """
    line = choice.line
    if not choice.characters or line is None or "network" in line.by_expert:
        return
    laid = choice.in_own_font
    if laid is None:
        return
    guessed = {c for c, glyph in laid.font.glyphs.items() if glyph.guessed}
    places = None if settings.grammar is None else settings.grammar.fixed_places
    for k, char in enumerate(choice.text) if guessed else ():
        allowed = guessed
        if places is not None and len(places) == len(choice.text):
            allowed = guessed & set(places[k])
        character = laid.laid[k]
        least = -1.0 if character is None else character.fit - near_fit
        near = [c for c in sorted(allowed) if laid.felt.lay(k, c, laid.font, laid.face).fit > least]
        never = [char] if char in guessed else near
        if never:
            what = f"place {k + 1}: {', '.join(never)} was never enrolled in {choice.font}"
            yield Finding(ReadingFlag.FOREIGN_SHAPES, what, (k + 1,))
