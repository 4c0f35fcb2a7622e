"""Run a study from its inputs to its report; the same call resumes an interrupted one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from glyphs.errors import FileError
from pipeline.benchmark.study.repeats import StudyJournal, StudyPlan, measure, studied_parts
from pipeline.benchmark.study.report import write_study
from pipeline.benchmark.study.reviews import load_reviews
from pipeline.benchmark.study.study import Study
from pipeline.common.texts import first_of, without_blanks
from pipeline.common.version import program_mark
from pipeline.formats.find_parts import discover
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import PartTexts, load_truth
from pipeline.reading.readers import reader_of
from pipeline.runs.progress import Progress
from pipeline.workers.options import WorkerSettings


def run_study(
    plan: StudyPlan,
    inputs: Sequence[str],
    out: Path,
    workers: WorkerSettings,
    *,
    reviewers: Path | None = None,
    truth: Path | None = None,
) -> tuple[Study, str, tuple[Path, ...]]:
    """Measure every part several times, and write the report.

    Args:
        plan: of the measurements; recordings and photographs have one array.
        inputs: parts, folders, globs and manifests.
        out: folder of the report; it also holds the journal of an interrupted study.
        workers: settings of the workers that read.
        reviewers: table of the texts that people read.
        truth: table of the stamped texts (default for parts in a manifest: the expected text).

    Returns:
        The study, its tables in Markdown, and the files written.

    Raises:
        MarksError: unusable inputs or tables, or a folder that cannot be written.
    """
    settings = plan.settings
    reader_of(settings)  # reject invalid settings before anything is read
    listed = discover(inputs, photos=settings.mode == "vision", height_images=settings.height_image)
    parts = studied_parts(listed)
    names = {part.name for part in parts}
    answers, unknown = load_reviews(reviewers, names) if reviewers else ([], ())
    true = _truth(truth, listed, names)
    notes = []
    if plan.arrays > 1 and (settings.mode == "vision" or not all(part.simulated for part in parts)):
        plan = replace(plan, arrays=1)
        notes.append("Recordings and photographs have one array: what another changes is not in this study.")
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
            print(f"continuing a broken-off study: {len(journal.names):,} parts are measured already")
        progress.start(len(parts) - len(journal.names))
        with workers.opened(len(parts)) as executor:
            measured = measure(plan, parts, executor, journal, progress.advance)
        found = Study(tuple(measured), tuple(answers), true, tuple(notes))
        document, written = write_study(found, out)
        journal.remove()
    return found, document, written


def _truth(table: Path | None, listed: Sequence[PartFiles], names: set[str]) -> dict[str, str]:
    expected = {part.name: part.expected for part in listed if part.expected}
    texts = PartTexts(expected) if table is None else load_truth(table)
    found = {name: texts.text_of(name) for name in names}
    known = {name: without_blanks(text) for name, text in found.items() if text is not None}
    if table is not None and not known:
        raise FileError(table, "has no row for these parts", "name the parts as their files")
    return known
