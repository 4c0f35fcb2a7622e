"""What is measured of a part with its text: the score rests on some measures, the others only describe the part.

`pipeline.reading.certificate_statistics` compares certified parts by all of them. Each group is computed when needed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from statistics import fmean
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from recognition.decide.choice import Choice
from recognition.decide.deferred import deferred
from recognition.decide.evidence import DecisionSettings, Evidence
from recognition.decide.reading import CharacterReading, mean_depth_mm
from recognition.decide.risk import threshold_beside
from recognition.decide.score import DIGITS, Measure, score_of
from recognition.marks.depth import MarkDepth
from recognition.marks.no_depth import NoDepth

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from recognition.language.grammar import Grammar
    from recognition.language.lattice import Lattice
    from recognition.marks.laid_text import LaidText
    from recognition.marks.strokes import PlaceStrokes
    from whisker_array.estimation.relief import Relief

T = TypeVar("T")
TEXT_MEASURES = (
    Measure.ODDS, Measure.LEAST_SURE, Measure.FORMAT_GIVEN, Measure.TWINS, Measure.PIECE, Measure.BY_TOUCH,
)  # fmt: skip
PIECE_OF = MappingProxyType({
    "1": "4", "3": "8", "5": "68", "6": "8", "7": "Z", "9": "8", "C": "0GOQ", "E": "B", "F": "BEPR", "H": "A",
    "I": "1BDEFHLNPRT", "J": "U", "L": "BE", "N": "MW", "O": "Q", "P": "BR", "S": "8", "V": "W",
})  # fmt: skip
"""Characters of which a character is a piece: dirt that fills the other strokes leaves it. Of the 38 texts (of 7,338)
that touch would accept wrongly at a risk of 1 in 100, 20 have a piece in place of the character, seven of them 3 for 8.
"""
STROKE_MEASURES = (Measure.EVIDENCE, Measure.STROKES, Measure.LEAST_STROKES, Measure.UNLIKENESS)
LAND_MEASURES = (Measure.FINE, Measure.COARSE, Measure.FINE_SHARE, Measure.COARSE_SHARE)
PHOTO_MEASURES = (Measure.GRAIN, Measure.PATCHES)
Group: TypeAlias = Mapping[Measure, float | None]
"""Measures that are computed together; None for unknown ones."""
Groups: TypeAlias = Mapping[tuple[Measure, ...], Callable[[], Group]]
_NORMAL = 1.4826
"""Standard deviation of normal noise whose median absolute deviation is 1."""


def measure_text(
    choice: Choice,
    evidence: Evidence,
    settings: DecisionSettings,
    *,
    without: frozenset[Measure] = frozenset(),
) -> Choice:
    """Measure the marks of a text, and score it; a text that is dirt is dropped."""
    choice = _with_marks(choice)
    if is_dirt(choice):
        choice = replace(choice, characters=(), spaces_after=frozenset())
    groups = measure_groups(choice, evidence, settings)
    known: Mapping[Measure, float] = Measures(groups)
    if without:
        known = {name: value for name, value in known.items() if name not in without}
    score = _score(choice, known) if choice.characters else 0.0
    margin = min((place.margin for place in choice.characters), default=0.0)
    of_score = {Measure.CONFIDENCE: round(score, DIGITS), Measure.MARGIN: margin}
    return replace(
        choice,
        accept_risk=settings.risk_of(choice.scored_as),
        threshold=_threshold(choice, settings),
        measures=Measures({**groups, tuple(of_score): lambda: of_score}),
        score=score,
    )


def _score(choice: Choice, measures: Mapping[Measure, float]) -> float:
    """The score; both senses together are no less sure of a text than one of them alone."""
    alone = choice.alone.values() if choice.is_fused else ()
    same_text = (reading.confidence for reading in alone if reading.plain_text == choice.text)
    return max([score_of(choice.scored_as).probability(measures), *same_text])


def _threshold(choice: Choice, settings: DecisionSettings) -> float:
    """The threshold of the score, or that of a sense which accepts the text alone."""
    risk = settings.risk_of(choice.scored_as)
    alone = choice.alone.values() if choice.is_fused else ()
    same_text = [reading for reading in alone if reading.plain_text == choice.text]
    reached = [
        least
        for reading in same_text
        if (least := threshold_beside(reading.source, risk)) is not None and reading.confidence >= least
    ]
    return min([settings.least_score(choice.scored_as), *reached])


def _with_marks(choice: Choice) -> Choice:
    marks = choice.sense.marks
    if marks is None or choice.lattice is None or choice.line is None or not choice.characters:
        return choice
    text_marks = marks.of_text(choice.text, [place.box for place in choice.characters])

    def measured(k: int, place: CharacterReading) -> CharacterReading:
        return replace(
            place,
            depth=deferred(lambda: _if_of(MarkDepth, text_marks.depths[k])),
            no_depth=deferred(lambda: _if_of(NoDepth, text_marks.depths[k])),
            grade=deferred(lambda: text_marks.grades[k]),
        )

    characters = tuple(measured(k, place) for k, place in enumerate(choice.characters))
    return replace(choice, marks=text_marks, characters=characters)


def _if_of(kind: type[T], value: object) -> T | None:
    return value if isinstance(value, kind) else None


def is_dirt(choice: Choice, *, least_felt: float = 0.35) -> bool:
    """Whether an unreadable line is dirt or land: less than `least_felt` of its strokes was felt, in the mean."""
    if not choice.characters or not all(place.is_unread for place in choice.characters):
        return False
    felt = [place.felt for place in choice.strokes if place.felt is not None]
    return bool(felt) and fmean(felt) < least_felt


def measure_groups(choice: Choice, evidence: Evidence, settings: DecisionSettings) -> Groups:
    """Functions that measure a part with its text."""
    line, touch, vision = choice.line, evidence.touch, evidence.vision
    felt = choice.alone.get("tactile")
    openly = choice.open_lattice if felt is None else felt.trace.open_lattice

    def laid() -> LaidText | None:
        laid_text = None if choice.marks is None else choice.marks.laid
        return laid_text if felt is None else laid_text or felt.trace.laid

    def height_mm() -> float | None:
        return choice.height_mm if choice.sense.scaled and choice.height_mm > 0.0 else None

    def covered() -> float | None:
        marks = choice.marks
        if marks is not None and marks.has_strokes(choice.posteriors) and marks.marks.surface.is_open:
            return 0.0
        return covered_share(choice.strokes)

    relief = None if touch is None or not touch.views else touch.views[0].relief
    photo = None if vision is None else vision.log.photo
    format_nats = None if line is None or choice.decoding is None else line.evidence
    return {
        TEXT_MEASURES: lambda: _text_measures(choice, settings),
        (Measure.FORMAT,): lambda: {Measure.FORMAT: format_nats},
        (Measure.HEIGHT,): lambda: {Measure.HEIGHT: height_mm()},
        (Measure.DEPTH,): lambda: {Measure.DEPTH: mean_depth_mm(choice.characters)},
        STROKE_MEASURES: lambda: stroke_measures(choice.strokes),
        (Measure.COVERED,): lambda: {Measure.COVERED: covered()},
        (Measure.BELIEF,): lambda: {Measure.BELIEF: mean_belief(openly)},
        LAND_MEASURES: lambda: land_measures(relief, laid()),
        PHOTO_MEASURES: lambda: photo_measures(photo),
    }


def _text_measures(choice: Choice, settings: DecisionSettings) -> Mapping[Measure, float]:
    if choice.odds is None or not choice.characters:
        return {}
    return text_measures(
        odds=choice.odds,
        places=[place.confidence for place in choice.characters],
        format_given=settings.grammar is not None,
        twins=unsettled_twins(choice.text, settings.grammar),
        piece=piece_nats(choice.text, choice.posteriors),
        by_touch=choice.odds_by_touch,
    )


def unsettled_twins(
    text: str,
    grammar: Grammar | None,
    *,
    pairs: Sequence[tuple[str, str]] = (("0", "O"), ("1", "I"), ("5", "S")),
) -> int:
    """Number of characters of a text that only their shape tells from their twin, not the format or a check digit."""
    twins = dict((*pairs, *((second, first) for first, second in pairs)))
    return sum(
        grammar is None or grammar.allows(text[:k] + twins[char] + text[k + 1 :])
        for k, char in enumerate(text)
        if char in twins
    )


def piece_nats(text: str, lattice: Lattice | None, *, least: float = 1e-6) -> float | None:
    """Log of the greatest probability, at any place, of the characters that the one read is a piece of."""
    if lattice is None or lattice.n_places != len(text):
        return None
    beliefs = (
        sum(
            math.exp(log)
            for char, log in zip(lattice.chars, row, strict=True)
            if char in PIECE_OF.get(read, "")
        )
        for read, row in zip(text, lattice.log_belief.tolist(), strict=True)
    )
    return math.log(max((least, *beliefs)))


class Measures(Mapping[Measure, float]):
    """The known measures of a part, each group computed when one of it is first read."""

    def __init__(self, groups: Mapping[tuple[Measure, ...], Callable[[], Group]]) -> None:
        cached = {names: cache(compute) for names, compute in groups.items()}
        self._groups = {name: group for names, group in cached.items() for name in names}

    def __getitem__(self, name: Measure) -> float:
        value = self._groups[name]().get(name)
        if value is None or not math.isfinite(value):
            raise KeyError(name)
        return float(value)

    def __iter__(self) -> Iterator[Measure]:
        return (name for name in self._groups if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __reduce__(self) -> tuple[type[dict[Measure, float]], tuple[dict[Measure, float]]]:
        return dict, (dict(self),)


def text_measures(
    *,
    odds: float,
    places: Iterable[float],
    format_given: bool,
    twins: int,
    piece: float | None = None,
    by_touch: float | None = None,
    most_odds: float = 50.0,
) -> dict[Measure, float]:
    """Return the measures of a text that a score needs; `by_touch` only of a text of both senses."""
    measures = {
        Measure.ODDS: min(max(odds, -most_odds), most_odds),
        Measure.LEAST_SURE: min(places),
        Measure.FORMAT_GIVEN: float(format_given),
        Measure.TWINS: float(twins),
    }
    if piece is not None:
        measures[Measure.PIECE] = piece
    if by_touch is not None:
        measures[Measure.BY_TOUCH] = min(max(by_touch, -most_odds), most_odds)
    return measures


def mean_belief(open_lattice: Lattice | None) -> float | None:
    """Belief in the characters before the format is applied, mean of the places."""
    if open_lattice is None or not open_lattice.n_places:
        return None
    return float(np.exp(open_lattice.log_belief.max(axis=1)).mean())


def photo_measures(photo: Photo | None, *, darkest: float = 1.0 / 255.0) -> Group:
    """Grain and patches of a photograph, relative to its median grey, `darkest` at least."""
    if photo is None:
        return {}
    grey = np.asarray(photo.grey(), dtype=np.float64)
    grey = grey / max(float(np.median(grey)), darkest)
    return {Measure.GRAIN: roughness(grey, 1), Measure.PATCHES: roughness(grey, 4)}


def covered_share(places: Sequence[PlaceStrokes], *, deciding_heights: float = 0.25) -> float | None:
    """Greatest share of a rival's own strokes, from `deciding_heights` on, that was not felt; None without places."""
    rivals = (rival for place in places for rival in place.rivals)
    covered = (rival.hidden for rival in rivals if rival.more_heights >= deciding_heights)
    return max(covered, default=0.0) if places else None


