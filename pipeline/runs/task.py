"""Reading of one part of a run by a worker. Order, part and answer are plain data that any worker can receive."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind
from pipeline.common.settings import ReadSettings
from pipeline.common.version import file_sha256
from pipeline.formats.part_files import PartFiles, settings_of
from pipeline.reading.as_record import record_of_part
from pipeline.runs.setting_files import settled

if TYPE_CHECKING:
    from recognition.decision.evidence import Measure
    from recognition.decision.reading import Reading
    from recognition.language.grammar import Grammar
    from recognition.reader import Reader


@dataclass(frozen=True)
class RunOrder:
    """Order to read the parts of a run.

    Attributes:
        settings: settings of reading; a part's own format and font override them.
        verify: whether texts are expected; the row of a part without one then says so.
        pictures: whether to make pictures of the parts to review.
        digests: whether to hash the contents of the parts' files.
        measures: whether to return measures of the parts.
        sent: contents of files that the settings name, for workers on machines of their own; see
            `pipeline.runs.setting_files`.
    """

    settings: ReadSettings
    verify: bool = False
    pictures: bool = False
    digests: bool = False
    measures: bool = False
    sent: Mapping[str, bytes] | None = None


@dataclass(frozen=True)
class Picture:
    """A picture of a part for its review: a `MadeFile` of `pipeline.reading` with its content."""

    kind: EvidenceKind
    name: str
    content: bytes
    media_type: str
    meta: Mapping[str, float]


@dataclass(frozen=True)
class ReadPart:
    """A part as it was read.

    Attributes:
        listed: as it was listed.
        record: of its reading, or of why there is none.
        pictures: where they are wanted.
        measures: where they are wanted, and the part could be read.
        sha256: of what its files hold and what its list says of it, likewise.
    """

    listed: PartFiles
    record: ReadingRecord
    pictures: tuple[Picture, ...] = ()
    measures: Mapping[Measure, float] = field(default_factory=dict)
    sha256: str = ""


def check_order(order: RunOrder, _: None) -> None:
    """Open the reader of a run's settings, which this process keeps for its first part.

    Raises:
        FileError: a lexicon or certificate that cannot be used.
        SettingsError: settings that contradict each other.
        ValueError: a font or database that cannot be used.
    """
    from pipeline.reading.readers import reader_of

    reader_of(settled(order.settings, order.sent))


def read_listed(order: RunOrder, listed: PartFiles) -> ReadPart:
    """Fetch a part's files and read it; a part that cannot be read has a record with its error."""
    file = listed.files[0] if listed.files else listed.name
    digests: list[str] = []
    record, reading = record_of_part(listed.name, file, lambda: _read(order, listed, digests))
    read = ReadPart(listed, record, sha256=_joined(digests) if order.digests else "")
    if reading is not None and order.measures:
        from recognition.decision.evidence import measures_of

        read = replace(read, measures=measures_of(reading))
    if reading is None or not order.pictures:
        return read
    from pipeline.common.records import PartState
    from pipeline.reading.triage import state_after

    accepted = state_after(record) is PartState.ACCEPTED
    return read if accepted else replace(read, pictures=_pictures(reading))


def lost_part(listed: PartFiles, error: Exception) -> ReadPart:
    """A part that no worker has read, with the reason."""
    file = listed.files[0] if listed.files else listed.name
    reason = " ".join(str(error).split()) or type(error).__name__
    return ReadPart(listed, ReadingRecord.failed(listed.name, f"{file}: {reason}; try it alone"))


def _read(
    order: RunOrder, listed: PartFiles, digests: list[str]
) -> tuple[Reading, ReadSettings, Grammar | None]:
    from glyphs.errors import MissingExtraError
    from pipeline.formats.remote import fetched
    from pipeline.reading.part_reader import Mode, PartReader

    mode = Mode(order.settings.mode) if order.settings.mode is not None else None
    reader = _reader_for(order, listed)
    try:
        with fetched(listed, photos=mode not in (None, Mode.TACTILE)) as part:
            parts = PartReader(reader, mode=mode, maps=order.settings, budget_s=order.settings.touch_budget_s)
            reading = parts.read(part, expected=listed.expected)
            if order.digests:
                digests += [file_sha256(Path(path)) for path in part.files]
                digests += [listed.format, listed.font, listed.expected]
            if order.verify and not listed.expected:
                note = "not verified: the table of expected texts has no such part"
                reading = replace(reading, notes=(*reading.notes, note))
            return reading, settings_of(order.settings, listed), reader.grammar
    except MissingExtraError as error:
        raise FileError(listed.name, str(error), "where its worker runs") from error


def _joined(texts: list[str]) -> str:
    return sha256("\n".join(texts).encode("utf-8", "surrogatepass")).hexdigest()


def _reader_for(order: RunOrder, listed: PartFiles) -> Reader:
    """The reader of a part.

    Raises:
        FileError: a font, format, database or lexicon that cannot be used.
    """
    from pipeline.reading.readers import reader_of

    try:
        return reader_of(settings_of(settled(order.settings, order.sent), listed))
    except MarksError as error:
        own = listed.format or listed.font
        hint = "correct its format or font in the manifest" if own else "correct the settings"
        raise FileError(listed.name, f"cannot be read with these settings ({error})", hint) from error


def _pictures(reading: Reading) -> tuple[Picture, ...]:
    """Pictures of a part, as the service keeps them."""
    from pipeline.reading.part_pictures import pictures_of

    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as name:
        return tuple(
            Picture(m.kind, m.path.name, m.path.read_bytes(), m.media_type, dict(m.meta))
            for m in pictures_of(reading, Path(name))
        )
