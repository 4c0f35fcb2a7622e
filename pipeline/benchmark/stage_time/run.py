"""The comparison of plans of touch, part by part, in a journal that a broken-off run is taken up from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from pipeline.benchmark.exam.specimens import Item, Parts
from pipeline.benchmark.stage_time.trial import TouchPlan, TouchTrial, failed, tried_on
from pipeline.common.version import program_mark
from pipeline.runs.journal import Journal, resumable
from pipeline.workers.executors import Executor


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


class TouchJournal(Journal[tuple[TouchTrial, ...]]):
    """The trials of one comparison: those of a part by its name."""

    kind: ClassVar[str] = "comparison of plans"
    version: ClassVar[int] = 2
    keeps: ClassVar[Any] = tuple[TouchTrial, ...]
    file: ClassVar[str] = "active.db"


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

    def lost(item: Item, error: Exception) -> tuple[TouchTrial, ...]:
        return failed(item, comparison.plans, error)

    with TouchJournal.open(folder, comparison.description()) as book:
        on_start(len(items), sum(item.part in book.names for item in items))
        for _, trials in resumable(book, items, executor, _try_part, comparison, lost=lost, name="part"):
            on_part(trials)
        done = book.done
    return [trial for item in items for trial in done[item.part]]


def _try_part(comparison: Comparison, item: Item) -> tuple[TouchTrial, ...]:
    return tried_on(
        comparison.parts, item, plans=comparison.plans, seed=comparison.seed, budget_s=comparison.budget_s
    )
