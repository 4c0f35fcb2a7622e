"""A run's parts put into the service's store, where they are found, and reviewed, with those that came by the line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from pipeline.runs.task import Picture, ReadPart

if TYPE_CHECKING:
    from pipeline.common.records import EvidenceRecord

_SCHEMES = ("sqlite:///", "postgresql://")


def is_store(name: str) -> bool:
    """Whether an output is a store's URL."""
    return name.startswith(_SCHEMES) or name.startswith("postgresql+")


class RunStore:
    """A store that takes each part of a run once, however often the same run is repeated.

    A part is identified by the run, its name and the content of its files. The store keeps its key as long as the part.
    """

    def __init__(self, url: str, run: str, *, evidence: Path | None = None) -> None:
        """Open the store.

        Args:
            url: URL of the store.
            run: identity of the run: a hash of all that its readings depend on.
            evidence: the service's folder of files; without it no pictures are kept.

        Raises:
            StoreError: the store cannot be opened.
            FileError: a folder cannot be made.
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

    def add(self, read: ReadPart) -> bool:
        """Store a part, and return whether it is new; a part that could not be read is skipped.

        Raises:
            StoreError: the database does not answer.
            ValueError: a text that no store can hold.
            FileError: a picture cannot be kept.
        """
        from pipeline.common.part_id import new_part_id
        from pipeline.common.records import PartState
        from pipeline.reading.triage import state_after
        from pipeline.store.errors import MAX_TEXT, AlreadyDoneError, cleaned
        from pipeline.store.parts import IdempotencyKey

        if read.record.error:
            return True
        state = state_after(read.record)
        if state is PartState.TOUCH_NEEDED:
            state = PartState.REVIEW  # there is no stage to feel it any more
        name = read.listed.name
        text = cleaned(name)[:MAX_TEXT]
        try:
            self._store.add_part(
                part_id=new_part_id(),
                name=text,
                state=state,
                readings=(replace(read.record, part=text),),
                evidence=self._kept(read.pictures),
                expected=read.listed.expected,
                database=read.record.database,
                idempotency=IdempotencyKey.of_run(self._run, name, read.sha256),
            )
        except AlreadyDoneError:
            return False
        return True

    def _kept(self, pictures: tuple[Picture, ...]) -> tuple[EvidenceRecord, ...]:
        from pipeline.common.records import EvidenceRecord

        kept: list[EvidenceRecord] = []
        if self._folder is None:
            return ()
        for one in pictures:
            digest, n_bytes = self._folder.keep_content(one.content)
            kept.append(EvidenceRecord(one.kind, digest, n_bytes, one.name, one.media_type, meta=one.meta))
        return tuple(kept)
