"""`tactile-marks study`: how well readings repeat, agree and gauge depth."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import FAILED, INTERRUPTED, USAGE, CommandError, failures_reported
from pipeline.cli.settings import READING, Config, Reading

if TYPE_CHECKING:
    from pipeline.benchmark.study.repeats import Measured, StudiedPart, StudyJournal, StudyPlan
    from pipeline.benchmark.study.study import Study
    from pipeline.formats.part_files import PartFiles

_MOST_NAMED = 5


def study(
    *inputs: str,
    repeats: int = 3,
    arrays: int = 2,
    reviewers: Path | None = None,
    truth: Path | None = None,
    out: Path = Path("study"),
    jobs: int | None = None,
    reading: Reading = READING,
    config: Config = None,
) -> int:
    """Read every part several times, and report how far readings agree and how well depth is gauged.

    Height maps are scanned anew for every trial; files NAME.1, NAME.2 ... are trials of one part; of a single scan or
    photograph every trial is perturbed. Writes study.html, readings.csv, agreement.csv and depth.csv. The exit status
    is 1 if any trial has no reading. What was broken off, the same command goes on with.

    Parameters
    ----------
    inputs
        Height maps, scans and photographs, folders, globs and manifests of them, as for read.
    repeats
        Trials of every part.
    arrays
        Virtual arrays that each measure every height map, to show what another array changes; recordings and
        photographs have one.
    reviewers
        CSV with the columns part, reviewer and text: what people read; several lines of one reviewer and part are
        trials.
    truth
        CSV with the columns part and text; of parts in a manifest the text expected unless given.
    out
        Folder for the page and the tables.
    jobs
        Worker processes; one for each core unless given, or none for a few parts.
    """
    with failures_reported():
        if not inputs:
            raise CommandError("study: name parts, folders, globs or manifests", status=USAGE)
        if repeats < 1 or arrays < 1 or (jobs is not None and jobs < 1):
            raise CommandError("study: --repeats, --arrays and --jobs are at least 1", status=USAGE)
        from pipeline.benchmark.report.writing import command_line
        from pipeline.benchmark.study.repeats import StudyJournal, StudyPlan, studied_parts
        from pipeline.benchmark.study.report import write_study
        from pipeline.benchmark.study.reviews import Reviews, load_reviews
        from pipeline.benchmark.study.study import study_of
        from pipeline.common.version import program_mark
        from pipeline.formats.find_parts import list_parts
        from pipeline.reading.kept_readers import reader_of

        reader_of(reading)  # settings that cannot be, before anything is read
        listed = list_parts(inputs, photos=reading.mode == "vision", height_images=reading.height_image)
        parts = studied_parts(listed)
        names = {part.name for part in parts}
        reviews = load_reviews(reviewers, names) if reviewers else Reviews({}, ())
        true = _truth(truth, listed, names)
        felt = reading.mode != "vision" and all(part.simulated for part in parts)
        plan = StudyPlan(reading, repeats, arrays if felt else 1)
        notes = _notes(plan, arrays, reviews.unknown)
        description = {
            "settings": reading.model_dump(mode="json", exclude_defaults=True),
            "inputs": list(inputs),
            "repeats": plan.repeats,
            "arrays": plan.arrays,
            "program": program_mark(),
        }
        with StudyJournal.open(out, description) as journal:
            measured = _measure(plan, parts, jobs, journal)
            found = study_of(measured, reviews.answers, true)
            written = write_study(found, out, notes=notes, command=command_line())
            journal.remove()
    _print(found, notes)
    for path in written:
        print(f"wrote {path}")
    errors = {m.part: m.error for m in measured if m.error}
    for part, error in list(errors.items())[:_MOST_NAMED]:
        print(f"{part}: {error}", file=sys.stderr)
    if errors:
        print(f"{len(errors)} parts could not be read each time; they are in readings.csv", file=sys.stderr)
    return FAILED if errors else 0


def _truth(table: Path | None, listed: Sequence[PartFiles], names: set[str]) -> dict[str, str]:
    from pipeline.formats.truth import PartTexts, load_truth

    expected = {part.name: part.expected for part in listed if part.expected}
    texts = PartTexts(expected) if table is None else load_truth(table)
    known = {name: text for name in names if (text := texts.text_of(name)) is not None}
    if table is not None and not known:
        raise CommandError(
            f"{table}: tells the truth of none of the parts", hint="name the parts as their files"
        )
    return known


def _notes(plan: StudyPlan, arrays: int, unknown: Sequence[str]) -> list[str]:
    notes = []
    if plan.arrays < arrays:
        notes.append("Recordings and photographs have one array: what another changes is not in this study.")
    if unknown:
        more = ", ..." if len(unknown) > _MOST_NAMED else ""
        notes.append(
            f"Reviewers read {len(unknown)} parts that are not in this study: "
            f"{', '.join(unknown[:_MOST_NAMED])}{more}."
        )
    return notes


def _measure(
    plan: StudyPlan, parts: Sequence[StudiedPart], jobs: int | None, journal: StudyJournal
) -> list[Measured]:
    from pipeline.benchmark.study.repeats import measure
    from pipeline.runs.progress import Progress
    from pipeline.workers.executors import WorkerLostError
    from pipeline.workers.options import ExecutorOptions

    if journal.names:
        print(f"continuing a broken-off study: {len(journal.names):,} parts are measured already")
    with Progress() as progress:
        progress.start(len(parts) - len(journal.names))
        try:
            with ExecutorOptions(jobs).opened(len(parts)) as executor:
                return measure(plan, parts, executor, journal, progress.advance)
        except KeyboardInterrupt as error:
            raise CommandError(
                "interrupted", hint="start the same command again to go on", status=INTERRUPTED
            ) from error
        except WorkerLostError as error:
            raise CommandError(str(error)) from error


def _print(found: Study, notes: Sequence[str]) -> None:
    from pipeline.cli.benchmarking.result import plain_table, screen

    for note in notes:
        print(note)
    table = plain_table(("what", "comparison", "who", "agree", "parts", "share", "95 %", "kappa"),
                        ("what", "comparison", "who"))  # fmt: skip
    for what, each in (("serial", found.serials), ("decision", found.decisions)):
        for a in each:
            low, high = 100 * a.parts.low, 100 * a.parts.high
            table.add_row(
                what, a.kind.value, a.who, str(a.parts.count), str(a.parts.total), f"{a.parts.value:.1%}",
                f"{low:.1f} to {high:.1f}", "-" if a.kappa is None else f"{a.kappa.value:.3f}",
            )  # fmt: skip
    screen().print(table)
    gauge = found.depth
    if gauge is None:
        print(f"depth: no gauge study, {found.no_depth}")
        return
    between = gauge.reproducibility_mm
    print(
        f"depth, {gauge.verdict}: gauge {gauge.share:.1%} of the variation, "
        f"{gauge.categories if gauge.categories is not None else 'any number of'} categories; "
        f"repeatability {1000 * gauge.repeatability_mm:.2f} µm, "
        + ("" if between is None else f"reproducibility {1000 * between:.2f} µm, ")
        + f"parts {1000 * gauge.part_mm:.2f} µm ({gauge.parts} parts)"
    )
    part, spread_mm = found.widest_depth
    print(f"depth varies most on {part}: {1000 * spread_mm:.1f} µm from the least to the most")
