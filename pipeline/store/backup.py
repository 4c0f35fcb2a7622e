"""Back up a store and its files while the service runs, and restore them elsewhere or into another database.

    backups/2026-11-23/
        manifest.json       version, counts, the hash of store.db
        store.db            every row as it was at one moment: SQLite, whatever the store is in
        evidence/files/     every file that a row names, each under its hash

The rows are copied first: a file is on the disk before a row names it, so none is missing. A backup appears whole or
not at all. A restore copies the files first, then all rows in one transaction; after an interruption, run it again.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import sqlalchemy as sa

from glyphs.atomic import sync_folder
from glyphs.errors import FileError
from glyphs.file_lock import exclusively
from pipeline.common.parsed import MOST_BYTES, json_of
from pipeline.common.private import private_folder
from pipeline.common.version import file_sha256, program_version
from pipeline.errors import require_file
from pipeline.store.database import Transaction
from pipeline.store.errors import ConflictError
from pipeline.store.evidence_folder import EvidenceFolder, FileState, file_errors
from pipeline.store.store import Store
from pipeline.store.tables import METADATA, evidence, outbox, sessions

FORMAT_VERSION = 1
_MANIFEST, _STORE, _FILES = "manifest.json", "store.db", "evidence"
# delivery numbers that a restored store skips: receivers may know those given since the backup
SKIPPED_DELIVERIES = 1_000_000
_CHUNK = 500
# without sessions: restoring a backup must not sign a user in again
_TABLES = [table for table in METADATA.sorted_tables if table is not sessions]


@dataclass(frozen=True)
class Backup:
    """A backup's manifest."""

    made_at: str
    program: str
    sha256: str  # of its store.db; kept elsewhere, it shows whether a backup was changed
    rows: Mapping[str, int]
    last_delivery: int  # highest number that any delivery has had
    files: int
    n_bytes: int
    lost: Sequence[str]  # hashes of files that were missing or damaged when it was made


