"""Files kept for parts, each under the hash of its content.

    root/files/3f/3f9a...  kept for good, until retention takes it
    root/incoming/         uploads and work files on the same disk; nothing there outlives a crash
    root/swept             its time is that of the last sweep
    root/identity          a random number, by which a store that several services share knows its one folder

A file is on the disk before the store names it, and the store has forgotten it before it is removed. So after a crash
there may be a file too many, which `sweep` removes, but never one too few.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import logging
import math
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.atomic import replacing, sync_folder, sync_names
from glyphs.errors import FileError
from glyphs.file_lock import exclusively
from glyphs.plain_text import visible
from pipeline.common.private import open_no_link, private_folder
from pipeline.common.records import EvidenceRecord

if TYPE_CHECKING:
    from pipeline.reading.part_pictures import Picture
    from pipeline.store.store import Store

# maximum plausible time between two sweeps, seconds: a plant that stands still for a month
MOST_GAP_S = 31 * 86_400.0
# maximum drift of the clock against the monotonic one between two sweeps, seconds: more is a leap, which would
# make unfinished files look old
MOST_DRIFT_S = 600.0
_log = logging.getLogger(__name__)
_HASH = re.compile(r"[0-9a-f]{64}")
_BATCH = 200
_PROBE_BYTES = 4096
# minimum free space on the disk, bytes: with less a service is not ready, because the next upload may not fit
LEAST_ROOM_BYTES = 64 << 20


class FileState(StrEnum):
    """State of a file in the evidence folder."""

    WHOLE = "whole"
    MISSING = "missing"
    DAMAGED = "damaged"


class EvidenceFolder:
    """Files named by the hash of their content; `incoming` is for uploads and work files, on the same disk."""

    def __init__(self, root: Path) -> None:
        """Make the folder if it is missing. Raises FileError: it cannot be made."""
        self.root = root
        self.incoming = root / "incoming"
        self._files = root / "files"
        self._lock = root / ".lock"
        with file_errors(root):
            for folder in (root, self.incoming, self._files):
                private_folder(folder)
            sync_folder(root)
        sync_names(root.parent)
        self._synced: set[Path] = set()

    def check_is_that_of(self, store: Store) -> None:
        """Check that it is the folder of all services that share the store. Raises FileError: it is another."""
        file = self.root / "identity"
        with file_errors(file), exclusively(self._lock):
            if not file.exists():
                with replacing(file, private=True) as new:
                    new.write_text(secrets.token_hex(16), encoding="ascii")
            identity = file.read_text(encoding="ascii").strip()
        claimed = store.claim_evidence_folder(identity)
        if claimed != identity:
            raise FileError(
                self.root,
                "is not the evidence folder of this store",
                "services that share a store need one folder: give all of them the same --folder; if the folder was "
                f"lost, write {claimed} into {file}",
            )

    def keep(self, path: Path, *, sha256: str = "") -> tuple[str, int]:
        """Move a file of `incoming` into the folder, where it survives a power cut. Returns its SHA-256 in hexadecimal
        (computed if not given), and its length in bytes. Raises FileError."""
        with file_errors(path):
            with open_no_link(path) as stream:
                handle = stream.fileno()
                if not stat.S_ISREG(os.fstat(handle).st_mode):
                    raise FileError(path, "is not a file", "name a file")
                sha256 = sha256 or hashlib.file_digest(stream, "sha256").hexdigest()
                if hasattr(os, "fchmod"):
                    os.fchmod(handle, 0o600)
                os.fsync(handle)
                n_bytes = os.fstat(handle).st_size
            target = self.path(sha256)
            # a folder that is there may not be synced yet: another thread or a killed process may have made it
            if target.parent not in self._synced:
                target.parent.mkdir(mode=0o700, exist_ok=True)
                sync_folder(self._files)
                self._synced.add(target.parent)
            with exclusively(self._lock):
                os.replace(path, target)
                os.utime(target)
            sync_folder(target.parent)
        return sha256, n_bytes

    def keep_content(self, content: bytes) -> tuple[str, int]:
        with file_errors(self.incoming):
            handle, name = tempfile.mkstemp(dir=self.incoming)
            try:
                with open(handle, "wb") as stream:
                    stream.write(content)
                return self.keep(Path(name), sha256=hashlib.sha256(content).hexdigest())
            finally:
                Path(name).unlink(missing_ok=True)

    def keep_pictures(self, pictures: Iterable[Picture]) -> list[EvidenceRecord]:
        return [
            EvidenceRecord(p.kind, *self.keep_content(p.content), p.name, p.media_type, p.meta)
            for p in pictures
        ]

    def path(self, sha256: str) -> Path:
        if _HASH.fullmatch(sha256) is None:
            raise ValueError(f"{sha256[:80]!r} is not an SHA-256; give 64 hexadecimal digits in lower case")
        return self._files / sha256[:2] / sha256

    def state(self, sha256: str, *, read: bool = True) -> FileState:
        """State of the file with that hash; if it is read, its content is compared with the hash."""
        try:
            with self.path(sha256).open("rb") as stream:
                whole = not read or hashlib.file_digest(stream, "sha256").hexdigest() == sha256
        except FileNotFoundError:
            return FileState.MISSING
        except OSError:  # a bad sector, say
            return FileState.DAMAGED
        return FileState.WHOLE if whole else FileState.DAMAGED

    def whole(self, hashes: Iterable[str]) -> tuple[Path, ...]:
        paths = []
        for name in hashes:
            if (state := self.state(name)) is FileState.WHOLE:
                paths.append(self.path(name))
            else:
                _log.error("the file %s kept as evidence is %s", name, state.value)
        return tuple(paths)

    def take(self, sha256: str, other: EvidenceFolder) -> FileState:
        """Copy a file from another folder and return its state; the caller then flushes the disk (`os.sync`)."""
        target = self.path(sha256)
        if self.state(sha256) is FileState.WHOLE:
            return FileState.WHOLE
        if (state := other.state(sha256)) is not FileState.WHOLE:
            return state
        with file_errors(target):
            target.parent.mkdir(mode=0o700, exist_ok=True)
            target.unlink(missing_ok=True)
            part = self.incoming / sha256
            shutil.copyfile(other.path(sha256), part)
            part.chmod(0o600)
            os.replace(part, target)
            if self.state(sha256) is not FileState.WHOLE:
                raise OSError(errno.EIO, "the copy is not what was copied")
        return state

    def check_room(self) -> None:
        """Check that a file can be written, synced and removed, with room beyond it. Raises FileError: it cannot."""
        with file_errors(self.root):
            if shutil.disk_usage(self.incoming).free < LEAST_ROOM_BYTES:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            with tempfile.TemporaryFile(dir=self.incoming) as probe:
                probe.write(b"\0" * _PROBE_BYTES)
                probe.flush()
                os.fsync(probe.fileno())

    def new_work_folder(self) -> Path:
        """Make a folder in `incoming` for one request; the caller removes it. Raises FileError: it cannot be made."""
        with file_errors(self.incoming):
            return Path(tempfile.mkdtemp(prefix="work-", dir=self.incoming))

    def sweep(self, store: Store, *, older_than_s: float) -> int:
        """Remove files that no part needs, and those of `incoming`, and return their number. Files younger than
        `older_than_s` stay: they may still be written."""
        latest_s = time.time() - older_than_s
        n_removed = sum(_remove_if_older(path, latest_s) for path in self.incoming.iterdir())
        for names in self.hashes(before_s=latest_s):
            needed = store.needed_hashes(names)
            for name in names:
                if name not in needed:
                    with exclusively(self._lock):
                        n_removed += _remove_if_older(self.path(name), latest_s)
        return n_removed

    def hashes(self, *, before_s: float = math.inf) -> Iterator[list[str]]:
        """Hashes of the files kept before a time, in batches of some hundreds."""
        for folder in sorted(self._files.iterdir()):
            names = []
            with contextlib.suppress(FileNotFoundError, NotADirectoryError), os.scandir(folder) as entries:
                names = [e.name for e in entries if _HASH.fullmatch(e.name) and _kept_before(e, before_s)]
            yield from (names[k : k + _BATCH] for k in range(0, len(names), _BATCH))


def _kept_before(entry: os.DirEntry[str], latest_s: float) -> bool:
    try:
        return entry.stat(follow_symlinks=False).st_mtime <= latest_s
    except OSError:
        return False


def _remove_if_older(path: Path, latest_s: float) -> int:
    try:
        status = path.lstat()
        if status.st_mtime > latest_s:
            return 0
        if not stat.S_ISDIR(status.st_mode):
            path.unlink()
            return 1
        # the time of a folder is that of a change of its names, not of its files
        inside = [p for p in path.rglob("*") if not p.is_dir()]
        if any(p.lstat().st_mtime > latest_s for p in inside):
            return 0
        shutil.rmtree(path, ignore_errors=True)
        return len(inside)
    except FileNotFoundError:
        return 0
    except OSError as error:  # one that cannot be removed must not stop the others
        _log.warning("not removed: %s (%s)", visible(path.name), error.strerror or error)
        return 0


@contextlib.contextmanager
def file_errors(path: Path) -> Iterator[None]:
    """Report errors of the disk as a FileError about a path."""
    try:
        yield
    except OSError as error:
        hint = "check that the disk has room and that the folder can be written"
        raise FileError(path, f"cannot be kept ({error.strerror or error})", hint) from error


@dataclass
class SweepClock:
    """Check before every sweep that the clock has not jumped ahead, which would make files look old. `file` has the
    time of the last sweep as its own; `trouble` says why nothing is swept."""

    file: Path
    wall_s: Callable[[], float] = time.time
    monotonic_s: Callable[[], float] = time.monotonic
    trouble: str = field(default="", init=False)
    _before: tuple[float, float] | None = field(default=None, init=False)

    def may_sweep(self, newest: datetime | None) -> bool:
        """Whether to sweep now; if so, the time is recorded. Raises OSError: it cannot be. Before the first sweep the
        clock is judged by `newest`, the time of the latest part."""
        now_s = self.wall_s()
        before, self._before = self._before, (now_s, self.monotonic_s())
        if not self.file.exists():
            self.file.touch(mode=0o600)
            first_s = now_s if newest is None else min(now_s, newest.timestamp())
            os.utime(self.file, (first_s, first_s))
        gap_s = now_s - self.file.stat().st_mtime
        self.trouble = ""
        if gap_s > MOST_GAP_S:
            self.trouble = (
                f"nothing is deleted: by the clock the last sweep was {gap_s / 86_400.0:,.0f} days ago"
            )
            _log.warning(
                "not swept: %s; set the clock; if it is right, run: touch %s", self.trouble, self.file
            )
            return False
        if before is not None:
            leap_s = now_s - before[0] - (self._before[1] - before[1])
            if abs(leap_s) > MOST_DRIFT_S:
                self.trouble = f"nothing is deleted this time: the clock has leapt by {leap_s:,.0f} s"
                _log.warning("not swept: %s", self.trouble)
                return False
        if gap_s > 0.0:
            os.utime(self.file, (now_s, now_s))
        return True
