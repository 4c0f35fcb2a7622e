"""The comparison of plans of touch, part by part, in a journal that a broken-off run is taken up from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.benchmark.exam.specimens import Item, Parts
from pipeline.benchmark.stage_time.trial import TouchPlan, TouchTrial, failed, tried_on
from pipeline.common.version import program_mark
from pipeline.runs.line_journal import LineJournal
from pipeline.workers.executors import Executor

JOURNAL_FILE = "active.jsonl"


@dataclass(frozen=True)
class Comparison:
    """What is compared.

    Attributes:
        parts: on which parts.
        seed: of the sensors and of plans that are drawn.
        budget_s: most stage seconds of a part that is felt by choice.
        plans: which.
    """

    parts: Parts
    seed: int
    budget_s: float
    plans: tuple[TouchPlan, ...]

    def description(self) -> dict[str, Any]:
        """All that the trials depend on, in plain JSON values; not how many parts there are."""
        return {
            "parts": self.parts.description(),
            "seed": self.seed,
            "budget_s": self.budget_s,
            "plans": [asdict(plan) for plan in self.plans],
            "program": program_mark(),
        }


class TouchJournal(LineJournal[tuple[TouchTrial, ...]]):
    """The trials of one comparison: those of a part by its name."""

    kind, version = "comparison of plans", 1

    @classmethod
    def at(cls, place: Path) -> Path:
        """In the comparison's folder."""
        return place / JOURNAL_FILE

    def encoded(self, kept: tuple[TouchTrial, ...]) -> dict[str, Any]:
        """See `LineJournal`."""
        return {"trials": [asdict(trial) for trial in kept]}

    def decoded(self, line: Mapping[str, Any]) -> tuple[TouchTrial, ...]:
        """See `LineJournal`."""
        return tuple(TouchTrial(**values) for values in line["trials"])


def compare(
    comparison: Comparison,
    folder: Path,
    *,
    executor: Executor,
    on_start: Callable[[int, int], None],
    on_part: Callable[[Sequence[TouchTrial]], None],
) -> list[TouchTrial]:
    """Try every part that the folder does not hold yet.

    Args:
        comparison: what to try.
        folder: where the trials are kept; made if need be.
        executor: who works.
        on_start: told how many parts there are and how many of these are done already.
        on_part: told of every part as it is done.

    Returns:
        The trials in the order of the parts, then of what was given, and of the plans.

    Raises:
        FileError: the folder holds another comparison or cannot be written.
    """
    items = comparison.parts.items()
    book = TouchJournal.open(folder, comparison.description())
    missing = [item for item in items if item.part not in book.done]
    on_start(len(items), len(items) - len(missing))
    for outcome in executor.calls(_try_part, comparison, missing):
        trials = outcome.result
        if trials is None:
            assert outcome.error is not None
            trials = failed(outcome.task, comparison.plans, outcome.error)
        book.add(outcome.task.part, trials)
        on_part(trials)
    return [trial for item in items for trial in book.done[item.part]]


def _try_part(comparison: Comparison, item: Item) -> tuple[TouchTrial, ...]:
    return tried_on(
        comparison.parts, item, plans=comparison.plans, seed=comparison.seed, budget_s=comparison.budget_s
    )
