"""The batch run of the command line: find the parts, read them, write tables and print the summary."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from glyphs.compiling import show_compiling
from glyphs.plain_text import visible
from pipeline.common.job_file import files_of
from pipeline.common.output_paths import write_json
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.serial_rules import SerialRules
from pipeline.common.settings import ReadSettings
from pipeline.common.texts import first_of
from pipeline.common.version import file_sha256, key_of, program_version
from pipeline.errors import is_url, without_secrets
from pipeline.formats.find_parts import Listing, discover
from pipeline.formats.manifest import is_manifest, names_no_files
from pipeline.formats.part_files import PartFiles, local_name
from pipeline.formats.truth import Accuracy, PartTexts, load_expected, load_truth, read_order
from pipeline.reading.part_job import PartJob, Wants, check_run, files_to_send
from pipeline.runs.options import RunOptions
from pipeline.runs.outputs import unfinished
from pipeline.runs.read_table import print_table
from pipeline.runs.run import Run, open_run
from pipeline.runs.second_pass import runs_second_pass
from pipeline.runs.workbook import check_number
from pipeline.workers.executors import Executor, WorkerLostError

# parts whose rows are printed; of more only the counts are printed, and the table has all rows
MOST_SHOWN = 200


def parts_for(
    inputs: Sequence[str], settings: ReadSettings, *, manifests: Sequence[str] = (), recurse: bool = True
) -> Listing:
    """List the parts of a command line that its mode can read. Raises FileError: a manifest cannot be used."""
    return discover(
        inputs,
        manifests=manifests,
        recurse=recurse,
        photos=settings.mode in ("vision", "auto"),
        beside=settings.mode in ("vision", "fused"),
        height_images=settings.height_image,
    )


def run_batch(inputs: Sequence[str], settings: ReadSettings, options: RunOptions, executor: Executor) -> int:
    """Read parts and print the results; 1 if a part could not be read or its expected text is not confirmed, else 0.
    Raises FileError: a table, order or lexicon cannot be used. ClusterError."""
    options.check()
    listing = parts_for(inputs, settings, manifests=options.manifest, recurse=options.recurse)
    tables = [table for table in (options.verify, options.order, options.truth) if table is not None]
    used = [*files_of(settings), *tables]
    if options.out is not None and options.store is None:
        check_number(Path(options.out), len(listing))
    scores = Accuracy(load_truth(options.truth)) if options.truth is not None else None
    grammar = None
    if options.order is not None or options.truth is not None or options.verify is not None:
        from pipeline.common.serial_format import serial_format  # slow to import, like all of recognition

        grammar = serial_format(settings)
    serials = None if options.order is None else read_order(options.order, grammar)
    watch = None
    if settings.certificate is not None:
        from pipeline.reading.drift import watch_of  # likewise

        watch = watch_of(settings)
    expected = None
    if options.verify is not None:
        expected = load_expected(options.verify, grammar)
    parts: Sequence[PartFiles] = listing
    if expected is not None:
        by_part = expected.text_of if isinstance(expected, PartTexts) else lambda _: expected
        parts = [replace(p, expected=by_part(p.name) or p.expected) for p in parts]
    if executor.remote:
        parts = [part.absolute() for part in parts]
    pictured = options.store is not None and options.evidence is not None
    job = PartJob(
        settings=settings,
        wants=Wants(pictures="review" if pictured else "", digest=options.store is not None),
        verify=expected is not None,
        sent=files_to_send(settings) if executor.remote else None,
    )
    resumes = options.out is not None and unfinished(Path(options.out)).exists()
    if not resumes:  # a resumed run checks below, if parts are left
        _check(job, executor)
    learning = runs_second_pass(options, settings, parts)
    description = {
        "settings": settings.model_dump(mode="json", exclude_defaults=True),
        "inputs": [*inputs, *options.manifest],
        "recurse": options.recurse,
        "verify": options.verify,
        "program": program_version(),
        "learn_die": learning,
        "files": {str(path): file_sha256(path) for path in files_of(settings)},
        "order": str(options.order or ""),
        "tables": _contents_of_tables(inputs, options, parts),
        "certified": watch and watch.certificate.threshold,
    }
    shown: dict[str, ReadingRecord] = {}

    def on_row(record: ReadingRecord) -> None:
        if len(parts) <= MOST_SHOWN:
            shown[record.part] = record
        if scores is not None:
            scores.add(record)

    with open_run(options, description, second_pass=learning) as run, run.progress as progress:
        done = len(run.journal.names)
        if resumes and done < len(parts):
            _check(job, executor)
        if run.journal.resumed:
            print(f"continuing an interrupted run: {done:,} parts are read already")
        if run.journal.previous is not None:
            print(f"{options.out} already existed; it is kept as {run.journal.previous}")
        progress.start(len(parts), done)
        run.on_row, run.watch = on_row, watch
        run.rules = SerialRules(duplicates=not options.repeats, order=serials)
        began = time.monotonic()
        with show_compiling(progress.line):
            run.work(parts, job, executor)
    elapsed_s = time.monotonic() - began
    if shown:
        print_table([shown[part.name] for part in parts])
    if watch is not None:
        watch.compare()
    workers = min(executor.workers, len(parts))
    counts = {
        **run.summary.as_json(),
        "read_now": run.read_now,
        "read_again": run.second.again if run.second is not None else 0,
        "elapsed_s": round(elapsed_s, 3),
        "passed_over": dict(sorted(listing.passed_over.without(used).counts.items())),
        "workers": workers,
        **({"drift": watch.first} if watch is not None else {}),
        **{key: description[key] for key in ("program", "settings", "inputs")},
    }
    if run.summary.parts > 1:
        lines = run.summary.lines(elapsed_s=elapsed_s, read_now=run.read_now, workers=workers)
        print("\n".join(map(visible, lines)))
    listing.report_passed_over(used)
    _print_outputs(run, options, counts)
    if scores is not None:
        print("\n".join(map(visible, scores.lines())))
        named = {part.name for part in parts if not part.format}
        if grammar is not None and (broken := scores.outside(grammar, named)):
            print(visible(f"{options.truth}: {first_of(broken)}; correct the table or --format"))
    if isinstance(expected, PartTexts):
        read = {expected.name_of(part.name) for part in parts}
        if missing := [name for name in expected if name not in read]:
            print(
                f"{len(missing)} parts of {options.verify} were not read: {visible(', '.join(missing[:5]))}"
            )
    wanted = len(parts) if expected is not None else sum(bool(part.expected) for part in parts)
    return 1 if run.summary.errors or run.summary.verdicts["confirmed"] < wanted else 0


def _contents_of_tables(
    inputs: Sequence[str], options: RunOptions, parts: Sequence[PartFiles]
) -> dict[str, str]:
    manifests = [name for name in map(local_name, inputs) if is_manifest(name) and not names_no_files(name)]
    manifests += map(local_name, options.manifest)
    named = [
        str(name) for name in (options.verify, options.order) if name is not None and Path(name).is_file()
    ]
    contents = {name: file_sha256(Path(name)) for name in (*manifests, *named) if not is_url(name)}
    if remote := [without_secrets(name) for name in manifests if is_url(name)]:
        entries = [[part.name, *part.files, part.expected, part.format, part.font] for part in parts]
        contents |= dict.fromkeys(remote, key_of({"parts": entries}))
    return contents


def _check(job: PartJob, executor: Executor) -> None:
    (checked,) = executor.calls(check_run, job, [None])
    if checked.error is not None and not isinstance(checked.error, WorkerLostError):
        raise checked.error


def _print_outputs(run: Run, options: RunOptions, counts: dict[str, Any]) -> None:
    second = run.second
    if second is not None and second.again:
        were = "part was" if second.again == 1 else "parts were"
        print(f"{second.again:,} {were} read again with the learned shapes")
    if run.watch is not None and run.watch.first:
        print(f"warning: {run.watch.first}", file=sys.stderr)
    if run.known:
        print(
            f"{run.known:,} parts were in the store already, with the same files and settings; "
            "they are not stored twice"
        )
    if options.out is not None:
        print(f"wrote {options.out}")
        if second is not None and second.learned is not None:
            print(
                f"wrote {second.database}, the shapes of this lot's die; for more of the lot use it with --database"
            )
        if run.quarantine is not None and run.summary.errors:
            print(f"wrote {run.quarantine}, the unread parts; correct their files and give the list to read")
    if options.summary is not None:
        write_json(options.summary, counts)
        print(f"wrote {options.summary}")
