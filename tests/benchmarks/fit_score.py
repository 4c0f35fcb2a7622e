"""Fit the score to parts whose text is known, and judge it on what each fit left out::

    tactile-marks benchmark run --design tests/benchmarks/calibration.toml --parts 680 --jobs 2 --out stamped
    python tests/benchmarks/sketched_parts.py --parts 300 --out sketched
    python tests/benchmarks/fit_score.py stamped sketched --write

Each folder is a generator of parts. The readings of a sense fit a logistic regression on named quantities
(`recognition.decide.score`), whose weights may not point the wrong way: more covered strokes never raise a score.
Each soil, each font and each generator is left out in turn, and its readings are judged by a fit to the others. What
the exam keeps out is in no fit.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.confidence import reliability, risk_coverage
from pipeline.benchmark.analysis.estimates import exact_share
from pipeline.benchmark.trials.journal import Trial, TrialJournal
from recognition.decide.score import FITTED, SOURCES, Measure, Score, Term
from recognition.settings import ReaderSettings

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
BETTER = {
    Measure.ODDS: 1,
    Measure.CAMERA: 1,
    Measure.FORMAT: 1,
    Measure.LEAST_STROKES: 1,
    Measure.STROKES: 1,
    Measure.COVERED: -1,
    Measure.UNLIKENESS: -1,
    Measure.FINE_SHARE: -1,
    Measure.COARSE_SHARE: -1,
    Measure.GRAIN: -1,
    Measure.PATCHES: -1,
}
"""Quantities that may count, and whether more of each is better."""
HOLD = 0.3
"""Weight of the penalty that pulls each weight to where it starts: 1 for the log odds of the text, 0 for the others."""
LEAST_WEIGHT = 0.02
"""Log odds over a quantity's whole range below which it is left out."""
KNEED, KNEE_ODDS = (Measure.ODDS, Measure.CAMERA), 0.0
"""Log odds, and from where down they count by another line."""
OFF = 0.01
"""Share of readings beyond the worse end of a range."""
RISKS = (0.05, 0.02, 0.01, 0.007, 0.005, 0.003, 0.002, 0.001, 0.0005)
"""Shares of wrong ones among the accepted for which thresholds are kept."""
FEWEST = 20
"""Readings of a group that has a row of its own, and of a quantity that counts."""
MOST_ODDS = 12.0
_LEAST = 1e-3


@dataclass(frozen=True)
class KnownReading:
    """A reading of a part whose text is known.

    Attributes:
        source: one of `SOURCES`.
        right: whether it is right.
        generator: that made the part.
        soil: of the part.
        font: of the mark.
        severity: of the dirt.
        kept_out: nothing may be fitted to it.
        measures: what is known of the reading.
        broken: whether a contract keeps it from acceptance.
    """

    source: str
    right: bool
    generator: str
    soil: str
    font: str
    severity: float
    kept_out: bool
    measures: Mapping[Measure, float]
    broken: bool = False


def known_readings(folder: Path) -> Iterator[KnownReading]:
    """Read the readings of a finished benchmark that read any text.

    Raises:
        FileError: the folder holds no benchmark.
    """
    journal = TrialJournal.read(folder)
    design: Mapping[str, Any] = journal.description["parts"]
    soils = frozenset(design.get("kept_out_soils", ()))
    sections = tuple(f"{s['name']}-" for s in design.get("section", ()) if s["kept_out"])
    for trials in journal.done.values():
        for trial in trials:
            if trial.mode in SOURCES and trial.text and not trial.error and not trial.perturbed:
                soil = str(trial.levels.get("soil", ""))
                kept_out = trial.part.startswith(sections) or bool(soils & {*soil.split("+")})
                yield _known(trial, folder.name, soil, kept_out=kept_out)


def _known(trial: Trial, generator: str, soil: str, *, kept_out: bool) -> KnownReading:
    return KnownReading(
        source=trial.mode,
        right=trial.right,
        generator=generator,
        soil=soil,
        font=str(trial.levels.get("font") or ""),
        severity=trial.severity or 0.0,
        kept_out=kept_out,
        measures={Measure(name): value for name, value in trial.measures.items()},
        broken=trial.confidence >= ReaderSettings().accept_confidence and not trial.accepted,
    )


