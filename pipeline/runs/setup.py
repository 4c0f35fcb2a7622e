"""From what a command line names to a run that is ready: its table, list of bad parts, and store."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.common.settings import ReadSettings
from pipeline.formats.part_files import PartFiles
from pipeline.runs.options import RunOptions
from pipeline.runs.run import Run
from pipeline.runs.task import RunOrder

if TYPE_CHECKING:
    from pipeline.formats.find_parts import Listing
    from pipeline.reading.expected import Expected
    from pipeline.runs.run_journal import RunJournal
    from pipeline.runs.second_pass import SecondPass


@contextmanager
def opened(options: RunOptions, description: dict[str, Any], *, learns: bool = False) -> Iterator[Run]:
    """A run with its table open, begun or taken up where it was broken off.

    Args:
        options: where rows go.
        description: what the answers depend on, in plain JSON values.
        learns: whether the lot teaches itself.

    Raises:
        FileError: the table holds another run, is being written, or cannot be.
        StoreError: a store that cannot be opened.
    """
    from pipeline.common.version import key_of
    from pipeline.runs.quarantine import Quarantine
    from pipeline.runs.run_journal import RunJournal
    from pipeline.runs.store_target import RunStore

    if options.out is None:
        with (
            tempfile.TemporaryDirectory(prefix="tactile-marks-") as folder,
            RunJournal.open(Path(folder) / "rows.jsonl", description) as book,
        ):
            yield Run(book, second=_second_pass(book, options) if learns else None)
        return
    table, bad = Path(options.out), Path(options.out).with_suffix(".quarantine.csv")
    key = key_of({**description, "store": options.store})
    if options.store is not None:
        # its rows spare a run that broke off the reading; that no part is kept twice is up to the store's keys
        table, bad = Path(f"tactile-marks-{key}.jsonl"), Path("parts.quarantine.csv")
    with RunJournal.open(table, description) as book:
        with ExitStack() as stack:
            if options.store is not None:
                book.keep_private()
            quarantine = Quarantine(bad, keep=book.resumed)
            stack.callback(quarantine.close)
            store = None
            if options.store is not None:
                store = stack.enter_context(RunStore(options.store, key, evidence=options.evidence))
            run = Run(book, quarantine, store, _second_pass(book, options) if learns else None)
            yield run
        # last, with workers and store gone: broken off before, the same command reads nothing again
        if options.store is not None and run.finished:
            book.forget()


def _second_pass(book: RunJournal, options: RunOptions) -> SecondPass:
    """With its database beside the table; one that an earlier run left there is moved as its table is."""
    from pipeline.runs.second_pass import SecondPass

    database = book.path.with_suffix(".die.glyphs")
    if database.exists() and not book.resumed:
        os.replace(database, database.with_name(database.name + "~"))
    return SecondPass(database, always=bool(options.learn_die))


def parts_for(inputs: Sequence[str], settings: ReadSettings, *, manifests: Sequence[str] = ()) -> Listing:
    """The parts of a command line that the senses of its mode can read.

    Raises:
        NothingFoundError: no part.
        FileError: a manifest that cannot be used.
    """
    from pipeline.formats.find_parts import list_parts

    vision = settings.mode in ("vision", "fused", "auto")
    return list_parts(
        inputs,
        manifests=manifests,
        photos=vision and settings.mode != "fused",
        beside=vision,
        height_images=settings.height_image,
    )


def order_for(settings: ReadSettings, options: RunOptions, *, sent: bool, verify: bool) -> RunOrder:
    """How the parts are read, ready to be sent to the workers.

    Args:
        settings: of reading.
        options: of the run.
        sent: whether the workers are on machines of their own, which lack the files of the settings.
        verify: whether texts are expected.

    Raises:
        FileError: a file of the settings that cannot be sent.
    """
    from pipeline.runs.setting_files import files_to_send

    stored = options.store is not None
    return RunOrder(
        settings,
        verify,
        pictures=stored and options.evidence is not None,
        digests=stored,
        measures=settings.certificate is not None,
        sent=files_to_send(settings) if sent else {},
    )


def with_expected(parts: Sequence[PartFiles], expected: Expected) -> Sequence[PartFiles]:
    """The parts with the texts that a command line or a table expects of them."""
    return [replace(part, expected=expected.of(part.name) or part.expected) for part in parts]


def absolute(parts: Sequence[PartFiles]) -> Sequence[PartFiles]:
    """The parts with local files named as on any machine that shares the disk."""
    return [part.absolute() for part in parts]