def back_up(store: Store, files: EvidenceFolder, to: Path) -> Backup:
    """Copy a store and its files into a new folder; the service may run. Raises FileError."""
    if to.exists():
        raise FileError(to, "is there already", "name a new folder for every backup")
    partial = to.with_name(to.name + ".partial")
    with file_errors(partial), contextlib.ExitStack() as stack:
        private_folder(partial)
        if not stack.enter_context(exclusively(partial / ".lock", wait=False)):
            raise FileError(to, "is being written by another backup", "wait for it, or name another folder")
        for left in partial.glob(f"{_STORE}*"):
            left.unlink()
        with _open_store(partial / _STORE) as copied:
            with store.read_transaction() as source, copied.write_transaction() as target:
                copy_rows(source, target)
                made_at, last = source.now.isoformat(), last_delivery(source)
                rows = {table.name: target.count(table) for table in _TABLES}
            counts = _take_all(copied, EvidenceFolder(partial / _FILES), files, live=store)
        backup = Backup(made_at, program_version(), file_sha256(partial / _STORE), rows, last, *counts)
        manifest = {"format_version": FORMAT_VERSION, **asdict(backup)}
        (partial / _MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
        for left in partial.glob("*.lock"):
            left.unlink()
        _sync()
        os.rename(partial, to)
        sync_folder(to.parent)
    return backup


def restore(backup: Path, store: Store, files: EvidenceFolder) -> Backup:
    """Restore a backup into an empty store, in any database, and its files into a folder. Raises FileError: it is no
    backup, or damaged. ConflictError: the store is not empty. StoreError: no answer, or an unknown version."""
    with unpacked(backup) as (manifest, copied):
        with store.read_transaction() as tx:
            _refuse_unless_empty(tx, store)
        _, _, lost = _take_all(copied, files, EvidenceFolder(backup / _FILES))
        _sync()
        with copied.read_transaction() as source, store.write_transaction() as target:
            _refuse_unless_empty(target, store)
            copy_rows(source, target)
            target.execute(sa.update(outbox).values(owner=None, leased_until=None))
            _count_on(target, outbox, manifest.last_delivery + SKIPPED_DELIVERIES)
        return replace(manifest, lost=lost)


@contextlib.contextmanager
def unpacked(backup: Path) -> Iterator[tuple[Backup, Store]]:
    """A backup's manifest and an upgraded copy of its store. Raises FileError, StoreError: it cannot be used."""
    manifest = read_manifest(backup)
    with file_errors(backup):
        if file_sha256(backup / _STORE) != manifest.sha256:
            raise FileError(backup / _STORE, "has changed since it was written", "take another backup")
    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as folder:
        copy = Path(folder) / _STORE
        with file_errors(copy):
            shutil.copy(backup / _STORE, copy)
        with _open_store(copy) as copied:
            yield manifest, copied


def read_manifest(backup: Path) -> Backup:
    """Read the manifest of a backup."""
    path = backup / _MANIFEST
    try:
        require_file(path, most_bytes=MOST_BYTES)
        manifest = json_of(path.read_bytes())
        version = manifest.pop("format_version")
        if version == FORMAT_VERSION:
            return Backup(**manifest)
    except (FileError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(backup, f"is not a complete backup ({error})", "name the folder of one") from error
    raise FileError(path, f"has format version {version}; this program reads {FORMAT_VERSION}", "update it")


def copy_rows(source: Transaction, target: Transaction) -> None:
    """Copy all rows except sessions; row numbers stay, and the target continues counting after them."""
    for table in _TABLES:
        rows = source.connection.execution_options(yield_per=_CHUNK).execute(sa.select(table))
        for chunk in rows.mappings().partitions():
            target.execute(sa.insert(table), [dict(row) for row in chunk])
        if target.postgresql and "id" in table.c and table.c.id.autoincrement is True:
            _count_on(target, table, _highest(target, table))


def last_delivery(tx: Transaction) -> int:
    """The highest number of any delivery, also of deleted ones."""
    counted = (
        "SELECT last_value FROM pg_sequences WHERE schemaname = current_schema()"
        " AND format('%I.%I', schemaname, sequencename) = pg_get_serial_sequence('outbox', 'id')"
        if tx.postgresql
        else "SELECT seq FROM sqlite_sequence WHERE name = 'outbox'"
    )
    return max(int(tx.execute(sa.text(counted)).scalar() or 0), _highest(tx, outbox))


def _highest(tx: Transaction, table: sa.Table) -> int:
    return int(tx.execute(sa.select(sa.func.max(table.c.id))).scalar() or 0)


def _count_on(tx: Transaction, table: sa.Table, number: int) -> None:
    if tx.postgresql:
        sequence = sa.func.pg_get_serial_sequence(table.name, "id")
        tx.execute(sa.select(sa.func.setval(sequence, max(1, number), number > 0)))
    else:
        counters = sa.table("sqlite_sequence", sa.column("name"), sa.column("seq"))
        tx.execute(sa.delete(counters).where(counters.c.name == table.name))
        tx.execute(sa.insert(counters).values(name=table.name, seq=number))


def _take_all(
    copied: Store,
    files: EvidenceFolder,
    source: EvidenceFolder,
    *,
    live: Store | None = None,
) -> tuple[int, int, list[str]]:
    n_files, n_bytes, lost = 0, 0, list[str]()
    for sha256 in copied.every_needed_hash():
        if files.take(sha256, source) is FileState.WHOLE:
            n_files, n_bytes = n_files + 1, n_bytes + files.path(sha256).stat().st_size
        elif live is not None and not live.needed_hashes((sha256,)):  # its time was up meanwhile
            with copied.write_transaction() as tx:
                tx.execute(sa.update(evidence).where(evidence.c.sha256 == sha256).values(gone=True))
        else:
            lost.append(sha256)
    return n_files, n_bytes, lost


def _refuse_unless_empty(tx: Transaction, store: Store) -> None:
    if any(tx.execute(sa.select(table).limit(1)).first() is not None for table in METADATA.sorted_tables):
        raise ConflictError(f"the store {store.shown} is not empty", hint="restore into a new one")


def _open_store(path: Path) -> contextlib.closing[Store]:
    return contextlib.closing(Store.open(f"sqlite:///{path.absolute()}"))


def _sync() -> None:
    if hasattr(os, "sync"):  # once, not after every file
        os.sync()
