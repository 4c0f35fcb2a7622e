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
    """A store that takes the parts of a run, each once however often and whenever the same run is given again.

    A part is known by the run, its name and what its files hold. Its key is kept in the store for as long as the part.
    """

    def __init__(self, url: str, run: str, *, evidence: Path | None = None) -> None:
        """Open it.

        Args:
            url: of the store.
            run: by which the same run is known again: a hash of what its readings depend on.
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

    def add(self, read: ReadPart) -> bool:
        """Keep a part, and say whether it is new; one that could not be read is passed over.

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
