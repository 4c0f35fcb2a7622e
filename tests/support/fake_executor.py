"""An executor that reads nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from pipeline.formats.part_files import PartFiles
from pipeline.reading.triage import ReadPart
from pipeline.runs.task import RunOrder
from pipeline.workers.executors import Executor, Outcome


class FakeExecutor(Executor):
    """Has an answer to every part, and breaks off after some.

    Attributes:
        read: names of the parts that were asked for.
    """

    def __init__(
        self,
        answer: Callable[[PartFiles, RunOrder], ReadPart | Exception],
        *,
        breaks_after: int = 99,
        backwards: bool = False,
    ) -> None:
        self.answer, self.breaks_after, self.backwards = answer, breaks_after, backwards
        self.read = list[str]()

    def calls(
        self, function: Callable[[Any, Any], Any], order: RunOrder, tasks: Iterable[PartFiles]
    ) -> Iterator[Outcome[Any, Any]]:
        for part in reversed(list(tasks)) if self.backwards else tasks:
            if len(self.read) == self.breaks_after:
                raise KeyboardInterrupt
            self.read.append(part.name)
            answer = self.answer(part, order)
            failed = isinstance(answer, Exception)
            yield Outcome(part, error=answer) if failed else Outcome(part, answer)
