"""Fit the score, its thresholds and the weights of fusion to kept readings, and judge them on what each fit left out::

    python tests/benchmarks/fit_score.py --write

The readings are those of `kept_readings.py`: parts of four generators, in fonts that the recogniser has not learned.
Each generator is left out in turn: its readings are fused and scored by fits to the other three. The thresholds of
risks are tested on these scores (`pipeline.common.accepted_risk`), in a sequence that is fixed beforehand; what is
written is a fit to all generators, with those thresholds.

Three fits, each by maximum likelihood with a weak penalty:

- fusion: a conditional logit of the true character of each place, over the characters that touch has not ruled out;
- score: a logistic regression of right readings on the terms of `TERMS`, whose weights cannot point the wrong way;
- thresholds: Learn then Test, one-sided, 95 %.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from pipeline.benchmark.analysis.confidence import reliability, risk_coverage
from pipeline.benchmark.analysis.estimates import exact_share
from pipeline.common.accepted_risk import ThresholdTest, proven_threshold, threshold_tests
from pipeline.common.shares import CONFIDENCE_LEVEL, share_bounds
from recognition.decide import fuse_lattices as fusion
from recognition.decide import score as scoring
from recognition.decide.fuse_lattices import (
    FusionWeights,
    contradict,
    fuse_lattices,
    lead_nats,
    odds_by_touch,
    relative_likelihood,
)
from recognition.decide.measures import piece_nats, text_measures, unsettled_twins
from recognition.decide.risk import ALONE_RISK
from recognition.decide.risk_text import risk_in_words
from recognition.decide.score import SOURCES, Measure, RiskThreshold, Score, Term, log_odds
from recognition.language.lattice import Lattice
from tests.benchmarks.kept_readings import KEPT, KeptPart, load
from tests.benchmarks.risk_parts import SOILS

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
TERMS: Mapping[Measure, tuple[tuple[float, ...], float]] = {
    Measure.ODDS: ((-12.0, 0.0, 12.0), 0.0),
    Measure.FORMAT_GIVEN: ((0.0, 1.0), 1.0),
    Measure.TWINS: ((3.0, 0.0), 0.0),
    Measure.PIECE: ((0.0, -12.0), -12.0),
    Measure.BY_TOUCH: ((-12.0, 0.0, 12.0), 0.0),
}
"""Measures that may count: ends of their straight pieces, worst first, and the value that adds nothing."""
HOLD = 0.3
"""Weight of the penalty that pulls each weight to where it starts: 1 for the log odds of the text, 0 for the others."""
LEAST_WEIGHT = 0.02
"""Log odds over a measure's whole range below which it is left out."""
RISKS = (0.1, 0.05, 0.02, 0.01, 0.007, 0.005, 0.003, 0.002, 0.001, 0.0005)
"""Risks whose thresholds are tested."""
THRESHOLDS = tuple(float(f"{1.0 / (1.0 + np.exp(-odds)):.6f}") for odds in np.arange(9.2, -3.0, -0.05))
"""Scores that are tested as thresholds: every twentieth of a nat, fixed before anything was read."""
START_SHARE = 0.3
"""See `threshold_tests`: a seventh of the readings is wrong, with low scores."""


@dataclass(frozen=True, eq=False)
class KnownReading:
    """A reading of a part whose text is known.

    Attributes:
        part: the part.
        source: one of `SOURCES`: the score that applies. If only one sense has read a part, both together are that
            sense.
        text: text that was read.
        broken: whether a contract keeps it from acceptance.
        measures: measures that the score may use.
    """

    part: KeptPart
    source: str
    text: str
    broken: bool
    measures: Mapping[Measure, float]

    @property
    def right(self) -> bool:
        """Whether the text is right."""
        return self.text == self.part.text


@dataclass(frozen=True)
class Fit:
    """Fusion and scores, fitted to some parts."""

    weights: FusionWeights
    scores: Mapping[str, Score]


