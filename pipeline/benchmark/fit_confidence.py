"""What the reader's confidence is worth, fitted on benchmarks of the exam; and how it does on what was left out::

    tactile-marks benchmark --design marks-exam-1 --mode "tactile,tactile own+templates,vision,fused" --out exam
    python -m pipeline.benchmark.fit_confidence exam --write

Of each mode the known readings of the exam fit a calibration (`recognition.belief.calibration`), those with soils and
fonts that the exam keeps out excepted, and the ground on which it holds. Printed are tables in Markdown. Every soil in
turn is left out of the fit, and its readings, those of fonts kept out among them, are judged by what the others say;
likewise every font. What stands before an arrow is the belief itself. A reading counts as accepted here by its
confidence alone, whatever other doubts there are; the last table counts decisions as the benchmark has them.
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

from pipeline.benchmark.analysis.bounds import bounded
from pipeline.benchmark.analysis.calibration import reliability
from pipeline.benchmark.trials.journal import TrialJournal
from recognition.belief.calibration import CALIBRATED, SOURCES, Calibration, calibration_of, shrunk
from recognition.decision.known_ground import GROUND, WORSE_BELOW
from recognition.decision.reading import Decision
from recognition.learning.fit_calibration import WAYS, Bools, Floats, fit_calibration, fit_ground, loss
from recognition.senses.settings import ReaderSettings

SERVES = "log odds"
"""The way whose calibration serves."""
THRESHOLDS = (0.9, 0.95, 0.97, 0.98, 0.985, 0.99, 0.995, 0.998)
"""Of acceptance, that are compared."""
_FEWEST = 30
"""Readings of a group below which it has no row of its own."""


@dataclass(frozen=True)
class KnownReading:
    """A reading of a part whose text is known.

    Attributes:
        source: of `SOURCES`.
        belief: in the text.
        right: whether it is.
        soil: of the part.
        font: of the mark.
        severity: of the dirt.
        kept_out: nothing may be fitted to it.
        measures: of its part that a ground has, by name.
        named: whether the reader was told the font.
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
    named: bool
    accepted: bool


def known_readings(folder: Path) -> Iterator[KnownReading]:
    """What the finished benchmark of a design holds; where no text was read the belief is 0.

    Raises:
        FileError: the folder holds no benchmark.
    """
    journal = TrialJournal.read(folder)
    design: Mapping[str, Any] = journal.description["parts"]
    # benchmarks from before there were any told the belief itself
    used = journal.description.get("calibrations", {})
    worth = {source: Calibration(**used.get(source, used.get(source.split()[0], {}))) for source in SOURCES}
    soils = frozenset(design.get("kept_out_soils", ()))
    sections = tuple(f"{s['name']}-" for s in design.get("section", ()) if s["kept_out"])
    for trials in journal.done.values():
        for trial in trials:
            if trial.mode in SOURCES and not trial.error and not trial.perturbed:
                soil = str(trial.levels.get("soil", ""))
                measures = {
                    one.name: trial.measures[one.value] for one in GROUND if one.value in trial.measures
                }
                # what was shrunk is undone
                widths = worth[trial.mode].off(measures)
                belief = worth[trial.mode].belief(shrunk(trial.confidence, 1.0 / (1.0 + widths) - 1.0))
                yield KnownReading(
                    source=trial.mode,
                    belief=belief,
                    right=trial.right,
                    soil=soil,
                    font=trial.font,
                    severity=trial.severity or 0.0,
                    kept_out=trial.part.startswith(sections) or bool(soils & {*soil.split("+")}),
                    measures=measures,
                    named=bool(trial.levels.get("font_given")),
                    accepted=trial.decision == Decision.ACCEPT.value,
                )


def _sizes(folders: Sequence[Path]) -> dict[str, int]:
    """How many parts of each design were read, by its name."""
    parts: dict[str, set[str]] = {}
    for folder in folders:
        journal = TrialJournal.read(folder)
        parts.setdefault(str(journal.description["parts"].get("name", "")), set()).update(journal.done)
    return {name: len(found) for name, found in parts.items()}


