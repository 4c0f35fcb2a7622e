"""Run a study from its inputs to its report; the same call resumes an interrupted one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from glyphs.errors import FileError
from pipeline.benchmark.study.repeats import StudyJournal, StudyPlan, measure, studied_parts
from pipeline.benchmark.study.report import write_study
from pipeline.benchmark.study.reviews import Reviews, load_reviews
from pipeline.benchmark.study.study import Study, study_of
from pipeline.common.settings import ReadSettings
from pipeline.common.version import program_mark
from pipeline.formats.find_parts import discover
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import PartTexts, load_truth
from pipeline.reading.readers import reader_of
from pipeline.runs.progress import Progress
from pipeline.workers.options import ExecutorOptions

_MOST_NAMED = 5


def run_study(
    settings: ReadSettings,
    inputs: Sequence[str],
    out: Path,
    *,
    repeats: int,
    arrays: int,
    reviewers: Path | None = None,
    truth: Path | None = None,
    executors: ExecutorOptions | None = None,
    command: str = "",
) -> tuple[Study, tuple[Path, ...]]:
    """Measure every part several times, write the report, and return the study with the files written.

    Args:
        settings: read settings.
        inputs: parts, folders, globs and manifests.
        out: folder of the report; it also holds the journal of an interrupted study.
        repeats: number of trials of every part.
        arrays: number of virtual arrays; each measures every height map.
        reviewers: table of the texts that people read.
        truth: table of the stamped texts (default for parts in a manifest: the expected text).
        executors: options of the executors that run the work.
        command: command line that repeats the study.

    Raises:
        MarksError: unusable inputs or tables, or a folder that cannot be written.
    """
    reader_of(settings)  # reject invalid settings before anything is read
    listed = discover(inputs, photos=settings.mode == "vision", height_images=settings.height_image)
    parts = studied_parts(listed)
    names = {part.name for part in parts}
    reviews = load_reviews(reviewers, names) if reviewers else Reviews({}, ())
    true = _truth(truth, listed, names)
    simulated = settings.mode != "vision" and all(part.simulated for part in parts)
    plan = StudyPlan(settings, repeats, arrays if simulated else 1)
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
        with (executors or ExecutorOptions()).opened(len(parts)) as executor:
            measured = measure(plan, parts, executor, journal, progress.advance)
        notes = tuple(_notes(fewer_arrays=plan.arrays < arrays, unknown=reviews.unknown))
        found = study_of(measured, reviews.answers, true, notes=notes)
        written = write_study(found, out, command=command)
        journal.remove()
    return found, written


def _truth(table: Path | None, listed: Sequence[PartFiles], names: set[str]) -> dict[str, str]:
    expected = {part.name: part.expected for part in listed if part.expected}
    texts = PartTexts(expected) if table is None else load_truth(table)
    known = {name: text for name in names if (text := texts.text_of(name)) is not None}
    if table is not None and not known:
        raise FileError(table, "has no row for these parts", "name the parts as their files")
    return known


def _notes(*, fewer_arrays: bool, unknown: Sequence[str]) -> Iterator[str]:
    if fewer_arrays:
        yield "Recordings and photographs have one array: what another changes is not in this study."
    if unknown:
        named = ", ".join(unknown[:_MOST_NAMED]) + (", ..." if len(unknown) > _MOST_NAMED else "")
        yield f"Reviewers read {len(unknown)} parts that are not in this study: {named}."