def fit(parts: Sequence[KeptPart]) -> Fit:
    """Fit fusion, then the score of each sense, then that of both.

    Raises:
        ValueError: a source has no wrong readings, or no right ones.
    """
    weights, scores = fit_fusion(parts), {}
    for source in SOURCES:
        readings = [read(part, source, Fit(weights, scores)) for part in parts]
        own = [reading for reading in readings if reading is not None and reading.source == source]
        scores[source] = fit_score(source, own)
    return Fit(weights, scores)


def read(part: KeptPart, source: str, fitted: Fit) -> KnownReading | None:
    """The reading of a part by a source; None if nothing was read.

    Args:
        part: the part.
        source: one of `SOURCES`.
        fitted: of both senses together the weights are used, and the scores of the senses, which must not be sure of
            different texts.
    """
    touch, camera = (part.readings[sense] for sense in ("tactile", "vision"))
    if source != "fused":
        return _by_sense(part, source)
    if not touch.text or touch.lattice is None:
        return _by_sense(part, "vision")
    if camera.lattice is None or camera.lattice.n_places != touch.lattice.n_places:
        alone = _by_sense(part, "tactile")
        return alone and replace(alone, broken=alone.broken or disagree(part, alone.text, fitted.scores))
    lattice = fuse_lattices(touch.lattice, camera.lattice, weights=fitted.weights)
    own = part.readings["fused"]
    felt_odds = _odds(touch.lattice, touch.count_probability)
    by_touch = odds_by_touch(lattice.text, touch.text, touch.lattice, felt_odds)
    return KnownReading(
        part,
        "fused",
        lattice.text,
        own.broken or disagree(part, lattice.text, fitted.scores),
        {**own.measures, **_text_measures(lattice, touch.count_probability, part, by_touch=by_touch)},
    )


@cache
def _by_sense(part: KeptPart, sense: str) -> KnownReading | None:
    own = part.readings[sense]
    if not own.text or own.lattice is None:
        return None
    measures = {**own.measures, **_text_measures(own.lattice, own.count_probability, part)}
    return KnownReading(part, sense, own.text, own.broken, measures)


def _text_measures(
    lattice: Lattice, count_probability: float, part: KeptPart, *, by_touch: float | None = None
) -> dict[Measure, float]:
    """Measures of the likeliest text. A kept format allows every text of the characters of its places."""
    return text_measures(
        odds=_odds(lattice, count_probability),
        places=np.exp(lattice.log_belief.max(axis=1)).tolist(),
        format_given=bool(part.format),
        twins=unsettled_twins(lattice.text, part.readings["tactile"].grammar),
        piece=piece_nats(lattice.text, lattice),
        by_touch=by_touch,
    )


def _odds(lattice: Lattice, count_probability: float) -> float:
    return log_odds(math.exp(lattice.log_belief.max(axis=1).sum()) * count_probability)


def disagree(
    part: KeptPart, text: str, scores: Mapping[str, Score], *, sure: float = 0.97, ratio: float = 300.0
) -> bool:
    """Whether a sense is sure of another text than the one read (see `judges.senses`)."""
    senses = [reading for sense in ("tactile", "vision") if (reading := _by_sense(part, sense)) is not None]
    if len({reading.text for reading in senses}) < 2:
        return False
    lattices = [part.readings[reading.source].lattice for reading in senses]
    for reading, lattice in zip(senses, lattices, strict=True):
        assert lattice is not None  # it has read
        if reading.text != text:
            same_length = len(reading.text) == len(text)
            lead = lead_nats(lattice, reading.text, text) if same_length else reading.measures[Measure.ODDS]
            if lead > np.log(ratio) or scores[reading.source].probability(reading.measures) >= sure:
                return True
    first, second = lattices
    return first.n_places == second.n_places and contradict(first, second)


def fit_fusion(parts: Sequence[KeptPart]) -> FusionWeights:
    """Fit the weights of both senses: a conditional logit of the true characters."""
    places = FusionPlaces.of(parts)
    return FusionWeights(*(round(float(weight), 4) for weight in places.fit(np.ones((places.truth.size, 0)))))


