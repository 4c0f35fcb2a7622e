"""Fit the reader's confidences to a benchmark, and show what they are worth on what the fit left out::

    tactile-marks benchmark --design tests/benchmarks/calibration.toml --parts 384 --jobs 2 --out fit
    python tests/benchmarks/fit_confidence.py fit --write

The readings of each sense fit a calibration (`recognition.belief.calibration`) and the ranges of the measures in which
it holds. Soils and fonts that the exam keeps out are in no fit. Each soil, then each font, is left out in turn and its
readings are judged by a fit to the others. The last table counts what the benchmark's reader accepted, by every rule.

A calibration is a logistic regression on the log odds of the belief (Platt, Advances in Large Margin Classifiers,
1999). Temperature alone, beta and isotonic calibration were compared with it on 1,557 readings by touch: none had a
lower log loss on the worst soil (CHANGELOG, 2026-11-23).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.bounds import bounded
from pipeline.benchmark.analysis.calibration import reliability
from pipeline.benchmark.trials.journal import Trial, TrialJournal
from recognition.belief.calibration import CALIBRATED, SOURCES, Calibration, calibration_of, shrunk
from recognition.decision.known_ground import GROUND
from recognition.decision.part_measures import Measure
from recognition.decision.reading import Decision
from recognition.senses.settings import ReaderSettings

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
THRESHOLDS = (0.9, 0.95, 0.97, 0.98, 0.99, 0.995)
"""Confidences from which readings might be accepted."""
FEWEST, FEWEST_WRONG = 10, 10
"""Readings of a group that has a row of its own; wrong readings, and right ones, of a fit."""
OFF, FEWEST_MEASURED = 0.01, 100
"""Share of readings beyond the worse end of a range, and readings below which there is none."""
WORSE_BELOW = (Measure.STROKES,)
"""Measures that are the worse the less there is."""
_LEAST = 1e-6


@dataclass(frozen=True)
class KnownReading:
    """A reading of a part whose text is known.

    Attributes:
        source: one of `SOURCES`.
        belief: in the text.
        right: whether it is right.
        soil: of the part.
        font: of the mark.
        severity: of the dirt.
        kept_out: nothing may be fitted to it.
        measures: of the part, by name, those that have a range.
        accepted: whether the benchmark's reader accepted it.
    """

    source: str
    belief: float
    right: bool
    soil: str
    font: str
    severity: float
    kept_out: bool
    measures: Mapping[str, float]
    accepted: bool


def known_readings(folder: Path) -> Iterator[KnownReading]:
    """Read the readings of a finished benchmark; where no text was read the belief is 0.

    Raises:
        FileError: the folder holds no benchmark.
    """
    journal = TrialJournal.read(folder)
    design: Mapping[str, Any] = journal.description["parts"]
    used = journal.description.get("calibrations", {})
    worth = {source: Calibration(**used.get(source, {})) for source in SOURCES}
    soils = frozenset(design.get("kept_out_soils", ()))
    sections = tuple(f"{s['name']}-" for s in design.get("section", ()) if s["kept_out"])
    for trials in journal.done.values():
        for trial in trials:
            if trial.mode in SOURCES and not trial.error and not trial.perturbed:
                soil = str(trial.levels.get("soil", ""))
                kept_out = trial.part.startswith(sections) or bool(soils & {*soil.split("+")})
                yield _known(trial, soil, worth[trial.mode], kept_out=kept_out)


def _known(trial: Trial, soil: str, worth: Calibration, *, kept_out: bool) -> KnownReading:
    measures = {one.name: trial.measures[one.value] for one in GROUND if one.value in trial.measures}
    widths = worth.off(measures)
    return KnownReading(
        source=trial.mode,
        belief=worth.belief(shrunk(trial.confidence, 1.0 / (1.0 + widths) - 1.0)),  # undo the shrinking
        right=trial.right,
        soil=soil,
        font=trial.font,
        severity=trial.severity or 0.0,
        kept_out=kept_out,
        measures=measures,
        accepted=trial.decision == Decision.ACCEPT.value,
    )


def fit(readings: Sequence[KnownReading]) -> Calibration:
    """Fit slope, bias and ranges to known readings.

    Raises:
        ValueError: too few right or wrong ones.
    """
    from sklearn.linear_model import LogisticRegression

    beliefs, right = _columns(readings)
    if min(int(right.sum()), int((~right).sum())) < FEWEST_WRONG:
        raise ValueError(
            f"{right.sum()} right and {(~right).sum()} wrong readings are too few; give {FEWEST_WRONG} of each"
        )
    inside = np.clip(beliefs, _LEAST, 1.0 - _LEAST)
    odds = (np.log(inside) - np.log1p(-inside))[:, None]
    model = LogisticRegression(C=np.inf, max_iter=1000).fit(odds, right)
    slope, bias = float(model.coef_[0, 0]), float(model.intercept_[0])
    return Calibration(round(slope, 3), round(bias, 3), _ranges([one.measures for one in readings]))


def _ranges(measures: Sequence[Mapping[str, float]]) -> dict[str, tuple[float, float]]:
    """The range of each measure: all readings but the worst `OFF`, and whatever is better."""
    worse_below = [one.name for one in WORSE_BELOW]
    found = {}
    for name in sorted({name for one in measures for name in one}):
        values = [one[name] for one in measures if name in one]
        low, high = (float(f"{edge:.3g}") for edge in np.quantile(values, (OFF, 1.0 - OFF)))
        if len(values) >= FEWEST_MEASURED:
            found[name] = (low, 1.0) if name in worse_below else (0.0, high)
    return found


@dataclass(frozen=True)
class Judged:
    """Readings judged by a fit that has not seen them.

    Attributes:
        name: what they have in common.
        right: (n,) whether they are right.
        severity: (n,) of their dirt.
        beliefs: (n,) before the fit.
        said: (n,) confidences by the fit.
        off: (n,) widths beyond the ranges, by which confidences have shrunk.
    """

    name: str
    right: Bools
    severity: Floats
    beliefs: Floats
    said: Floats
    off: Floats

    def row(self, threshold: float) -> str:
        """A line of the table of what was left out."""
        accepted = self.said >= threshold
        wrong = bounded(int((accepted & ~self.right).sum()), int(accepted.sum()))
        cells = [
            f"{self.name} | {self.right.size:,} | {self.right.mean():.1%}",
            f"{_ece(self.beliefs, self.right):.3f} → {_ece(self.said, self.right):.3f}",
            f"{loss(self.beliefs, self.right):.3f} → {loss(self.said, self.right):.3f}",
            f"{wrong.count} of {wrong.total:,} | {wrong.high:.2%} | {(self.off > 0.0).mean():.1%}",
        ]
        return f"| {' | '.join(cells)} |"


def left_out(readings: Sequence[KnownReading], factor: str) -> Iterator[Judged]:
    """Judge the readings of every level of a factor ("soil", "font") by a fit to the others."""
    for level in sorted({getattr(one, factor) for one in readings}):
        own = [one for one in readings if getattr(one, factor) == level]
        others = [one for one in readings if getattr(one, factor) != level and not one.kept_out]
        if len(own) >= FEWEST:
            yield _judged(level, own, fit(others))


def _judged(name: str, own: Sequence[KnownReading], made: Calibration) -> Judged:
    beliefs, right = _columns(own)
    off = np.array([made.off(one.measures) for one in own])
    said = np.array([shrunk(made.confidence(b), widths) for b, widths in zip(beliefs, off, strict=True)])
    return Judged(name, right, np.array([one.severity for one in own]), beliefs, said, off)


def together(name: str, parts: Collection[Judged]) -> Judged:
    """Join readings, each judged by its own fit."""
    columns = ("right", "severity", "beliefs", "said", "off")
    return Judged(name, *(np.concatenate([getattr(one, column) for one in parts]) for column in columns))


def loss(confidences: Floats, right: Bools) -> float:
    """Mean surprise at what was right, nats a reading; none surprises by more than 1 in 10,000 would."""
    said = np.clip(confidences, 1e-4, 1.0 - 1e-4)
    return float(-np.mean(np.log(np.where(right, said, 1.0 - said))))


def _columns(readings: Sequence[KnownReading]) -> tuple[Floats, Bools]:
    return np.array([one.belief for one in readings]), np.array([one.right for one in readings], dtype=bool)


def _ece(said: Floats, right: Bools) -> float:
    return reliability(said.tolist(), right.tolist()).error


def tables(source: str, readings: Sequence[KnownReading], *, threshold: float) -> Iterator[str]:
    """Lines of Markdown about the readings of one source, each judged by a fit without it."""
    by_soil, by_font = (list(left_out(readings, factor)) for factor in ("soil", "font"))
    yield from (f"### {source}", "")
    yield f"| left out | readings | right | ECE | log loss | wrong of accepted from {threshold:g} | at most | off |"
    yield "|" + "---|" * 8
    for one in (*by_soil, together("each soil", by_soil), together("each font", by_font)):
        yield one.row(threshold)
    joined = together("", by_soil)
    levels = sorted({float(one) for one in joined.severity})
    yield from ("", f"| accepted from | wrong | accepted | {' | '.join(f'dirt {one:g}' for one in levels)} |")
    yield "|" + "---|" * (3 + len(levels))
    for least in THRESHOLDS:
        yield _counts(f"{least:g}", joined.right, joined.said >= least, joined.severity, levels)


def decisions(readings: Sequence[KnownReading]) -> Iterator[str]:
    """Lines of Markdown: what the benchmark's reader accepted, by soil and dirt."""
    levels = sorted({one.severity for one in readings})
    yield from ("", f"| by every rule | wrong | accepted | {' | '.join(f'dirt {one:g}' for one in levels)} |")
    yield "|" + "---|" * (3 + len(levels))
    for soil in (*sorted({one.soil for one in readings}), "all soils"):
        own = [one for one in readings if soil in (one.soil, "all soils")]
        columns = [
            np.array([getattr(one, name) for one in own]) for name in ("right", "accepted", "severity")
        ]
        yield _counts(soil, *columns, levels)
    yield ""


