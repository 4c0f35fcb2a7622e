"""A store and its files, copied while the service runs, and brought back: elsewhere, or into another database.

    backups/2026-11-23/
        manifest.json       what it is: version, counts, the hash of store.db
        store.db            every row as it was at one moment: SQLite, whatever the store is in
        evidence/files/     every file that a row names, each under its hash

The rows are copied first: a file is on the disk before a row names it, so none is missing. A backup appears whole or
not at all. Bringing back takes the files first and then all rows in one transaction: broken off, it is begun again.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

import sqlalchemy as sa

from glyphs.atomic import sync_folder
from glyphs.errors import FileError, require_file
from pipeline.common.file_lock import exclusively
from pipeline.common.parsed import MOST_BYTES, json_of
from pipeline.common.private import private_file, private_folder
from pipeline.common.version import file_sha256, program_version
from pipeline.store.copying import copy_rows, is_empty, skip_deliveries
from pipeline.store.errors import ConflictError
from pipeline.store.evidence_folder import EvidenceFolder, FileState
from pipeline.store.store import Store
from pipeline.store.tables import METADATA, outbox, sessions

FORMAT_VERSION = 1
_MANIFEST, _STORE, _EVIDENCE = "manifest.json", "store.db", "evidence"
SKIPPED_DELIVERIES = 1_000_000
"""Numbers that a store brought back gives to no delivery: those since the backup are known to the receivers."""


@dataclass(frozen=True)
class Backup:
    """What a backup's manifest tells.

    Attributes:
        made_at: when its rows were copied, ISO 8601.
        program: version of this program.
        sha256: of its store.db; written down elsewhere, it shows whether a backup is what it was.
        rows: in every table.
        files, n_bytes: of evidence.
        lost: hashes of files that were missing or damaged when it was made.
    """

    made_at: str
    program: str
    sha256: str
    rows: Mapping[str, int]
    files: int
    n_bytes: int
    lost: Sequence[str]


def back_up(store: Store, evidence: EvidenceFolder, to: Path, *, previous: Path | None = None) -> Backup:
    """Copy a store and its files into a new folder; the service may run.

    Args:
        store: to be copied.
        evidence: its files.
        to: the folder, not there yet.
        previous: backup on the same disk; files that it has are linked, not copied once more.

    Raises:
        FileError: the folder is there already, is being written by another, or cannot be written.
        StoreError: the store does not answer.
    """
    if to.exists():
        raise FileError(to, "is there already", "name a new folder for every backup")
    if previous is not None:
        read_manifest(previous)
    partial = to.with_name(to.name + ".partial")
    with _told(partial), contextlib.ExitStack() as stack:
        private_folder(partial)
        if not stack.enter_context(exclusively(partial / ".lock", wait=False)):
            raise FileError(to, "is being written by another backup", "wait for it, or name another folder")
        for left in (_STORE, f"{_STORE}-wal", f"{_STORE}-shm", f"{_STORE}.lock"):
            (partial / left).unlink(missing_ok=True)
        made_at = _copy_store(store, partial / _STORE)
        files = EvidenceFolder(partial / _EVIDENCE)
        sources = [] if previous is None else [EvidenceFolder(previous / _EVIDENCE)]
        with _opened(partial / _STORE) as copied:
            counts = _take_all(copied, files, [evidence], linked=sources, live=store)
            rows = _rows(copied)
        made = Backup(made_at.isoformat(), program_version(), file_sha256(partial / _STORE), rows, *counts)
        manifest = {"format_version": FORMAT_VERSION, **asdict(made)}
        (partial / _MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
        for left in (".lock", f"{_STORE}.lock"):
            (partial / left).unlink(missing_ok=True)
        _sync()
        os.rename(partial, to)
        sync_folder(to.parent)
    return made


def restore(backup: Path, store: Store, evidence: EvidenceFolder) -> Backup:
    """Bring a backup back into an empty store, in whatever database, and its files into a folder.

    Raises:
        FileError: it is no backup, or damaged; a file cannot be written.
        ConflictError: the store is not empty.
        StoreError: the store does not answer, or the backup was made by a newer version.
    """
    with unpacked(backup) as (told, copied):
        with store.database.reading() as tx:
            _refuse_unless_empty(is_empty(tx), store)
        lost = _take_all(copied, evidence, [EvidenceFolder(backup / _EVIDENCE)])[2]
        _sync()
        with copied.database.snapshot() as source, store.database.writing() as target:
            _refuse_unless_empty(is_empty(target), store)
            copy_rows(source, target)
            target.execute(sa.update(outbox).values(owner=None, leased_until=None))
            skip_deliveries(target, SKIPPED_DELIVERIES)
        return Backup(**{**asdict(told), "lost": lost})


@contextlib.contextmanager
def unpacked(backup: Path) -> Iterator[tuple[Backup, Store]]:
    """A backup's manifest and its store, brought up to date in a copy; the backup itself stays as it is.

    Raises:
        FileError: it is no backup, or damaged.
        StoreError: it was made by a newer version.
    """
    told = read_manifest(backup)
    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as folder:
        with _told(backup):
            copy = Path(shutil.copy(backup / _STORE, Path(folder) / _STORE))
        if file_sha256(copy) != told.sha256:
            raise FileError(backup / _STORE, "is not as it was written", "take another backup")
        with _opened(copy) as copied:
            yield told, copied


def read_manifest(backup: Path) -> Backup:
    """What a backup is.

    Raises:
        FileError: it is none, or of a newer version.
    """
    path = backup / _MANIFEST
    try:
        require_file(path, most_bytes=MOST_BYTES)
        found = json_of(path.read_bytes())
        version = found.pop("format_version")
        if version == FORMAT_VERSION:
            return Backup(**found)
    except (FileError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(backup, f"is no whole backup ({error})", "name the folder of one") from error
    raise FileError(path, f"has format version {version}; this program reads {FORMAT_VERSION}", "update it")


def _copy_store(store: Store, to: Path) -> datetime:
    private_file(to)
    with store.database.snapshot() as source:
        made_at = source.now
        if source.postgresql:
            with _opened(to) as copied, copied.database.writing() as target:
                copy_rows(source, target)
            return made_at
    store.database.copy_file(to)
    return made_at


def _take_all(
    copied: Store,
    files: EvidenceFolder,
    sources: Sequence[EvidenceFolder],
    *,
    linked: Sequence[EvidenceFolder] = (),
    live: Store | None = None,
) -> tuple[int, int, list[str]]:
    """Every file that a store names; how many, their bytes, and the hashes of those that could not be had."""
    n_files, n_bytes, lost, after = 0, 0, list[str](), ""
    while hashes := copied.needed_after(after):
        after = hashes[-1]
        for sha256 in hashes:
            state = files.take(sha256, linked, link=True) if linked else FileState.MISSING
            if state is not FileState.WHOLE:
                state = files.take(sha256, sources)
            if state is FileState.WHOLE:
                n_files, n_bytes = n_files + 1, n_bytes + files.path(sha256).stat().st_size
            elif live is not None and not live.needed_hashes((sha256,)):
                copied.forget_files((sha256,))  # its time was up meanwhile
            else:
                lost.append(sha256)
    return n_files, n_bytes, lost


def _rows(store: Store) -> dict[str, int]:
    with store.database.reading() as tx:
        return {
            table.name: int(tx.execute(sa.select(sa.func.count()).select_from(table)).scalar_one())
            for table in METADATA.sorted_tables
            if table is not sessions
        }


def _refuse_unless_empty(empty: bool, store: Store) -> None:
    if not empty:
        raise ConflictError(
            f"the store {store.database.shown} is not empty", hint="restore into a new one: --folder, --store"
        )


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Store]:
    with contextlib.closing(Store.open(f"sqlite:///{path.absolute()}")) as store:
        yield store


def _sync() -> None:
    if hasattr(os, "sync"):  # once, not after every file
        os.sync()


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise FileError(
            path, f"cannot be used ({error.strerror or error})", "check the disk and the folder"
        ) from error