@dataclass(frozen=True, eq=False)
class FusionPlaces:
    """Places that both senses have read, of parts of which both have found as many places as there are.

    Attributes:
        logs: (2, n, characters) log-likelihood ratio of each character by touch and by camera.
        truth: (n,) index of the true character.
        part: (n,) index of the part.
    """

    logs: Floats
    truth: NDArray[np.intp]
    part: NDArray[np.intp]

    @classmethod
    def of(cls, parts: Sequence[KeptPart]) -> FusionPlaces:
        """Collect the places of parts; those whose true character touch has ruled out cannot be mended."""
        logs, truths, indices = [], [], []
        for index, part in enumerate(parts):
            touch, camera = (part.readings[sense].lattice for sense in ("tactile", "vision"))
            if touch is None or camera is None or not touch.n_places == camera.n_places == len(part.text):
                continue
            truth = np.array([touch.chars.index(char) for char in part.text])
            possible = np.isfinite(touch.log_belief)
            known = possible[np.arange(truth.size), truth]
            felt, seen = (relative_likelihood(lattice, touch.chars)[0] for lattice in (touch, camera))
            log = np.log(np.stack([np.where(possible, felt, 1e-300), seen]))
            logs.append(log[:, known])
            truths.append(truth[known])
            indices.append(np.full(int(known.sum()), index))
        return cls(np.concatenate(logs, axis=1), np.concatenate(truths), np.concatenate(indices))

    def only(self, inside: Bools) -> FusionPlaces:
        """Some of the places."""
        return FusionPlaces(self.logs[:, inside], self.truth[inside], self.part[inside])

    def log_odds(self, weights: Floats, qualities: Floats) -> tuple[Floats, Floats]:
        """(n, characters) weighted sums of both senses, and the (2, n) weights, see `loss`."""
        scaled = weights[:2, None] * np.exp(weights[2:].reshape(2, -1) @ qualities.T)
        return (scaled[:, :, None] * self.logs).sum(axis=0), scaled

    def best(self, weights: Floats, qualities: Floats) -> NDArray[np.intp]:
        """(n,) index of the likeliest character."""
        return self.log_odds(weights, qualities)[0].argmax(axis=1)

    def loss(self, weights: Floats, qualities: Floats) -> tuple[Floats, Floats]:
        """(n,) negative log-likelihoods of the true characters, and their gradients (n, weights).

        Args:
            weights: of touch, of the camera, and log factors of either per unit of each quality.
            qualities: (n, k) qualities; each multiplies both weights by its own factor.
        """
        log, scaled = self.log_odds(weights, qualities)
        total, rows = np.logaddexp.reduce(log, axis=1), np.arange(self.truth.size)
        posterior = np.exp(log - total[:, None])
        by_scaled = (posterior * self.logs).sum(axis=2) - self.logs[:, rows, self.truth]
        by_weight = by_scaled * scaled / weights[:2, None]
        by_factor = (by_scaled * scaled)[:, :, None] * qualities
        gradient = np.concatenate([by_weight.T, by_factor.transpose(1, 0, 2).reshape(rows.size, -1)], axis=1)
        return total - log[rows, self.truth], gradient

    def fit(self, qualities: Floats) -> Floats:
        """Fit the weights, see `loss`."""

        def cost(weights: Floats) -> tuple[float, Floats]:
            loss, gradient = self.loss(weights, qualities)
            return float(loss.sum()), gradient.sum(axis=0)

        factors = 2 * qualities.shape[1]
        start, bounds = np.r_[1.0, 0.5, np.zeros(factors)], [(0.01, 3.0)] * 2 + [(-1.0, 1.0)] * factors
        return np.asarray(minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds).x)


@dataclass(frozen=True)
class _Piece:
    """A straight piece of a term: 0 at its worse end, 1 at its better end, of which a weight is fitted."""

    measure: Measure
    worst: float
    best: float
    unknown: float

    def of(self, value: float | None) -> float:
        """Position between both ends; relative to the value that adds nothing."""
        if value is None:
            return 0.0
        low, high = sorted((self.worst, self.best))
        position = (min(max(value, low), high) - self.worst) / (self.best - self.worst)
        return position - (min(max(self.unknown, low), high) - self.worst) / (self.best - self.worst)