@dataclass(frozen=True)
class LeftOut:
    """Readings that no fit has seen, and what every way of `WAYS` makes of them.

    Attributes:
        name: what was left out.
        right: (n,) whether they are.
        severity: (n,) of their dirt.
        by_way: (n,) confidences.
        off: (n,) widths off the ground, by which the confidences that serve have shrunk.
    """

    name: str
    right: Bools
    severity: Floats
    by_way: Mapping[str, Floats]
    off: Floats

    def row(self, threshold: float) -> str:
        """A line of the table."""
        before, after = (self.by_way[way] for way in ("as believed", SERVES))
        wrong = [
            bounded(int((accepted & ~self.right).sum()), int(accepted.sum()))
            for accepted in (before >= threshold, after >= threshold)
        ]
        cells = [
            f"{self.name} | {self.right.size:,} | {self.right.mean():.1%}",
            f"{_ece(before, self.right):.3f} → {_ece(after, self.right):.3f}",
            f"{loss(before, self.right):.3f} → {loss(after, self.right):.3f}",
            " → ".join(f"{one.count} of {one.total:,}" for one in wrong),
            f"{wrong[1].high:.2%}",
            f"{(self.off > 0.0).mean():.1%}",
        ]
        return f"| {' | '.join(cells)} |"


def left_out(readings: Sequence[KnownReading], factor: str) -> Iterator[LeftOut]:
    """Of every level of a factor ("soil" or "font") its readings, judged by fits without them.

    Args:
        readings: of one source.
        factor: which.
    """
    for level in sorted({getattr(one, factor) for one in readings}):
        own = [one for one in readings if getattr(one, factor) == level]
        others = [one for one in readings if getattr(one, factor) != level and not one.kept_out]
        if len(own) >= _FEWEST:
            yield _judged(level, own, others)


def _judged(name: str, own: Sequence[KnownReading], others: Sequence[KnownReading]) -> LeftOut:
    known, right = _columns(others)
    beliefs, own_right = _columns(own)
    severity = np.array([one.severity for one in own])
    ground = Calibration(ground=_ground(others))
    off = np.array([ground.off(one.measures) for one in own])
    by_way = {way: judge(known, right, beliefs) for way, judge in WAYS.items()}
    served = [shrunk(said, widths) for said, widths in zip(by_way[SERVES], off, strict=True)]
    return LeftOut(name, own_right, severity, {**by_way, SERVES: np.array(served)}, off)


def _together(name: str, parts: Collection[LeftOut]) -> Iterator[LeftOut]:
    """All of them in one, each by the fit without it; nothing of fewer than two."""
    if len(parts) > 1:
        right, severity, off = (
            np.concatenate([getattr(one, name) for one in parts]) for name in ("right", "severity", "off")
        )
        by_way = {way: np.concatenate([one.by_way[way] for one in parts]) for way in WAYS}
        yield LeftOut(name, right, severity, by_way, off)


def _columns(readings: Sequence[KnownReading]) -> tuple[Floats, Bools]:
    return np.array([one.belief for one in readings]), np.array([one.right for one in readings], dtype=bool)


def _ground(readings: Sequence[KnownReading]) -> dict[str, tuple[float, float]]:
    return fit_ground([one.measures for one in readings], worse_below=[one.name for one in WORSE_BELOW])


def _ece(said: Floats, right: Bools) -> float:
    return reliability(said.tolist(), right.tolist()).error


