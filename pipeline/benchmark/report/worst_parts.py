"""Draw the worst parts of a benchmark, made again from their seed or files and scanned again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from matplotlib.figure import Figure

from pipeline.benchmark.analysis.groups import characters_right
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.readers.mode import PartReadings
from pipeline.benchmark.report.charts import data_uri
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark, reader_for
from pipeline.plots.pictures import reading_panels
from recognition.decide.picture import photo_panel

SHOWN = 12
_OWN_MODES = ("fused", "tactile", "vision")
_HELPED = ("fused", "tactile")


@dataclass(frozen=True)
class WorstPart:
    """One part to show, with the trials of all modes, and why."""

    trials: tuple[Trial, ...]
    why: str
    given: str  # facts of its worst reading
    picture: str = ""  # a data URI, or `problem` says why it could not be drawn
    problem: str = ""

    @property
    def part(self) -> str:
        return self.trials[0].part


def rank_worst(trials: Sequence[Trial], *, shown: int = SHOWN) -> list[WorstPart]:
    """Rank the parts: accepted with a wrong serial, then read worst by touch, by the camera, else least certain."""
    by_part: dict[str, list[Trial]] = {}
    for trial in trials:
        by_part.setdefault(trial.part, []).append(trial)
    worst_of = {
        part: min([t for t in members if t.mode in _OWN_MODES] or members, key=_badness)
        for part, members in by_part.items()
    }
    ranked = sorted(worst_of.values(), key=_badness)[:shown]
    return [WorstPart(tuple(by_part[worst.part]), _why(worst), worst.given) for worst in ranked]


def _badness(trial: Trial) -> tuple[bool, bool, float, float]:
    accepted_wrong = trial.accepted and not trial.right
    helped = trial.mode in _HELPED or trial.mode not in _OWN_MODES
    chars = characters_right(trial) / max(1, len(trial.truth))
    return (not accepted_wrong, not helped, chars, trial.confidence)


def _why(trial: Trial) -> str:
    if trial.accepted and not trial.right:
        return f"{trial.mode}: accepted but wrong"
    if trial.error:
        return f"{trial.mode}: an error"
    if not trial.right:
        wrong = len(trial.truth) - characters_right(trial)
        return f"{trial.mode}: {wrong} of {len(trial.truth)} characters wrong, {trial.decision}"
    sure = "right" if trial.accepted else "right, but uncertain"
    return f"{trial.mode}: {sure} ({trial.confidence:.3f}, {trial.decision})"


def draw_worst(benchmark: Benchmark, ranked: tuple[WorstPart, Item]) -> WorstPart:
    """Make the part again and draw it; a part that cannot be drawn has a reason instead."""
    worst, item = ranked
    try:
        specimen = benchmark.parts.make(item)
        if specimen.truth != worst.trials[0].truth:
            return replace(worst, problem=f"made again, it is another part, with {specimen.truth} stamped")
        senses = PartReadings(specimen, reader_for(benchmark.settings_for(item.condition, worst.given)))
        picture = data_uri(_figure(senses), kind="jpg")
    # the report of a long run must not fail because of one picture
    except Exception as error:
        return replace(worst, problem=f"{type(error).__name__}: {error}")
    return replace(worst, picture=picture)


def _figure(senses: PartReadings) -> Figure:
    photographed = senses.specimen.take_photo is not None
    figure = Figure(figsize=(10.5, 1.75) if photographed else (8.0, 2.0), layout="constrained")
    axes = list(figure.subplots(1, 3 if photographed else 2))
    if photographed:
        photo_panel(axes.pop(0), photo=senses.photo, reading=None)
    reading_panels(axes[-2], axes[-1], senses.touch)
    for each in figure.axes:
        each.set(xlabel="", ylabel="", xticks=[], yticks=[])
    return figure