def fit_score(source: str, readings: Sequence[KnownReading], terms: Mapping[Measure, Any] = TERMS) -> Score:
    """Fit the terms that are known of these readings.

    Raises:
        ValueError: no wrong ones, or no right ones.
    """
    right = np.array([reading.right for reading in readings])
    if right.all() or not right.any():
        raise ValueError("a score is fitted to right and wrong readings; give some of both")
    pieces = [
        _Piece(measure, worst, best, unknown)
        for measure, (ends, unknown) in terms.items()
        if any(measure in reading.measures for reading in readings)
        for worst, best in pairwise(ends)
    ]
    values = np.array(
        [[piece.of(reading.measures.get(piece.measure)) for piece in pieces] for reading in readings]
    )
    is_odds = np.array([piece.measure is Measure.ODDS for piece in pieces])
    start = np.where(is_odds, [piece.best - piece.worst for piece in pieces], 0.0)
    scale = np.where(is_odds, start, 1.0)

    def cost(weights: Floats) -> tuple[float, Floats]:
        odds = weights[0] + values @ weights[1:]
        pull = HOLD * (weights[1:] - start) / scale**2
        value = np.logaddexp(0.0, np.where(right, -odds, odds)).sum() + 0.5 * pull @ (weights[1:] - start)
        excess = expit(odds) - right
        return float(value), np.r_[excess.sum(), values.T @ excess + pull]

    bounds = [
        (None, None),
        *((0.05 * unit if odds else 0.0, None) for odds, unit in zip(is_odds, scale, strict=True)),
    ]
    bias, *weights = minimize(cost, np.r_[0.0, start], jac=True, method="L-BFGS-B", bounds=bounds).x.tolist()
    found = {}
    for measure, (ends, _) in terms.items():
        own = [(p, w) for p, w in zip(pieces, weights, strict=True) if p.measure is measure]
        if sum(weight for _, weight in own) > LEAST_WEIGHT:
            points = ((end, round(sum(w * p.of(end) for p, w in own), 4)) for end in sorted(ends))
            found[measure] = Term(tuple(points))
    return Score(source, round(bias, 4), found)


@dataclass(frozen=True, eq=False)
class Judged:
    """A reading with a score by a fit that has not seen the part.

    Attributes:
        mode: one of `SOURCES`: the senses that could be used.
        reading: the reading.
        score: its score.
        alone: score of each sense that reads the same text alone, if both have read.
    """

    mode: str
    reading: KnownReading
    score: float
    alone: Mapping[str, float]


def judge(parts: Sequence[KeptPart], fold: Callable[[KeptPart], str]) -> list[Judged]:
    """Judge the readings of each fold by a fit to the others.

    Args:
        parts: the parts.
        fold: name of the fold of a part, such as its generator.
    """
    judged = []
    for name in sorted({fold(part) for part in parts}):
        fitted = fit([part for part in parts if fold(part) != name])
        for part in parts:
            if fold(part) == name:
                for mode in SOURCES:
                    reading = read(part, mode, fitted)
                    if reading is not None:
                        judged.append(score_reading(mode, reading, fitted))
    return judged


def score_reading(mode: str, reading: KnownReading, fitted: Fit) -> Judged:
    """Score a reading; both senses together are no less sure of a text than one of them alone."""

    def score(reading: KnownReading) -> float:
        return fitted.scores[reading.source].probability(reading.measures)

    both = reading.source == "fused"
    senses = [_by_sense(reading.part, sense) for sense in ("tactile", "vision") if both]
    alone = {
        sense.source: score(sense) for sense in senses if sense is not None and sense.text == reading.text
    }
    return Judged(mode, reading, max(score(reading), *alone.values(), 0.0), alone)


