"""Second pass over a lot: enrol characters read with certainty, and read the other parts again with their shapes."""

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
from pipeline.formats.part_files import PartFiles, split_name
from pipeline.reading.part_job import PartJob, files_to_send
from pipeline.runs.lot import FEWEST_PARTS, LEAST_AGREEMENT, needs_another, teachers
from pipeline.runs.options import RunOptions
from pipeline.workers.executors import Executor, ordered_map

if TYPE_CHECKING:
    from pipeline.reading.enrolment import EnrolReport
    from pipeline.runs.outputs import RunJournal


def runs_second_pass(options: RunOptions, settings: ReadSettings, parts: Sequence[PartFiles]) -> bool:
    """Whether to run a second pass (default: if the lot is large enough). Raises SettingsError: it is not possible."""
    why_not = _why_not(options, settings)
    if options.learn_die and why_not is not None:
        raise SettingsError(f"--learn-die {why_not[0]}", hint=why_not[1])
    if options.learn_die is not None:
        return options.learn_die
    return why_not is None and sum(map(_learns_or_teaches, parts)) >= FEWEST_PARTS


def _why_not(options: RunOptions, settings: ReadSettings) -> tuple[str, str] | None:
    if settings.font or settings.database is not None:
        return "is for a die whose font is unknown", "leave out --font and --database"
    if settings.certificate is not None:
        return "changes how parts are read, so a certificate does not hold", "leave out --certificate"
    if settings.mode == "vision":
        return "learns by touch", "leave out --mode vision"
    if settings.experts and "templates" not in settings.experts:
        return "needs the expert `templates`", "add it to --experts"
    if options.store is not None:
        hint = "use --out with a table, or learn from the store's reviewed parts: enroll --from-store"
        return "works only when a table is written", hint
    return None


@dataclass
class SecondPass:
    """Learn the shapes of a lot's own die, and use them to read the parts again that were not accepted."""

    database: Path
    always: bool = False  # even if no part needs another reading
    learned: EnrolReport | None = field(default=None, init=False)
    again: int = field(default=0, init=False)  # parts read again since the run was opened

    def learned_job(
        self,
        journal: RunJournal,
        parts: Sequence[PartFiles],
        job: PartJob,
        executor: Executor,
        say: Callable[[str], None],
    ) -> tuple[Sequence[PartFiles], PartJob]:
        from recognition.decide.evidence import EVEN  # slow to import

        firsts = [first for first, again in journal.outlines() if again is None and needs_another(first)]
        # the better of two readings counts, so the second must be surer if it has another text
        texts_before = {first.part: first.text if first.confidence > EVEN else "" for first in firsts}
        waiting = [
            replace(part, other_text=texts_before[part.name])
            for part in parts
            if part.name in texts_before and _learns_or_teaches(part)
        ]
        if not (waiting or self.always):
            return (), job
        from pipeline.reading.enrolment import enrol

        name = _font_name(parts)
        able = {p.name: p for p in parts if _learns_or_teaches(p) and not is_url(p.scan or p.height_map)}
        texts = teachers(first for first, _ in journal.outlines() if first.part in able)
        reviewed = [replace(able[part], expected=text) for part, text in texts.items()]
        try:
            report = enrol(
                reviewed,
                self.database,
                font=name,
                settings=job.settings,
                vouching=False,
                each=partial(ordered_map, executor),
            )
            if not report.exemplars:
                raise MarksError("too few of its parts were read with certainty")
            if report.agreement < LEAST_AGREEMENT:
                agree = f"only {report.agreement:.0%} of their characters agree"
                raise MarksError(f"its parts do not look like one die's ({agree})")
        except MarksError as error:
            self.database.unlink(missing_ok=True)
            say(f"nothing was learned from the lot: {error}")
            return (), job
        self.learned = report
        say(
            f"learned {name} from {len(report.enrolled) + len(report.known)} parts that were read with certainty:"
            f" {report.exemplars} exemplars of the characters {report.felt}"
        )
        settings = job.settings.model_copy(update={"database": self.database, "font": (name,)})
        sent = None if job.sent is None else files_to_send(settings)
        return waiting, replace(job, settings=settings, sent=sent)


def _learns_or_teaches(part: PartFiles) -> bool:
    return bool(part.height_map or part.scan) and not part.font and part.problem is None


def _font_name(parts: Sequence[PartFiles]) -> str:
    first = min(parts, key=lambda part: part.name)
    file = first.scan or first.height_map or first.photo
    folder = split_name(file if is_url(file) else os.path.abspath(file))[0]
    return f"{split_name(folder)[1] or 'lot'}-die"