def stroke_measures(places: Sequence[PlaceStrokes]) -> Group:
    """Measures of the felt strokes at all places, but for the covered ones."""
    felt = [place.felt for place in places if place.felt is not None]
    unlike = [1.0 - place.score for place in places if place.felt is not None]
    rivals = [rival for place in places for rival in place.rivals]
    return {
        Measure.EVIDENCE: min((rival.excluded_nats for rival in rivals), default=None),
        Measure.STROKES: float(np.mean(felt)) if felt else None,
        Measure.LEAST_STROKES: min(felt, default=None),
        Measure.UNLIKENESS: float(np.mean(unlike)) if felt else None,
    }


def land_measures(
    relief: Relief | None, laid: LaidText | None, *, fine_mm: float = 0.1, coarse_mm: float = 0.4
) -> Group:
    """Roughness of the land, in µm and relative to the marks' depth, fine by grains and coarse by lumps."""
    if relief is None:
        return {}
    heights_um = 1e3 * relief.height_mm.astype(np.float64)
    depth_um = math.nan if laid is None else max(1e3 * laid.felt.depth_mm, 1.0)
    fine, coarse = (
        roughness(heights_um, max(1, round(far / relief.pitch_mm))) for far in (fine_mm, coarse_mm)
    )
    return {
        Measure.FINE: fine,
        Measure.COARSE: coarse,
        Measure.FINE_SHARE: fine / depth_um,
        Measure.COARSE_SHARE: coarse / depth_um,
    }


def roughness(surface: NDArray[np.float64], step: int, *, enough_samples: int = 100_000) -> float:
    """Roughness of the land, in the unit of the surface; marks and edges hardly count. NaN if unknown.

    The standard deviation of normal noise with the same median of |z(-step) - 2 z(0) + z(+step)| / sqrt(6).
    """
    # in a large picture every n-th row is enough for the median
    every = max(1, round(surface.size / enough_samples))
    bends = [
        np.abs(z[::every, 2 * step :] - 2.0 * z[::every, step:-step] + z[::every, : -2 * step]).ravel()
        for z in (surface, surface.T)
        if z.shape[1] > 2 * step
    ]
    known = np.concatenate([b[np.isfinite(b)] for b in bends]) if bends else np.zeros(0)
    return float(_NORMAL * np.median(known) / np.sqrt(6.0)) if known.size else math.nan
