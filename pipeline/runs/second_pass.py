"""A lot teaches itself: characters that were read surely are enrolled, and the rest is read again with their shapes.

first rows --teachers--> enrol --> glyph database --> parts that were not accepted, read with it --> second readings
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import MarksError
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.errors import is_url
from pipeline.formats.names import split_name
from pipeline.formats.part_files import PartFiles
from pipeline.runs.options import RunOptions
from pipeline.runs.task import RunOrder, read_listed
from pipeline.workers.executors import Executor, ordered_map

if TYPE_CHECKING:
    from pipeline.common.reading_records import ReadingRecord
    from pipeline.reading.enrolment import EnrolReport
    from pipeline.runs.run_journal import RunJournal


def learns(options: RunOptions, settings: ReadSettings, parts: Sequence[PartFiles]) -> bool:
    """Whether a lot is to teach itself: as it is asked for, or where it may and is large enough.

    Raises:
        SettingsError: it is asked for, and cannot.
    """
    from recognition.learning.lot import FEWEST_PARTS

    why_not = _why_not(options, settings)
    if options.learn_die and why_not is not None:
        raise SettingsError(f"--learn-die {why_not[0]}", hint=why_not[1])
    if options.learn_die is not None:
        return options.learn_die
    return why_not is None and sum(map(_learns_or_teaches, parts)) >= FEWEST_PARTS


def _why_not(options: RunOptions, settings: ReadSettings) -> tuple[str, str] | None:
    """Why a lot cannot teach itself, and what to do about it."""
    if settings.font or settings.database is not None:
        return "is for a die whose font nobody knows", "leave --font and --database away"
    if settings.certificate is not None:
        return "changes how parts are read", "leave --certificate away"
    if settings.mode == "vision":
        return "learns by touch", "leave --mode vision away"
    if settings.experts and "templates" not in settings.experts:
        return "asks the expert templates, which has no say", "add it to --experts"
    if options.store is not None:
        return (
            "goes with a table",
            "write a table, or learn from the store's reviewed parts: enroll --from-store",
        )
    return None


@dataclass
class SecondPass:
    """Teaches a lot the shapes of its own die, and has the parts that were not accepted read again.

    Attributes:
        database: glyph database to be made.
        always: whether it is made even if nothing is to be read again.
        sent: whether the workers are on machines of their own, which lack the database.
        say: told in words what is learned, and why nothing is.
        checked: makes of a second reading what the lot's order leaves of it.
        on_again: told how many parts are read again, before they are.
        on_row: told of every one that is.
        learned: what was; None before, and where nothing could be.
        again: parts read again in this sitting.
    """

    database: Path
    always: bool = False
    sent: bool = False
    say: Callable[[str], None] = print
    checked: Callable[[ReadingRecord], ReadingRecord] | None = None
    on_again: Callable[[int], None] | None = None
    on_row: Callable[[ReadingRecord], None] | None = None
    learned: EnrolReport | None = field(default=None, init=False)
    again: int = field(default=0, init=False)

    def work(self, book: RunJournal, parts: Sequence[PartFiles], order: RunOrder, executor: Executor) -> None:
        """Learn from the rows of the first pass, and keep the second readings in the book.

        Parts whose second reading the book holds are not read again.

        Raises:
            FileError: the table cannot be written.
            ClusterError: the cluster is lost.
        """
        from recognition.learning.lot import needs_another

        entries = book.journal.entries()
        unsure = {first.part for first, again in entries if again is None and needs_another(first)}
        waiting = [p for p in parts if p.name in unsure and _learns_or_teaches(p)]
        if not (waiting or self.always):
            return
        name = _font_name(parts)
        self.learned = self._taught(book, parts, order.settings, name, executor)
        if self.learned is None or not waiting:
            return
        if self.on_again is not None:
            self.on_again(len(waiting))
        for outcome in executor.calls(read_listed, self._order(order, name), iter(waiting)):
            self.again += 1
            if outcome.result is None:
                continue  # its first reading stays; taken up again, the run tries it once more
            record = outcome.result.record
            if self.checked is not None:
                record = self.checked(record)
            book.journal.add_second(record)
            if self.on_row is not None:
                self.on_row(record)

    def _taught(
        self,
        book: RunJournal,
        parts: Sequence[PartFiles],
        settings: ReadSettings,
        name: str,
        executor: Executor,
    ) -> EnrolReport | None:
        """Make the database; None where the lot has nothing to teach."""
        from pipeline.reading.enrolment import ReviewedPart, enrol
        from recognition.learning.lot import LEAST_AGREEMENT, teachers

        able = {part.name: part for part in parts if _learns_or_teaches(part) and _is_here(part)}
        texts = teachers(first for first, _ in book.journal.entries() if first.part in able)
        reviewed = [
            ReviewedPart(part, text, _path(able[part].scan), _path(able[part].height_map))
            for part, text in texts.items()
        ]
        try:
            report = enrol(
                reviewed,
                self.database,
                font=name,
                settings=settings,
                vouching=False,
                each=partial(ordered_map, executor),
            )
        except MarksError as error:
            self.say(f"the lot teaches nothing: {error}")
            return None
        if not report.exemplars or report.agreement < LEAST_AGREEMENT:
            self.database.unlink(missing_ok=True)
            self.say(
                "the lot teaches nothing: "
                + (
                    f"its parts do not look like one die's (only {report.agreement:.0%} of their characters agree)"
                    if report.exemplars
                    else "too few of its parts were read surely"
                )
            )
            return None
        self.say(
            f"learned {name} from {len(report.enrolled) + len(report.known)} parts that were read surely:"
            f" {report.exemplars} exemplars of {report.felt}"
        )
        return report

    def _order(self, order: RunOrder, name: str) -> RunOrder:
        """As the first pass, with what was learned."""
        from pipeline.runs.setting_files import files_to_send

        settings = order.settings.model_copy(update={"database": self.database, "font": (name,)})
        return replace(order, settings=settings, sent=files_to_send(settings) if self.sent else {})


def _learns_or_teaches(part: PartFiles) -> bool:
    """Whether a part is felt, and of the die that nobody named."""
    return bool(part.height_map or part.scan) and not part.font and part.problem is None


def _is_here(part: PartFiles) -> bool:
    return not is_url(part.scan or part.height_map)


def _path(name: str | Path) -> Path | None:
    return Path(name) if name else None


def _font_name(parts: Sequence[PartFiles]) -> str:
    """What the lot's die is called: after the folder that the first of its parts lies in."""
    first = min(parts, key=lambda part: part.name)
    file = first.scan or first.height_map or first.photo
    folder = split_name(file if is_url(file) else os.path.abspath(file))[0]
    return f"{split_name(folder)[1] or 'lot'}-die"
