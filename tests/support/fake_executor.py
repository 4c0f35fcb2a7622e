"""An executor that reads nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from pipeline.workers.executors import Executor, Outcome


class FakeExecutor(Executor):
    """Has an answer to every part, and breaks off after some.

    Attributes:
        read: names of the parts that were asked for.
    """

    def __init__(
        self,
        answer: Callable[[PartFiles, PartJob], ReadPart | Exception],
        *,
        breaks_after: int = 99,
        backwards: bool = False,
    ) -> None:
        self.answer, self.breaks_after, self.backwards = answer, breaks_after, backwards
        self.read = list[str]()

    def calls(
        self, function: Callable[[Any, Any], Any], job: PartJob, tasks: Iterable[PartFiles]
    ) -> Iterator[Outcome[Any, Any]]:
        for part in reversed(list(tasks)) if self.backwards else tasks:
            if len(self.read) == self.breaks_after:
                raise KeyboardInterrupt
            self.read.append(part.name)
            answer = self.answer(part, job)
            failed = isinstance(answer, Exception)
            yield Outcome(part, error=answer) if failed else Outcome(part, answer)