Thresholds = Mapping[str, Mapping[float, ThresholdTest]]
"""Tested thresholds of each risk, by source."""


def risk_thresholds(
    scores: Sequence[float],
    right: Sequence[bool],
    risks: Sequence[float],
    *,
    keeps: Callable[[float, float], bool] = lambda risk, threshold: True,
    **options: Any,
) -> Mapping[float, ThresholdTest]:
    """Find the proven threshold of each risk by itself, as in `threshold_tests`; a risk that none keeps has none.

    `keeps` says whether a risk is also kept otherwise from a threshold on. A smaller risk has no lower threshold: in a
    group that is too small to test it, the larger risk may have failed.
    """
    proven, least = dict[float, ThresholdTest](), 0.0
    for risk in sorted(risks, reverse=True):
        tests = threshold_tests(scores, right, risk=risk, **options)
        kept = [test for test in tests if test.threshold >= least and keeps(risk, test.threshold)]
        test = proven_threshold(kept)
        if test is not None:
            proven[risk], least = test, test.threshold
    return proven


def find_thresholds(judged: Sequence[Judged]) -> Thresholds:
    """Test thresholds on readings that break no contract: together, of each generator, with a format and without.

    Where both senses may be used, one of them has sometimes read alone, or is sure enough alone: then its own threshold
    counts. What is accepted so must keep the risk as well, all parts together.
    """
    found = dict[str, Mapping[float, ThresholdTest]]()
    for source in SOURCES:
        readings = [one for one in judged if one.mode == source and not one.reading.broken]
        by_source = [one for one in readings if one.reading.source == source]
        found[source] = risk_thresholds(
            [one.score for one in by_source],
            [one.reading.right for one in by_source],
            RISKS,
            keeps=partial(_keep_together, readings, source, found),
            confidence=CONFIDENCE_LEVEL,
            thresholds=THRESHOLDS,
            groups=[groups_of(one.reading.part) for one in by_source],
            start_share=START_SHARE,
        )
    return found


def _keep_together(
    readings: Sequence[Judged], source: str, thresholds: Thresholds, risk: float, threshold: float
) -> bool:
    accepted = [
        one
        for one in readings
        if (one.reading.source == source and one.score >= threshold) or accepts(one, thresholds, risk)
    ]
    wrong = sum(not one.reading.right for one in accepted)
    return share_bounds(wrong, len(accepted), confidence=CONFIDENCE_LEVEL)[1] <= risk


def groups_of(part: KeptPart) -> tuple[str, str]:
    """Groups of a part in each of which a threshold must hold."""
    return part.generator, _kind("format", part.format)


def accepts(one: Judged, thresholds: Thresholds, risk: float) -> bool:
    """Whether a reading is accepted at a risk; never by a source that was not shown to keep it."""
    scores = {**(one.alone if risk <= ALONE_RISK else {}), one.reading.source: one.score}
    return not one.reading.broken and any(
        score >= test.threshold
        for source, score in scores.items()
        for tested, test in thresholds.get(source, {}).items()
        if tested <= risk
    )


def kinds_of(parts: Sequence[KeptPart], *fields: str) -> dict[str, list[KeptPart]]:
    """Group parts by the values of fields; all of them together come first."""
    kinds: dict[str, list[KeptPart]] = {"all": list(parts)}
    for part in sorted(parts, key=lambda part: [getattr(part, field) for field in fields]):
        name = ", ".join(_kind(field, getattr(part, field)) for field in fields)
        kinds.setdefault(name, []).append(part)
    return kinds


def _kind(field: str, value: Any) -> str:
    if field == "format":
        return "with a format" if value else "without a format"
    return f"dirt {value:g}" if field == "severity" else str(value)


def _of(judged: Sequence[Judged], parts: Sequence[KeptPart], mode: str) -> list[Judged]:
    numbers = {part.number for part in parts}
    return [one for one in judged if one.mode == mode and one.reading.part.number in numbers]


