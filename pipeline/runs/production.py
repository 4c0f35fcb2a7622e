"""A command line's run, from its inputs to what is printed at its end."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.atomic import replacing
from glyphs.compiling import show_compiling
from glyphs.plain_text import visible
from pipeline.common.job_file import files_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.serial_format import serial_format
from pipeline.common.settings import ReadSettings
from pipeline.common.version import file_sha256, program_version
from pipeline.formats.find_parts import Listing, discover
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import Accuracy, load_truth, read_order
from pipeline.reading.expected import load_expected
from pipeline.runs.lot_check import LotCheck
from pipeline.runs.options import RunOptions
from pipeline.runs.read_table import print_table
from pipeline.runs.run import Run, opened
from pipeline.runs.second_pass import learns
from pipeline.runs.setting_files import files_to_send
from pipeline.runs.task import RunOrder, check_order
from pipeline.runs.workbook import check_number
from pipeline.workers.executors import Executor, WorkerLostError

if TYPE_CHECKING:
    from pipeline.reading.certificate import Certificate

MOST_SHOWN = 200
"""Parts whose rows are printed; of more the counts are, and the table has the rows."""


def parts_for(inputs: Sequence[str], settings: ReadSettings, *, manifests: Sequence[str] = ()) -> Listing:
    """List the parts of a command line that the senses of its mode can read.

    Raises:
        NothingFoundError: no part.
        FileError: a manifest that cannot be used.
    """
    vision = settings.mode in ("vision", "fused", "auto")
    return discover(
        inputs,
        manifests=manifests,
        photos=vision and settings.mode != "fused",
        beside=vision,
        height_images=settings.height_image,
    )


def absolute(parts: Sequence[PartFiles]) -> Sequence[PartFiles]:
    """The parts with local files named as on any machine that shares the disk."""
    return [part.absolute() for part in parts]


def run_batch(inputs: Sequence[str], settings: ReadSettings, options: RunOptions, executor: Executor) -> int:
    """Read parts, and print the results.

    Args:
        inputs: files, folders, globs, URLs and manifests.
        settings: settings of reading.
        options: checks and outputs.
        executor: executor that reads.

    Returns:
        0; 1 where a part could not be read, or its expected text is not confirmed.

    Raises:
        FileError: a table, list or lexicon that cannot be used.
        NothingFoundError: no part.
        ClusterError: an unusable cluster.
        ValueError: settings, a font, format or database that cannot be used.
    """
    options.check()
    found = parts_for(inputs, settings, manifests=options.manifest)
    if options.out is not None and options.store is None:
        check_number(Path(options.out), len(found))
    scores = Accuracy(load_truth(options.truth)) if options.truth is not None else None
    production = read_order(options.order) if options.order is not None else None
    certificate = watch = None
    if settings.certificate is not None:
        from pipeline.reading.certificate import certificate_of  # slow to import, as all of recognition
        from pipeline.reading.drift import DriftWatch

        if (certificate := certificate_of(settings)) is not None:
            watch = DriftWatch(certificate)
    expected = load_expected(options.verify, serial_format(settings)) if options.verify is not None else None
    parts: Sequence[PartFiles] = found
    if expected is not None:
        parts = [replace(p, expected=expected.of(p.name) or p.expected) for p in parts]
    if executor.remote:
        parts = absolute(parts)
    order = RunOrder(
        settings,
        verify=expected is not None,
        pictures=options.store is not None and options.evidence is not None,
        digests=options.store is not None,
        measures=certificate is not None,
        sent=files_to_send(settings) if executor.remote else None,
    )
    # in a worker, which keeps the reader for its first part
    (checked,) = executor.calls(check_order, order, [None])
    if checked.error is not None and not isinstance(checked.error, WorkerLostError):
        raise checked.error
    learning = learns(options, settings, parts)
    description = _description(inputs, settings, options, learning, certificate)
    shown: dict[str, ReadingRecord] = {}

    def on_row(record: ReadingRecord) -> None:
        if len(parts) <= MOST_SHOWN:
            shown[record.part] = record
        if scores is not None:
            scores.add(record)

    with opened(options, description, learns=learning) as run, run.progress as progress:
        done = len(run.journal.names)
        if run.journal.resumed:
            print(f"continuing an interrupted run: {done:,} parts are read already")
        if run.journal.kept is not None:
            print(f"{options.out} existed already; it is kept as {run.journal.kept}")
        progress.start(len(parts), done)
        run.on_row = on_row
        run.lot = LotCheck(production) if production is not None else None
        run.watch = watch
        began = time.monotonic()
        with show_compiling(progress.line):
            run.work(parts, order, executor)
    elapsed_s = time.monotonic() - began
    if shown:
        print_table([shown[part.name] for part in parts])
    if run.watch is not None:
        run.watch.compare()
    counts = {
        "read_now": run.read_now,
        "read_again": run.second.again if run.second is not None else 0,
        "elapsed_s": round(elapsed_s, 3),
        "passed_over": dict(sorted(found.passed_over.counts.items())),
        "workers": min(executor.workers, len(parts)),
        **({"drift": run.watch.first} if run.watch is not None else {}),
        **{key: description[key] for key in ("program", "settings", "inputs")},
    }
    _print_done(run, options, found.passed_over.describe(), counts)
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
    """Settings, options and versions that the rows depend on."""
    told = {
        "learn_die": learning,
        "files": {str(path): file_sha256(path) for path in files_of(settings)},
        "order": str(options.order or ""),
        "certified": certificate and certificate.threshold,
    }
    return {
        "settings": settings.model_dump(mode="json", exclude_defaults=True),
        "inputs": [*inputs, *options.manifest],
        "verify": options.verify,
        "program": program_version(),
        **{name: value for name, value in told.items() if value},
    }


def _print_done(run: Run, options: RunOptions, passed_over: str, counts: dict[str, Any]) -> None:
    summary, second = run.summary, run.second
    if summary.parts > 1:
        times = {name: counts[name] for name in ("elapsed_s", "read_now", "workers")}
        print("\n".join(map(visible, summary.lines(**times))))
    if passed_over:
        print(visible(passed_over))
    if second is not None and second.again:
        print(f"{second.again:,} read again with the shapes learned")
    if counts.get("drift"):
        print(f"warning: {counts['drift']}", file=sys.stderr)
    if run.known:
        print(
            f"{run.known:,} parts were in the store already, of the same files read in the same way; "
            "they are not kept twice"
        )
    if options.out is not None:
        print(f"wrote {options.out}")
        if second is not None and second.learned is not None:
            print(f"wrote {second.database}, the shapes of this lot's die; read more of it with --database")
        if run.quarantine is not None and summary.errors:
            print(
                f"wrote {run.quarantine.path}, the parts that could not be read; correct their files and give it to "
                "read"
            )
    if options.summary is not None:
        text = json.dumps({**summary.as_json(), **counts}, indent=1, ensure_ascii=False)
        with replacing(options.summary) as temporary:
            temporary.write_text(f"{text}\n", encoding="utf-8")
        print(f"wrote {options.summary}")
