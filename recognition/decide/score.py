"""The score: the probability that the whole serial is right, from one to four measures of a reading.

    log odds of the text ------weight--+
    whether a format is given -weight--+--sum--> log odds --> probability --+
                                                                            +--lesser--> score, 0 to 1
    probability of the least sure place ------------------------------------+

The whole serial is never surer than its least sure place. Each term is a piecewise linear curve that only rises or only
falls: a better value never lowers the score. Touch, the camera and both together have weights of their own.

For each risk the fit keeps the least score at which readings of generators that the fit had left out were wrong no more
often (`pipeline.common.accepted_risk`). Weights and thresholds are in `score.fit.json`; `python
tests/benchmarks/fit_score.py` fits them.

Some twenty measures are named. Most only describe a part: they are compared between parts that were certified and parts
that are read (`pipeline.reading.certificate_statistics`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from recognition.decide.risk_text import CANNOT_PROMISE, check_risk, risk_in_words

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from recognition.language.lattice import Lattice
    from recognition.marks.laid_text import LaidText
    from recognition.marks.strokes import PlaceStrokes
    from whisker_array.estimation.relief import Relief


SOURCES = ("tactile", "vision", "fused")
"""Sources of readings."""
FITTED = Path(__file__).with_name("score.fit.json")
DIGITS = 6
"""Decimals of a score in records; certificates are computed from records."""
_NORMAL = 1.4826
"""Standard deviation of normal noise whose median absolute deviation is 1."""


class Measure(StrEnum):
    """Measures of a part; the value is the name in messages and tables."""

    CONFIDENCE = "confidence"
    ODDS = "log odds of the text before anything else is known"
    LEAST_SURE = "probability of the least sure place"
    FORMAT_GIVEN = "1 with a format, 0 without"
    SAME_TEXT = "1 if touch and camera read the same text, 0 if not"
    MARGIN = "least margin"
    BELIEF = "belief before the format"
    EVIDENCE = "evidence against the strongest rival (nats)"
    FORMAT = "log probability of all that the format allows"
    STROKES = "share of strokes felt"
    LEAST_STROKES = "share of the strokes felt of the character that has the least"
    COVERED = "greatest share of deciding strokes that are covered"
    UNLIKENESS = "share of the marks that known fonts leave unexplained"
    HEIGHT = "character height (mm)"
    DEPTH = "mean depth (mm)"
    FINE = "fine roughness (µm)"
    COARSE = "coarse roughness (µm)"
    FINE_SHARE = "fine roughness in parts of the marks' depth"
    COARSE_SHARE = "coarse roughness in parts of the marks' depth"
    GRAIN = "grain of the photograph"
    PATCHES = "patches of the photograph"


TEXT_MEASURES = (Measure.ODDS, Measure.LEAST_SURE, Measure.FORMAT_GIVEN, Measure.SAME_TEXT)
STROKE_MEASURES = (Measure.EVIDENCE, Measure.STROKES, Measure.LEAST_STROKES, Measure.UNLIKENESS)
LAND_MEASURES = (Measure.FINE, Measure.COARSE, Measure.FINE_SHARE, Measure.COARSE_SHARE)
PHOTO_MEASURES = (Measure.GRAIN, Measure.PATCHES)
Group: TypeAlias = Mapping[Measure, float | None]
"""Measures that are computed together; None for unknown ones."""


class Measures(Mapping[Measure, float]):
    """The known measures of a part, each group computed when one of it is first read."""

    def __init__(self, groups: Mapping[tuple[Measure, ...], Callable[[], Group]]) -> None:
        """Take a function for each group of measures."""
        self._compute = {name: compute for names, compute in groups.items() for name in names}
        self._known: dict[Callable[[], Group], Group] = {}

    def __getitem__(self, name: Measure) -> float:
        """A known measure.

        Raises:
            KeyError: it is not known.
        """
        compute = self._compute[name]
        if compute not in self._known:
            self._known[compute] = compute()
        value = self._known[compute].get(name)
        if value is None or not math.isfinite(value):
            raise KeyError(name)
        return float(value)

    def __iter__(self) -> Iterator[Measure]:
        """The known measures; all groups are computed."""
        return (name for name in self._compute if name in self)

    def __len__(self) -> int:
        """Number of known measures; all groups are computed."""
        return sum(1 for _ in self)

    def __reduce__(self) -> tuple[type[dict[Measure, float]], tuple[dict[Measure, float]]]:
        """Pickled as a dict."""
        return dict, (dict(self),)


def text_measures(
    *,
    probability: float,
    count_probability: float,
    places: Iterable[float],
    format_given: bool,
    same_text: bool | None = None,
) -> dict[Measure, float]:
    """Return the measures of a text that a score needs.

    Args:
        probability: probability of the text if it has this number of places.
        count_probability: probability of the number of places; 1 with a format.
        places: probability of the character of each place; at least one.
        format_given: whether the reader was given a format.
        same_text: whether each of both senses reads this text by itself; None for one sense.
    """
    measures = {
        Measure.ODDS: within_odds(log_odds(probability * count_probability)),
        Measure.LEAST_SURE: min(places),
        Measure.FORMAT_GIVEN: float(format_given),
    }
    return measures if same_text is None else {**measures, Measure.SAME_TEXT: float(same_text)}


def mean_belief(open_lattice: Lattice | None) -> float | None:
    """Belief in the characters before the format is applied, mean of the places."""
    if open_lattice is None or not open_lattice.n_places:
        return None
    return float(np.exp(open_lattice.log_belief.max(axis=1)).mean())


def photo_measures(photo: Photo | None) -> Group:
    """Grain and patches of a photograph."""
    if photo is None:
        return {}
    grey = _evenly_lit(photo)
    return {Measure.GRAIN: roughness(grey, 1), Measure.PATCHES: roughness(grey, 4)}


def covered_share(places: Sequence[PlaceStrokes], *, deciding_heights: float = 0.25) -> float | None:
    """Greatest share of the strokes of a rival that could not be felt; None without places.

    Args:
        places: places of the text.
        deciding_heights: least length of the strokes that only a rival has, for them to count, character heights.
    """
    rivals = (rival for place in places for rival in place.rivals)
    covered = (rival.hidden for rival in rivals if rival.more_heights >= deciding_heights)
    return max(covered, default=0.0) if places else None


def stroke_measures(places: Sequence[PlaceStrokes]) -> Group:
    """Measures of the felt strokes at all places, but for the covered ones.

    Args:
        places: places of the text.
    """
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
    """Roughness of the land, in µm and relative to the marks' depth.

    Args:
        relief: the felt relief; None without heights.
        laid: the serial, if known.
        fine_mm: distance between the samples that are compared for fine roughness: grains.
        coarse_mm: the same for coarse roughness: lumps.
    """
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

    Args:
        surface: (rows, cols), NaN where unknown.
        step: distance between the three, samples.
        enough_samples: samples that are used of a larger surface; the error of their median is half a per cent.
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


def within_odds(odds: float, *, most_odds: float = 50.0) -> float:
    """Limit log odds to `most_odds`, so that certainty is not a missing value."""
    return min(max(odds, -most_odds), most_odds)


def _evenly_lit(photo: Photo, *, darkest: float = 1.0 / 255.0) -> NDArray[np.float64]:
    """Brightness divided by its median, so that exposure does not matter.

    Args:
        photo: photo of the part.
        darkest: median brightness of a photograph that shows nothing.
    """
    grey = np.asarray(photo.grey(), dtype=np.float64)
    return grey / max(float(np.median(grey)), darkest)


class RiskError(MarksError):
    """A risk that a sense was not shown to keep."""


@dataclass(frozen=True)
class Term:
    """Contribution of one measure: piecewise linear, constant beyond the ends.

    Attributes:
        points: values, rising, and the log odds that each adds, either rising or falling.
    """

    points: Sequence[tuple[float, float]]

    def nats(self, value: float | None) -> float:
        """Log odds added by a value; 0 if unknown."""
        if value is None:
            return 0.0
        values, nats = np.array(self.points).T
        return float(np.interp(value, values, nats))


@dataclass(frozen=True)
class RiskThreshold:
    """The threshold of a risk, and the readings of left-out generators that showed it.

    Attributes:
        risk: largest share of wrong readings among the accepted.
        threshold: least score of an accepted reading.
        accepted: number of readings with at least this score that broke no contract.
        wrong: number of these that were wrong.
        bound: upper bound of the share of wrong ones, one-sided, 95 %.
    """

    risk: float
    threshold: float
    accepted: int
    wrong: int
    bound: float


@dataclass(frozen=True)
class Score:
    """Score of one source of readings.

    Attributes:
        source: one of `SOURCES`.
        bias: log odds if every term adds nothing.
        terms: terms by measure; that of the log odds of the text must be among them, and rise.
        thresholds: tested thresholds, the strictest risk last.
    """

    source: str
    bias: float
    terms: Mapping[Measure, Term]
    thresholds: Sequence[RiskThreshold] = ()

    def probability(self, measures: Mapping[Measure, float]) -> float:
        """Probability that a text is right, never above that of its least sure place; unknown measures add nothing."""
        odds = self.bias + sum(term.nats(measures.get(name)) for name, term in self.terms.items())
        return min(share(odds), measures.get(Measure.LEAST_SURE, 1.0))

    def of_belief(self, belief: float) -> float:
        """Probability that a text is right, from its posterior alone."""
        return self.probability({Measure.ODDS: log_odds(belief)})

    def threshold(self, risk: float) -> float:
        """Least score of readings that keep a risk: the share of wrong ones among those that are accepted.

        Args:
            risk: largest share, between 0 and 1.

        Raises:
            RiskError: readings of this source were not shown to keep this risk at any score.
            ValueError: the risk does not lie between 0 and 1.
        """
        tested = [one.threshold for one in self.thresholds if one.risk <= check_risk(risk)]
        if not tested:
            raise RiskError(
                f"{SENSE_NAMES[self.source]} {CANNOT_PROMISE} {risk_in_words(risk)}",
                hint=f"accept a risk of {self.least_risk:g} or more, or certify your own parts",
            )
        return min(tested)

    @property
    def least_risk(self) -> float:
        """Least risk that readings of this source were shown to keep; 1 if none."""
        return min((one.risk for one in self.thresholds), default=1.0)

    @property
    def slope(self) -> float:
        """Log odds per unit of the text's log odds, if its probability is above 0.5."""
        (low, below), (high, above) = self.terms[Measure.ODDS].points[-2:]
        return (above - below) / (high - low)


SENSE_NAMES = MappingProxyType(
    {"tactile": "touch", "vision": "the camera", "fused": "touch and camera together"}
)
"""Names of the sources in messages."""


def log_odds(belief: float) -> float:
    """Return the log odds of a probability; infinite for 0 and 1."""
    if not 0.0 < belief < 1.0:
        return math.inf if belief >= 1.0 else -math.inf
    return math.log(belief) - math.log1p(-belief)


def share(odds: float) -> float:
    """The probability of log odds."""
    return 1.0 / (1.0 + math.exp(-odds)) if odds > -700.0 else 0.0


@cache
def score_of(source: str) -> Score:
    """Load the fitted score for one of `SOURCES`."""
    fitted = json.loads(FITTED.read_text(encoding="utf-8"))["scores"][source]
    terms = {Measure[name]: Term(points) for name, points in fitted["terms"].items()}
    thresholds = tuple(RiskThreshold(**tested) for tested in fitted["thresholds"])
    return Score(source, fitted["bias"], MappingProxyType(terms), thresholds)
