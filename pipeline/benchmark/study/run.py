"""Run a study from its inputs to its report; the same call resumes an interrupted one. Readings by people come in a
table:

part,reviewer,text
part-1,Ada,KX407251
part-1,Ada,KX407251         Ada's second trial; trials are in the order of their lines
part-1,Ben,KX407Z51         an empty text means unreadable
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from glyphs.errors import FileError
from pipeline.benchmark.study.repeats import RECORDED, StudyJournal, StudyPlan, measure, studied_parts
from pipeline.benchmark.study.report import write_study
from pipeline.benchmark.study.study import Study
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.job_file import files_of
from pipeline.common.texts import first_of, without_blanks
from pipeline.common.version import program_mark
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import PartTexts, load_part_lines, load_truth
from pipeline.reading.readers import reader_of
from pipeline.runs.production import parts_for
from pipeline.runs.progress import Progress
from pipeline.workers.options import WorkerSettings

_HEADINGS = ("reviewer", "appraiser", "who")


def run_study(
    plan: StudyPlan,
    inputs: Sequence[str],
    out: Path,
    workers: WorkerSettings,
    *,
    reviewers: Path | None = None,
    truth: Path | None = None,
) -> tuple[Study, str, tuple[Path, ...]]:
    """Measure every part of folders, globs and manifests several times, and write the report.

    `reviewers` is a table of the texts that people read, `truth` of the stamped ones (default: those that a manifest
    expects). Returns the study, its tables in Markdown, and the files written. Raises MarksError.
    """
    settings = plan.settings
    reader_of(settings)  # reject invalid settings before anything is read
    listed = parts_for(inputs, settings)
    listed.report_passed_over([*files_of(settings), *filter(None, (truth, reviewers))])
    parts = studied_parts(listed)
    names = {part.name for part in parts}
    answers, unknown = load_reviews(reviewers, names) if reviewers else ([], ())
    true = _truth(truth, listed, names)
    notes = []
    if plan.arrays > 1 and (settings.mode == "vision" or not all(part.simulated for part in parts)):
        plan = replace(plan, arrays=1)
        notes.append(
            "Recordings and photographs have one array: this study does not show differences of arrays."
        )
    if unknown:
        notes.append(f"Reviewers read {len(unknown)} parts that are not in this study: {first_of(unknown)}.")
    description = {
        "settings": settings.model_dump(mode="json", exclude_defaults=True),
        "inputs": list(inputs),
        "repeats": plan.repeats,
        "arrays": plan.arrays,
        "program": program_mark(),
    }
    with StudyJournal(out, description) as journal, Progress() as progress:
        if journal.names:
            print(f"continuing an interrupted study: {len(journal.names):,} parts are measured already")
        progress.start(len(parts) - len(journal.names))
        with workers.opened(len(parts), limit_s=plan.settings.limit_s) as executor:
            measured = measure(plan, parts, executor, journal, progress.advance)
        study = Study(tuple(measured), tuple(answers), true, tuple(notes))
        document, written = write_study(study, out)
        journal.remove()
    return study, document, written


def _truth(table: Path | None, listed: Sequence[PartFiles], names: set[str]) -> dict[str, str]:
    expected = {part.name: part.expected for part in listed if part.expected}
    texts = PartTexts(expected) if table is None else load_truth(table)
    known = {name: without_blanks(text) for name in names if (text := texts.text_of(name)) is not None}
    if table is not None and not known:
        raise FileError(table, "has no row for these parts", "name the parts as their files")
    return known


def load_reviews(path: Path, parts: Collection[str]) -> tuple[list[Trial], tuple[str, ...]]:
    """Load reviewers' answers from a table, with the reviewer as mode; and the parts that are not in the study. Raises
    FileError: another table, no part of the study, or a reviewer who did not read every part equally often."""
    known = PartTexts(dict.fromkeys(parts, ""))
    answers: list[Trial] = []
    times: dict[str, Counter[str]] = {}
    unknown: dict[str, None] = {}
    for line in load_part_lines(path, repeated=True):
        who = next((line.others[name] for name in _HEADINGS if line.others.get(name)), "")
        if not who:
            raise FileError(path, f"line {line.line} names no reviewer", "fill the column reviewer")
        if (part := known.name_of(line.part)) is None:
            unknown[line.part] = None
            continue
        times.setdefault(who, Counter())[part] += 1
        number, text = times[who][part], without_blanks(line.text)
        answers.append(Trial(part, number, {RECORDED: True}, who, truth="", text=text))
    if not answers:
        raise FileError(
            path, "answers no part of the study", f"name the parts as {next(iter(parts), 'they are')}"
        )
    for who, counts in times.items():
        if len(set(counts.values())) > 1:
            most = max(counts.values())
            few = first_of([part for part, n in counts.items() if n < most])
            raise FileError(
                path, f"{who} read some parts {most} times and others less often: {few}",
                "give the same number of lines for each",
            )  # fmt: skip
    return answers, tuple(unknown)
