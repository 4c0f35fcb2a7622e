"""Read one part of a run in a worker. Order, part and result are plain data for any worker."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.common.settings import ReadSettings
from pipeline.common.version import file_sha256, program_version
from pipeline.errors import describe_fault
from pipeline.formats.part_files import PartFiles, settings_of
from pipeline.reading.triage import ReadPart
from pipeline.runs.setting_files import with_local_files

if TYPE_CHECKING:
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
        sent: contents of files that the settings name, for workers on other machines; see
            `pipeline.runs.setting_files`.
    """

    settings: ReadSettings
    verify: bool = False
    pictures: bool = False
    digests: bool = False
    measures: bool = False
    sent: Mapping[str, bytes] | None = None


def check_order(order: RunOrder, _: None) -> None:
    """Open the reader of a run's settings; this process keeps it for its first part.

    Raises:
        FileError: the lexicon or certificate cannot be used.
        SettingsError: settings contradict each other.
        ValueError: a font or the database cannot be used.
    """
    from pipeline.reading.readers import reader_of

    reader_of(with_local_files(order.settings, order.sent))


def read_listed(order: RunOrder, listed: PartFiles) -> ReadPart:
    """Fetch a part's files and read it; a part that cannot be read has a record with its error."""
    started = time.perf_counter()
    try:
        return _read(order, listed, started)
    except MarksError as problem:
        error = str(problem) if problem.where else f"{_file_of(listed)}: {problem}"
    # a fault of the program in one part must not end the run; the record names its kind
    except Exception as fault:
        error = f"{_file_of(listed)}: {describe_fault(fault)}; please report it"
    failed = ReadingRecord.failed(listed.name, error, seconds=round(time.perf_counter() - started, 4))
    return ReadPart((replace(failed, at=datetime.now(UTC), program=program_version()),))


def lost_part(listed: PartFiles, error: Exception) -> ReadPart:
    """The result of a part that no worker could read, with the reason."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return ReadPart((ReadingRecord.failed(listed.name, f"{_file_of(listed)}: {reason}; try it alone"),))


def _file_of(listed: PartFiles) -> str:
    return listed.files[0] if listed.files else listed.name


def _read(order: RunOrder, listed: PartFiles, started: float) -> ReadPart:
    from pipeline.formats.remote import local_copies
    from pipeline.reading.as_record import reading_record
    from pipeline.reading.part_pictures import pictures_of
    from pipeline.reading.part_reader import PartReader

    settings, digest = order.settings, ""
    reader = _reader_for(order, listed)
    with local_copies(listed, photos=settings.mode != "tactile") as part:
        unverified = order.verify and not listed.expected
        notes = ("not verified: the table of expected texts has no such part",) if unverified else ()
        reading = PartReader(reader, settings).read(part, expected=listed.expected, notes=notes)
        if order.digests:
            texts = [*(file_sha256(Path(path)) for path in part.files), listed.format, listed.font]
            digest = sha256("\n".join((*texts, listed.expected)).encode("utf-8", "surrogatepass")).hexdigest()
    record = reading_record(
        reading,
        settings_of(settings, listed),
        reader.grammar,
        part=listed.name,
        seconds=time.perf_counter() - started,
    )
    measures = reading.measures if order.measures else {}
    read = ReadPart((record,), measures=measures, sha256=digest)
    shown = order.pictures and read.state is not PartState.ACCEPTED
    return replace(read, pictures=pictures_of(reading)) if shown else read


def _reader_for(order: RunOrder, listed: PartFiles) -> Reader:
    """The reader of a part.

    Raises:
        FileError: a font, format, database or lexicon cannot be used.
    """
    from pipeline.reading.readers import reader_of

    try:
        return reader_of(settings_of(with_local_files(order.settings, order.sent), listed))
    except MarksError as error:
        own = listed.format or listed.font
        hint = "correct its format or font in the manifest" if own else "correct the settings"
        raise FileError(listed.name, f"cannot be read with these settings ({error})", hint) from error