def risk_table(parts: Sequence[KeptPart], judged: Sequence[Judged], thresholds: Thresholds) -> Iterator[str]:
    """Promised risk against seen, by sense and kind of parts, and the share that is accepted; Markdown."""
    yield "| sense | risk | from score | parts | wrong of accepted | of right ones accepted | of parts accepted |"
    yield "|" + "---|" * 7
    kinds = kinds_of(parts, "generator") | kinds_of(parts, "format")
    for mode, tested in thresholds.items():
        least = min(tested, default=1.0)
        for risk in sorted({*SHOWN_RISKS, *tested}, reverse=True):
            start = f"| {MODE_NAMES[mode]} | {risk_in_words(risk)} |"
            if risk < least:
                yield f"{start} not kept | | | | |"
                continue
            score = min(test.threshold for kept, test in tested.items() if kept <= risk)
            for name, own_parts in kinds.items() if risk in (*SHOWN_RISKS, least) else [("all", parts)]:
                own = _of(judged, own_parts, mode)
                accepted = [one for one in own if accepts(one, thresholds, risk)]
                wrong = exact_share(sum(not one.reading.right for one in accepted), len(accepted))
                of_right = (wrong.total - wrong.count) / max(sum(one.reading.right for one in own), 1)
                yield (
                    f"{start} {score:.4f} | {name} | {wrong.count} of {wrong.total:,}, at most {wrong.high:.2%} "
                    f"| {of_right:.1%} | {wrong.total / len(own_parts):.1%} |"
                )


def fusion_table(
    parts: Sequence[KeptPart], judged: Sequence[Judged], thresholds: Thresholds, *, risk: float
) -> Iterator[str]:
    """Both senses together against each alone, on the same parts; Markdown."""
    yield (
        "| parts | number | right: touch, camera, both | only both, only the better "
        "| accepted: touch, camera, both | wrong of these |"
    )
    yield "|" + "---|" * 6
    for fields in (("severity",), ("generator",), ("format",), ("generator", "severity")):
        for name, own_parts in kinds_of(parts, *fields).items():
            if name == "all" and fields != ("severity",):
                continue
            own = {mode: _of(judged, own_parts, mode) for mode in SOURCES}
            right = {
                mode: {one.reading.part.number for one in own[mode] if one.reading.right} for mode in SOURCES
            }
            accepted = {
                mode: [one for one in own[mode] if accepts(one, thresholds, risk)] for mode in SOURCES
            }
            wrong = {mode: sum(not one.reading.right for one in accepted[mode]) for mode in SOURCES}
            better = max(right["tactile"], right["vision"], key=len)
            yield (
                f"| {name} | {len(own_parts):,} | {', '.join(str(len(right[mode])) for mode in SOURCES)} "
                f"| {len(right['fused'] - better)}, {len(better - right['fused'])} "
                f"| {', '.join(str(len(accepted[mode])) for mode in SOURCES)} "
                f"| {', '.join(str(wrong[mode]) for mode in SOURCES)} |"
            )


def format_table(
    parts: Sequence[KeptPart], judged: Sequence[Judged], thresholds: Thresholds, *, risks: Sequence[float]
) -> Iterator[str]:
    """Parts of generators that share no code with ours, with a format, by dirt; Markdown."""
    yield (
        "| sense | parts | number | right | of right ones accepted: "
        + ", ".join(map(risk_in_words, risks))
        + " | wrong of accepted |"
    )
    yield "|" + "---|" * 6
    chosen = [part for part in parts if part.generator not in OURS and part.format]
    for mode in SOURCES:
        for name, own_parts in kinds_of(chosen, "severity").items():
            own = _of(judged, own_parts, mode)
            right = max(sum(one.reading.right for one in own), 1)
            accepted = [[one for one in own if accepts(one, thresholds, risk)] for risk in risks]
            shares = (f"{sum(one.reading.right for one in each) / right:.1%}" for each in accepted)
            wrong = (f"{sum(not one.reading.right for one in each)} of {len(each):,}" for each in accepted)
            yield (
                f"| {MODE_NAMES[mode]} | {name} | {len(own_parts):,} | {right / len(own_parts):.1%} "
                f"| {', '.join(shares)} | {', '.join(wrong)} |"
            )