def tables(source: str, readings: Sequence[KnownReading], *, threshold: float) -> Iterator[str]:
    """Lines of Markdown: what became of the readings of one source that were left out."""
    by_soil, by_font = (list(left_out(readings, factor)) for factor in ("soil", "font"))
    yield from (f"### {source}", "")
    yield f"| left out | readings | right | ECE | log loss | wrong of accepted from {threshold:g} | at most | off |"
    yield "|" + "---|" * 8
    for one in (
        *by_soil,
        *_together("every soil in turn", by_soil),
        *_together("every font in turn", by_font),
    ):
        yield one.row(threshold)
    yield from (
        "",
        "| way | mean ECE over soils left out | mean log loss | worst log loss |",
        "|---|---|---|---|",
    )
    for way in WAYS:
        errors = [_ece(one.by_way[way], one.right) for one in by_soil]
        losses = [loss(one.by_way[way], one.right) for one in by_soil]
        yield f"| {way} | {np.mean(errors):.3f} | {np.mean(losses):.4f} | {max(losses):.4f} |"
    yield ""
    if len(by_soil) > 1:
        yield from _by_threshold(by_soil)


def _by_threshold(parts: Sequence[LeftOut]) -> Iterator[str]:
    """Lines of Markdown: what would be accepted from which confidence, every soil by the fit without it."""
    (joined,) = _together("", parts)
    dirt = joined.severity
    levels = sorted({float(one) for one in dirt})
    yield f"| accepted from | wrong | accepted | {' | '.join(f'dirt {level:g}' for level in levels)} |"
    yield "|" + "---|" * (3 + len(levels))
    for threshold in THRESHOLDS:
        accepted = joined.by_way[SERVES] >= threshold
        wrong = bounded(int((accepted & ~joined.right).sum()), int(accepted.sum()))
        cells = [f"{wrong.count} of {wrong.total:,}, at most {wrong.high:.2%}", f"{accepted.mean():.1%}"]
        cells += [f"{accepted[dirt == level].mean():.1%}" for level in levels]
        yield f"| {threshold:g} | {' | '.join(cells)} |"
    yield ""


def _decisions(readings: Sequence[KnownReading]) -> Iterator[str]:
    """Lines of Markdown: what the benchmark's reader accepted, by soil, and by what it was told and dirt."""
    levels = sorted({one.severity for one in readings})
    yield f"| accepted by every rule | wrong | accepted | {' | '.join(f'dirt {level:g}' for level in levels)} |"
    yield "|" + "---|" * (3 + len(levels))
    groups = {
        **{
            soil: [one for one in readings if one.soil == soil] for soil in sorted({r.soil for r in readings})
        },
        "font not named": [one for one in readings if not one.named],
        "font named": [one for one in readings if one.named],
        "all": readings,
    }
    for name, group in groups.items():
        if group:
            accepted = [one for one in group if one.accepted]
            wrong = bounded(sum(not one.right for one in accepted), len(accepted))
            cells = [f"{wrong.count} of {wrong.total:,}, at most {wrong.high:.2%}"]
            cells += [f"{len(accepted) / len(group):.1%}"]
            for level in levels:
                own = [one.accepted for one in group if one.severity == level]
                cells.append(f"{sum(own) / len(own):.1%} of {len(own)}" if own else "")
            yield f"| {name} | {' | '.join(cells)} |"
    yield ""


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit, print the tables, and with --write keep the fit; sources that were not read keep theirs."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("benchmarks", type=Path, nargs="+", help="folders of benchmarks of the exam (--out)")
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
        made = fit_calibration(*_columns(known))
        made = Calibration(round(made.slope, 3), round(made.bias, 3), _ground(known))
        fitted[source], counts[source] = asdict(made), len(known)
        print("\n".join(tables(source, own, threshold=given.threshold)))
        print("\n".join(_decisions(tried)))
        print(f"fitted on {len(known):,} readings: {made}\n")
    if given.write:
        known = [one for one in readings if not one.kept_out and one.belief > 0.0]
        manifest = {
            "what": "confidences of beliefs (recognition/belief/calibration.py)",
            "command": "python -m pipeline.benchmark.fit_confidence BENCHMARK ... --write",
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
