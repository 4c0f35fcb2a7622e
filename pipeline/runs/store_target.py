"""Put a run's parts into the service's store, to be searched and reviewed with those of the line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import MissingExtraError
from pipeline.common.part_id import new_part_id
from pipeline.common.records import EvidenceRecord, PartState

if TYPE_CHECKING:
    from pipeline.common.reading_records import ReadingRecord
    from pipeline.common.serial_rules import Objection
    from pipeline.formats.part_files import PartFiles
    from pipeline.reading.part_pictures import Picture
    from pipeline.reading.triage import ReadPart

_SCHEMES = ("sqlite:///", "postgresql://", "postgresql+")


def is_store(name: str) -> bool:
    """Whether an output is a store's URL."""
    return name.startswith(_SCHEMES)


class RunStore:
    """A store that stores each part of a run once, even if the run is repeated.

    A part's key is made from the run, its name and the content of its files; the store keeps it as long as the part.
    """

    def __init__(self, url: str, run: str, *, evidence: Path | None = None) -> None:
        """Open the store.

        Args:
            url: URL of the store.
            run: identity of the run: a hash of everything that its readings depend on.
            evidence: the service's folder of files; without it no pictures are kept.

        Raises:
            StoreError: the store cannot be opened.
            FileError: a folder cannot be made.
            MissingExtraError: the extra `service` is not installed.
        """
        try:
            from pipeline.store.evidence_folder import EvidenceFolder
            from pipeline.store.store import Store
        except ModuleNotFoundError as error:
            raise MissingExtraError("a store", error.name or "sqlalchemy", "service") from error
        self._run = run
        self._folder = EvidenceFolder(evidence) if evidence is not None else None
        self._store = Store.open(url)

    def close(self) -> None:
        """Close the store."""
        self._store.close()

    def add(self, part: PartFiles, read: ReadPart) -> bool:
        """Store a part, and return whether it is new; a part that could not be read is skipped.

        Raises:
            StoreError: the database does not answer.
            ValueError: a text that no store can hold.
            FileError: a picture cannot be kept.
        """
        from pipeline.store.errors import MAX_TEXT, AlreadyDoneError, cleaned
        from pipeline.store.parts import IdempotencyKey

        if read.record.error:
            return True
        accepted = read.state is PartState.ACCEPTED
        text = cleaned(part.name)[:MAX_TEXT]
        try:
            self._store.add_part(
                part_id=new_part_id(),
                name=text,
                # no stage can scan it any more
                state=PartState.ACCEPTED if accepted else PartState.REVIEW,
                readings=(replace(read.record, part=text),),
                evidence=self._keep_pictures(read.pictures),
                expected=part.expected,
                database=read.record.database,
                idempotency=IdempotencyKey.of_run(self._run, part.name, read.sha256),
            )
        except AlreadyDoneError:
            return False
        return True

    def send_to_review(self, record: ReadingRecord, objection: Objection) -> None:
        """Send a stored part to review, unless a person has reviewed it.

        Raises:
            StoreError: the database does not answer.
        """
        from pipeline.store.errors import MAX_TEXT, cleaned

        name = cleaned(record.part)[:MAX_TEXT]
        self._store.send_to_review(name=name, text=cleaned(record.text), objection=objection)

    def _keep_pictures(self, pictures: Sequence[Picture]) -> list[EvidenceRecord]:
        if (folder := self._folder) is None:
            return []
        return [
            EvidenceRecord(
                one.kind, *folder.keep_content(one.content), one.name, one.media_type, meta=one.meta
            )
            for one in pictures
        ]
