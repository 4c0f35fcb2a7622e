"""A run's parts put into the service's store, where they are found, and reviewed, with those that came by the line."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from pipeline.batch.task import Picture, ReadPart

if TYPE_CHECKING:
    from pipeline.common.records import EvidenceRecord

_SCHEMES = ("sqlite:///", "postgresql://")


def is_store(name: str) -> bool:
    """Whether an output is a store's URL."""
    return name.startswith(_SCHEMES) or name.startswith("postgresql+")


class RunStore:
    """A store that takes the parts of one run, each once however often the run is begun again."""

    def __init__(self, url: str, run: str, *, evidence: Path | None = None) -> None:
        """Open it.

        Args:
            url: of the store.
            run: name of the run.
            evidence: the service's folder of files; without it no pictures are kept.

        Raises:
            StoreError: it cannot be opened.
            FileError: a folder that cannot be made.
            MissingExtraError: the extra `service` is not installed.
        """
        from glyphs.errors import MissingExtraError

        try:
            from pipeline.store.evidence_folder import EvidenceFolder
            from pipeline.store.store import Store
        except ModuleNotFoundError as error:
            raise MissingExtraError("a store", error.name or "sqlalchemy", "service") from error
        self._run = run
        self._folder = EvidenceFolder(evidence) if evidence is not None else None
        self._store = Store.open(url)

    def __enter__(self) -> RunStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._store.close()

    def add(self, read: ReadPart) -> None:
        """Keep a part; one that could not be read, or is kept already, is passed over.

        Raises:
            StoreError: the database does not answer.
            ValueError: a text that no store can hold.
            FileError: a picture cannot be kept.
        """
        from pipeline.common.part_id import new_part_id
        from pipeline.common.records import PartState
        from pipeline.reading.triage import state_after
        from pipeline.store.errors import MAX_TEXT, cleaned
        from pipeline.store.store import AlreadyDoneError, IdempotencyKey

        if read.record.error:
            return
        state = state_after(read.record)
        if state is PartState.TOUCH_NEEDED:
            state = PartState.REVIEW  # there is no stage to feel it any more
        name = read.listed.name
        key = IdempotencyKey(f"run {self._run} {name}", sha256(name.encode("utf-8", "replace")).hexdigest())
        text = cleaned(name)[:MAX_TEXT]
        # done already where the run was broken off between the store and its table
        with contextlib.suppress(AlreadyDoneError):
            self._store.add_part(
                part_id=new_part_id(),
                name=text,
                state=state,
                readings=(replace(read.record, part=text),),
                evidence=self._kept(read.pictures),
                expected=read.listed.expected,
                database=read.record.database,
                idempotency=key,
            )

    def _kept(self, pictures: tuple[Picture, ...]) -> tuple[EvidenceRecord, ...]:
        if self._folder is None:
            return ()
        from pipeline.common.records import EvidenceRecord

        kept = []
        for picture in pictures:
            digest, n_bytes = self._folder.keep_content(picture.content)
            kept.append(
                EvidenceRecord(
                    kind=picture.kind,
                    sha256=digest,
                    n_bytes=n_bytes,
                    name=picture.name,
                    media_type=picture.media_type,
                    meta=picture.meta,
                )
            )
        return tuple(kept)