def calibration_table(judged: Mapping[str, Sequence[Judged]]) -> Iterator[str]:
    """Distance of score and share right, and the area under the risk-coverage curve, by what was left out; Markdown."""
    yield "| sense | left out in turn | readings | right | ECE | AURC |"
    yield "|" + "---|" * 6
    for mode in SOURCES:
        for name, all_judged in judged.items():
            own = [one for one in all_judged if one.mode == mode]
            scores, right = [one.score for one in own], [one.reading.right for one in own]
            error, area = reliability(scores, right).error, risk_coverage(scores, right).area
            yield (
                f"| {MODE_NAMES[mode]} | {name} | {len(own):,} | {np.mean(right):.1%} | {error:.3f} | {area:.4f} |"
            )


QUALITIES: Mapping[str, tuple[str, Measure]] = {
    "grain of the photograph": ("vision", Measure.GRAIN),
    "patches of the photograph": ("vision", Measure.PATCHES),
    "format on the photograph": ("vision", Measure.FORMAT),
    "fine roughness against depth": ("tactile", Measure.FINE_SHARE),
    "coarse roughness against depth": ("tactile", Measure.COARSE_SHARE),
    "cover of deciding strokes": ("tactile", Measure.COVERED),
    "share of strokes felt": ("tactile", Measure.STROKES),
    "format in the felt line": ("tactile", Measure.FORMAT),
}
"""Qualities of a sense on which the weights of fusion might depend."""


def quality_table(parts: Sequence[KeptPart]) -> Iterator[str]:
    """Weights that depend on a quality, against constant ones: both judged on left-out generators; Markdown.

    The loss is that of the conditional logit, summed over all places: less is better.
    """
    yield "| weights depend on | loss | serials right | factor of touch, of camera per standard deviation |"
    yield "|" + "---|" * 4
    places = FusionPlaces.of(parts)
    generators = np.array([parts[index].generator for index in places.part])
    columns: dict[str, Floats] = {"nothing": np.zeros((places.part.size, 0))}
    for name, (sense, measure) in QUALITIES.items():
        known = [part.readings[sense].measures.get(measure, np.nan) for part in parts]
        values = np.nan_to_num((known - np.nanmean(known)) / np.nanstd(known))
        columns[name] = values[places.part][:, None]
    for sense, logs in zip(("touch", "camera"), places.logs, strict=True):
        sure = np.bincount(places.part, logs.max(axis=1)) / np.maximum(np.bincount(places.part), 1)
        columns[f"sureness of {sense}"] = ((sure - sure.mean()) / sure.std())[places.part][:, None]
    for name, qualities in columns.items():
        loss, wrong_parts, factors = 0.0, set[int](), []
        for generator in np.unique(generators):
            inside = generators == generator
            weights = places.only(~inside).fit(qualities[~inside])
            tested = places.only(inside)
            values, best = tested.loss(weights, qualities[inside])[0], tested.best(weights, qualities[inside])
            loss += float(values.sum())
            wrong_parts |= set(tested.part[best != tested.truth].tolist())
            factors.append(np.exp(weights[2:]))
        mean = np.mean(factors, axis=0)
        shown = ", ".join(f"{factor:.2f}" for factor in mean)
        yield f"| {name} | {loss:.1f} | {np.unique(places.part).size - len(wrong_parts):,} | {shown} |"


OURS = ("sketched", "stamped")
"""Generators whose code is ours."""
MODE_NAMES = {"tactile": "touch", "vision": "camera", "fused": "both"}
SHOWN_RISKS = (0.05, 0.01, 0.001)
LENIENT_RISK = 0.01
"""Risk at which both senses are compared besides the least one that both of them keep."""
FONT_FOLDS = 8


def font_fold(part: KeptPart) -> str:
    """Fold of a font family: the first word of its file name."""
    return str(crc32(part.font.split("-")[0].encode()) % FONT_FOLDS)