def fit(readings: Sequence[KnownReading]) -> Score:
    """Fit the weights of the quantities that are known of these readings.

    Raises:
        ValueError: no wrong ones, or no right ones, or none with a belief.
    """
    from scipy.optimize import minimize

    right = np.array([one.right for one in readings])
    if right.all() or not right.any():
        raise ValueError("a score is fitted to right and wrong readings; give some of both")
    lines = [line for name in BETTER for line in _lines(name, readings)]
    values = np.array([[line.of(one.measures.get(line.name)) for line in lines] for one in readings])
    start = np.array([float(line.name is Measure.ODDS) for line in lines])

    def cost(w: Floats) -> tuple[float, Floats]:
        odds = w[0] + values @ w[1:]
        said = 1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0)))
        pull = w[1:] - start
        value = np.logaddexp(0.0, np.where(right, -odds, odds)).sum() + 0.5 * HOLD * float(pull @ pull)
        return value, np.r_[(said - right).sum(), values.T @ (said - right) + HOLD * pull]

    least = [(None, None), *((0.05 if one else 0.0, None) for one in start)]
    found = minimize(cost, np.r_[0.0, start], jac=True, method="L-BFGS-B", bounds=least).x
    terms = {}
    for name in BETTER:
        own = [(line, w) for line, w in zip(lines, found[1:], strict=True) if line.name is name]
        if own and sum(w for _, w in own) > LEAST_WEIGHT:
            at = sorted({v for line, _ in own for v in (line.first, line.last)})
            points = [(float(f"{v:.4g}"), round(sum(w * line.of(v) for line, w in own), 4)) for v in at]
            terms[name] = Term(own[0][0].usual, tuple(points))
    return Score(round(float(found[0]), 4), terms)


@dataclass(frozen=True)
class _Line:
    """A quantity that counts along one straight line: nothing at its usual value, level beyond its ends.

    Attributes:
        name: of the quantity.
        first: least value.
        last: greatest value.
        usual: value that counts nothing.
        unit: that counts one; negative where less is better.
    """

    name: Measure
    first: float
    last: float
    usual: float
    unit: float

    def of(self, value: float | None) -> float:
        return 0.0 if value is None else (min(max(value, self.first), self.last) - self.usual) / self.unit


def _lines(name: Measure, readings: Sequence[KnownReading]) -> list[_Line]:
    """Along which a quantity counts; none where too few readings have it."""
    # what is hardly believed at all counts by a line of its own
    if name in KNEED and any(name in one.measures for one in readings):
        return [
            _Line(name, -MOST_ODDS, KNEE_ODDS, KNEE_ODDS, 1.0),
            _Line(name, KNEE_ODDS, MOST_ODDS, KNEE_ODDS, 1.0),
        ]
    have = np.array([one.measures[name] for one in readings if name in one.measures])
    if have.size < FEWEST:
        return []
    usual = float(f"{np.median(have):.3g}")
    if BETTER[name] > 0:  # better than usual is no better
        first = min(float(f"{np.quantile(have, OFF):.3g}"), usual - _LEAST)
        return [_Line(name, first, usual, usual, usual - first)]
    # what is worse than all that was seen counts more than they
    last = max(float(f"{2.0 * np.quantile(have, 1.0 - OFF) - usual:.3g}"), usual + _LEAST)
    return [_Line(name, usual, last, usual, usual - last)]


@dataclass(frozen=True)
class Judged:
    """Readings judged by a fit that has not seen them.

    Attributes:
        name: what they have in common.
        right: (n,) whether they are right.
        severity: (n,) of their dirt.
        said: (n,) scores.
        broken: (n,) whether a contract keeps them from acceptance.
    """

    name: str
    right: Bools
    severity: Floats
    said: Floats
    broken: Bools

    def row(self, threshold: float) -> str:
        """A line of the table of what was left out."""
        accepted = (self.said >= threshold) & ~self.broken
        wrong = exact_share(int((accepted & ~self.right).sum()), int(accepted.sum()))
        share_of_right = (accepted & self.right).sum() / max(int(self.right.sum()), 1)
        said, good = self.said.tolist(), self.right.tolist()
        error, area = reliability(said, good).error, risk_coverage(said, good).area
        cells = [
            f"{self.name} | {self.right.size:,} | {self.right.mean():.1%} | {share_of_right:.1%}",
            f"{wrong.count} of {wrong.total:,}, at most {wrong.high:.2%} | {error:.3f} | {area:.4f}",
        ]
        return f"| {' | '.join(cells)} |"


