"""A command line's run, from its inputs to what is printed at its end."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.atomic import replacing
from glyphs.compiling import end_part, show_compiling
from glyphs.plain_text import visible
from pipeline.common.job_file import files_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.common.version import file_sha256, program_version
from pipeline.formats.find_parts import PassedOver
from pipeline.formats.order_file import read_order
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import Accuracy, load_truth
from pipeline.runs.lot_check import LotCheck
from pipeline.runs.options import RunOptions
from pipeline.runs.progress import Progress
from pipeline.runs.run import Run
from pipeline.runs.setup import absolute, opened, order_for, parts_for, with_expected
from pipeline.runs.workbook import check_number
from pipeline.workers.executors import Executor
from pipeline.workers.options import ExecutorOptions

if TYPE_CHECKING:
    from pipeline.formats.find_parts import Listing
    from pipeline.reading.certificate import Certificate

_READING = ("pipeline.runs.task", "pipeline.reading.kept_readers", "recognition.senses.touch")
"""Modules that a worker needs for its first part."""
MOST_SHOWN = 200
"""Parts whose rows are printed; of more the counts are, and the table has the rows."""


def run_batch(
    inputs: Sequence[str], settings: ReadSettings, options: RunOptions, executors: ExecutorOptions
) -> int:
    """Read parts, and print what came of it.

    Args:
        inputs: files, folders, globs, URLs and manifests.
        settings: of reading.
        options: what to check, and where the rows go.
        executors: who reads.

    Returns:
        0; 1 where a part could not be read, or is not confirmed to bear the text expected of it.

    Raises:
        FileError: a table, list or lexicon that cannot be used.
        NothingFoundError: no part.
        ClusterError: a cluster that cannot be used.
        ValueError: settings, a font, format or database that cannot be used.
    """
    options.check()
    found = parts_for(inputs, settings, manifests=options.manifest)
    if options.out is not None and options.store is None:
        check_number(Path(options.out), len(found))
    # workers load the libraries of reading while this process does
    with executors.opened(len(found), _READING) as executor:
        return _read(found, inputs, settings, options, executor, sent=executors.cluster is not None)


def _read(
    found: Listing,
    inputs: Sequence[str],
    settings: ReadSettings,
    options: RunOptions,
    executor: Executor,
    *,
    sent: bool,
) -> int:
    from pipeline.reading.certificate import certificate_of
    from pipeline.reading.drift import DriftWatch
    from pipeline.reading.expected import load_expected
    from pipeline.reading.readers import open_reader
    from pipeline.runs.read_table import print_table
    from pipeline.runs.second_pass import learns

    scores = Accuracy(load_truth(options.truth)) if options.truth is not None else None
    production = read_order(options.order) if options.order is not None else None
    reader, certificate = open_reader(settings), certificate_of(settings)
    expected = load_expected(options.verify, reader.grammar) if options.verify is not None else None
    parts: Sequence[PartFiles] = found if expected is None else with_expected(found, expected)
    if sent:
        parts = absolute(parts)
    order = order_for(settings, options, sent=sent, verify=expected is not None)
    learning = learns(options, settings, parts)
    description = _description(inputs, settings, options, learning, certificate)
    shown: dict[str, ReadingRecord] = {}
    with opened(options, description, learns=learning) as run, Progress() as progress:
        if run.book.resumed:
            print(f"continuing an interrupted run: {len(run.book.done):,} parts are read already")
        if run.book.kept is not None:
            print(f"{options.out} existed already; it is kept as {run.book.kept}")
        progress.start(len(parts), len(run.book.done))

        def on_row(record: ReadingRecord) -> None:
            end_part()
            progress.advance(failed=bool(record.error))

        def on_any_row(record: ReadingRecord) -> None:
            if len(parts) <= MOST_SHOWN:
                shown[record.part] = record
            if scores is not None:
                scores.add(record)

        run.on_row, run.on_any_row = on_row, on_any_row
        run.lot = LotCheck(production) if production is not None else None
        run.watch = None if certificate is None else DriftWatch(certificate)
        if run.second is not None:
            run.second.sent = sent
            run.second.say, run.second.on_again, run.second.on_row = progress.line, progress.more, on_row
        began = time.monotonic()
        with show_compiling(progress.line):
            run.work(parts, order, executor)
    elapsed_s = time.monotonic() - began
    if shown:
        print_table([shown[part.name] for part in parts])
    drift = ""
    if run.watch is not None:
        run.watch.compare()
        drift = run.watch.first
    about = {key: description[key] for key in ("program", "settings", "inputs")}
    _print_done(run, options, drift, found.passed_over, about, elapsed_s=elapsed_s, workers=executor.workers)
    if scores is not None:
        print(scores.describe())
    if expected is not None and (missing := expected.not_among(part.name for part in parts)):
        print(f"{len(missing)} parts of {options.verify} were not read: {visible(', '.join(missing[:5]))}")
    wanted = len(parts) if expected is not None else sum(bool(part.expected) for part in parts)
    return 1 if run.summary.errors or run.summary.verdicts["confirmed"] < wanted else 0


def _description(
    inputs: Sequence[str],
    settings: ReadSettings,
    options: RunOptions,
    learning: bool,
    certificate: Certificate | None,
) -> dict[str, Any]:
    """What the rows depend on."""
    return {
        **({"learn_die": True} if learning else {}),
        "settings": settings.model_dump(mode="json", exclude_defaults=True),
        **(
            {"files": {str(path): file_sha256(path) for path in files}}
            if (files := files_of(settings))
            else {}
        ),
        "inputs": [*inputs, *options.manifest],
        "verify": options.verify,
        **({} if options.order is None else {"order": str(options.order)}),
        "program": program_version(),
        **({} if certificate is None else {"certified": certificate.threshold}),
    }


def _print_done(
    run: Run,
    options: RunOptions,
    drift: str,
    passed_over: PassedOver,
    about: dict[str, Any],
    *,
    elapsed_s: float,
    workers: int,
) -> None:
    summary = run.summary
    if summary.parts > 1:
        lines = summary.lines(elapsed_s=elapsed_s, read_now=run.read_now, workers=workers)
        print("\n".join(map(visible, lines)))
    if said := passed_over.describe():
        print(visible(said))
    if run.second is not None and run.second.again:
        print(f"{run.second.again:,} read again with the shapes learned")
    if drift:
        print(f"warning: {drift}", file=sys.stderr)
    if run.known:
        print(
            f"{run.known:,} parts were in the store already, of the same files read in the same way; "
            "they are not kept twice"
        )
    if options.out is not None:
        print(f"wrote {options.out}")
        if run.second is not None and run.second.learned is not None:
            print(
                f"wrote {run.second.database}, the shapes of this lot's die; read more of it with --database"
            )
    if run.quarantine is not None and summary.errors:
        print(
            f"wrote {run.quarantine.path}, the parts that could not be read; correct their files and give it to read"
        )
    if options.summary is not None:
        counts = {
            **summary.as_json(),
            "read_now": run.read_now,
            "read_again": run.second.again if run.second is not None else 0,
            "elapsed_s": round(elapsed_s, 3),
            "passed_over": dict(sorted(passed_over.counts.items())),
            "workers": workers,
            **({"drift": drift} if run.watch is not None else {}),
            **about,
        }
        with replacing(options.summary) as temporary:
            temporary.write_text(json.dumps(counts, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(f"wrote {options.summary}")