def report(
    parts: Sequence[KeptPart], fitted: Fit, judged: Sequence[Judged], thresholds: Thresholds
) -> Iterator[str]:
    """All tables, each under its heading; Markdown."""
    generators = ", ".join(
        f"{len(own):,} {name}" for name, own in kinds_of(parts, "generator").items() if name != "all"
    )
    yield f"{len(parts):,} parts ({generators}) in {len({part.font for part in parts})} font files."
    yield from ("", "### Promised risk and risk seen", "", *risk_table(parts, judged, thresholds))
    both = {max(min(thresholds[mode], default=1.0) for mode in ("tactile", "fused")), LENIENT_RISK}
    for risk in sorted(both - {1.0}, reverse=True):
        yield from ("", f"### Touch and camera together, at a risk of {risk_in_words(risk)}", "")
        yield from fusion_table(parts, judged, thresholds, risk=risk)
    risks = (LENIENT_RISK, 0.002, 0.001)
    yield from ("", "### Generators that are not ours, with a format", "")
    yield from format_table(parts, judged, thresholds, risks=risks)
    yield from ("", "### Weights of fusion that depend on the quality of a sense", "", *quality_table(parts))
    by_fold = {"generators": judged, "fonts": judge(parts, font_fold)}
    yield from ("", "### Calibration", "", *calibration_table(by_fold))
    yield from (
        "",
        "### Fit",
        "",
        f"Weights of fusion: touch {fitted.weights.touch:g}, camera {fitted.weights.camera:g}.",
    )
    yield from ("", "| sense | measure | log odds added at its values |", "|---|---|---|")
    for source, score in fitted.scores.items():
        yield f"| {MODE_NAMES[source]} | none | {score.bias:g} |"
        for measure, term in score.terms.items():
            curve = ", ".join(f"{nats:g} at {value:g}" for value, nats in term.points)
            yield f"| {MODE_NAMES[source]} | {measure.value} | {curve} |"


def main(readings: Path = KEPT, *, write: bool = False) -> None:
    """Fit, print the tables as Markdown, and write the fits.

    Args:
        readings: file of kept readings.
        write: replace the fits of the package.
    """
    parts = load(readings)
    judged, thresholds, fitted = fit_all(parts)
    for line in report(parts, fitted, judged, thresholds):
        print(line)
    if write:
        for path, content in contents_of(parts, thresholds, fitted).items():
            path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def fit_all(parts: Sequence[KeptPart]) -> tuple[list[Judged], Thresholds, Fit]:
    """Parts judged by the fit to the other generators, the thresholds from them, and the fit to all parts."""
    judged = judge(parts, lambda part: part.generator)
    return judged, find_thresholds(judged), fit(parts)


def contents_of(parts: Sequence[KeptPart], thresholds: Thresholds, fitted: Fit) -> dict[Path, dict[str, Any]]:
    """The fits of the package, by their files."""
    heading = {
        "command": "python tests/benchmarks/fit_score.py --write",
        "fonts": sorted({part.font for part in parts}),
        "soils": list(SOILS),
        "editions": dict(sorted(Counter(part.generator for part in parts).items())),
    }
    score = {"what": "weights and thresholds of the score (recognition/decide/score.py)", **heading}
    weights = {"what": "weights of fusion (recognition/decide/fuse_lattices.py)", **heading}
    return {
        scoring.FITTED: {**score, "scores": _scores(fitted, thresholds)},
        fusion.FITTED: {**weights, "weights": asdict(fitted.weights)},
    }


def _scores(fitted: Fit, thresholds: Thresholds) -> dict[str, Any]:
    return {
        source: {
            "bias": score.bias,
            "terms": {measure.name: term.points for measure, term in score.terms.items()},
            "thresholds": [
                asdict(RiskThreshold(risk, test.threshold, test.accepted, test.wrong, round(test.bound, 6)))
                for risk, test in thresholds[source].items()
            ],
        }
        for source, score in fitted.scores.items()
    }


if __name__ == "__main__":
    from cyclopts import run

    run(main)