def judged(name: str, own: Sequence[KnownReading], made: Score) -> Judged:
    """Judge readings by a fit."""
    said = np.array([made.probability(one.measures) for one in own])
    columns = (np.array([getattr(one, field) for one in own]) for field in ("right", "severity", "broken"))
    right, severity, broken = columns
    return Judged(name, right, severity, said, broken)


def left_out(readings: Sequence[KnownReading], factor: str) -> Iterator[Judged]:
    """Judge the readings of every level of a factor ("soil", "font", "generator") by a fit to the others."""
    for level in sorted({getattr(one, factor) for one in readings}):
        own = [one for one in readings if getattr(one, factor) == level]
        others = [one for one in readings if getattr(one, factor) != level and not one.kept_out]
        if len(own) >= FEWEST and others:
            yield judged(level, own, fit(others))


def together(name: str, parts: Sequence[Judged]) -> Judged:
    """Join readings, each judged by its own fit."""
    columns = ("right", "severity", "said", "broken")
    return Judged(name, *(np.concatenate([getattr(one, column) for one in parts]) for column in columns))


def tables(source: str, readings: Sequence[KnownReading], *, threshold: float) -> Iterator[str]:
    """Lines of Markdown about the readings of one source, each judged by a fit without it."""
    yield from (f"### {source}", "")
    yield f"| left out | readings | right | of these accepted from {threshold:g} | wrong of accepted | ECE | AURC |"
    yield "|" + "---|" * 7
    for factor in ("soil", "generator", "font"):
        parts = list(left_out(readings, factor))
        if factor != "font":
            yield from (one.row(threshold) for one in parts)
        if parts:
            yield together(f"each {factor}", parts).row(threshold)
            if factor == "soil":
                joined = together("", parts)
                for level in (0.0, 0.3, 0.6, 0.9):
                    at = np.abs(joined.severity - level) < 0.15
                    own = (getattr(joined, c)[at] for c in ("right", "severity", "said", "broken"))
                    if at.any():
                        yield Judged(f"dirt {level:g}", *own).row(threshold)
    yield ""


def thresholds(said: Floats) -> list[tuple[float, float]]:
    """For each of `RISKS` the least score from which readings are expected to keep it, by their own scores."""
    falling = np.sort(said)[::-1]
    expected = np.cumsum(1.0 - falling) / np.arange(1, falling.size + 1)
    return [
        (risk, float(f"{np.ceil(1e5 * falling[int((expected <= risk).sum()) - 1]) / 1e5:.5f}"))
        for risk in RISKS
        if (expected <= risk).sum() >= FEWEST
    ]


def main(
    *benchmarks: Path, threshold: float = ReaderSettings().accept_confidence, write: bool = False
) -> None:
    """Fit, print the tables, and keep the fit where it is to be written.

    Args:
        benchmarks: folders of benchmarks (--out), one a generator.
        threshold: of acceptance.
        write: replace the fit that there is.
    """
    readings = [one for folder in benchmarks for one in known_readings(folder)]
    fitted = {}
    for source in SOURCES:
        own = [one for one in readings if one.source == source]
        made = fit([one for one in own if not one.kept_out])
        fitted[source] = {
            "bias": made.bias,
            "terms": {name.name: asdict(term) for name, term in made.terms.items()},
            "thresholds": thresholds(together("", list(left_out(own, "soil"))).said),
        }
        print("\n".join(tables(source, own, threshold=threshold)))
        print(f"fitted: {made}\n")
    if write:
        known = [one for one in readings if not one.kept_out]
        manifest = {
            "what": "weights of the score (recognition/decide/score.py)",
            "command": "python tests/benchmarks/fit_score.py BENCHMARK ... --write",
            "made": date.today().isoformat(),
            "fonts": sorted({one.font for one in known}),
            "soils": sorted({one.soil for one in known}),
            "editions": {
                generator: sum(one.generator == generator for one in known)
                for generator in sorted({one.generator for one in known})
            },
            "scores": fitted,
        }
        FITTED.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