def _counts(name: str, right: Bools, accepted: Bools, severity: Floats, levels: Sequence[float]) -> str:
    wrong = bounded(int((accepted & ~right).sum()), int(accepted.sum()))
    cells = [f"{name} | {wrong.count} of {wrong.total:,}, at most {wrong.high:.2%} | {accepted.mean():.1%}"]
    cells += [
        f"{accepted[severity == level].mean():.1%}" if (severity == level).any() else "" for level in levels
    ]
    return f"| {' | '.join(cells)} |"


def _sizes(folders: Sequence[Path]) -> dict[str, int]:
    """How many parts of each design were read, by its name."""
    parts: dict[str, set[str]] = {}
    for folder in folders:
        journal = TrialJournal.read(folder)
        parts.setdefault(str(journal.description["parts"].get("name", "")), set()).update(journal.done)
    return {name: len(found) for name, found in parts.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit, print the tables, and with --write keep the fit; sources that were not read keep theirs."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("benchmarks", type=Path, nargs="+", help="folders of benchmarks (--out)")
    asked.add_argument(
        "--threshold", type=float, default=ReaderSettings().accept_confidence, help="of acceptance"
    )
    asked.add_argument("--write", action="store_true", help=f"replace {CALIBRATED.name}")
    given = asked.parse_args(arguments)
    readings = [one for folder in given.benchmarks for one in known_readings(folder)]
    before = json.loads(CALIBRATED.read_text(encoding="utf-8")) if CALIBRATED.exists() else {"readings": {}}
    fitted, counts = {}, {}
    for source in SOURCES:
        tried = [one for one in readings if one.source == source]
        own = [one for one in tried if one.belief > 0.0]
        known = [one for one in own if not one.kept_out]
        if not own:
            fitted[source], counts[source] = asdict(calibration_of(source)), before["readings"].get(source, 0)
            continue
        made = fit(known)
        fitted[source], counts[source] = asdict(made), len(known)
        print("\n".join((*tables(source, own, threshold=given.threshold), *decisions(tried))))
        print(f"fitted on {len(known):,} readings: {made}\n")
    if given.write:
        known = [one for one in readings if not one.kept_out and one.belief > 0.0]
        manifest = {
            "what": "confidences of beliefs (recognition/belief/calibration.py)",
            "command": "python tests/benchmarks/fit_confidence.py BENCHMARK ... --write",
            "made": date.today().isoformat(),
            "fonts": sorted({one.font for one in known}),
            "soils": sorted({one.soil for one in known}),
            "editions": _sizes(given.benchmarks),
            "readings": counts,
            "calibrations": fitted,
        }
        CALIBRATED.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
