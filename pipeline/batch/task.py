"""What a worker does with one part of a run. Order, part and answer are words and can be sent anywhere."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from pipeline.common.records import EvidenceKind, ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.files.listed import ListedPart
from pipeline.reading.as_record import record_of_part

if TYPE_CHECKING:
    from pipeline.reading.jobs import MadeFile
    from pipeline.reading.part_reader import Sense, Sensed
    from pipeline.reading.readers import Readers
    from recognition.grammar import Grammar

MOST_READERS = 16
"""Fonts and formats that a worker keeps readers of; a manifest may name any number."""


@dataclass(frozen=True)
class RunOrder:
    """How the parts of a run are read.

    Attributes:
        settings: of reading; a part's own format and font go before theirs.
        verify: whether texts are expected; of a part without one its row then says so.
        pictures: whether pictures of parts that a person is to review are wanted.
        sent: contents of files that the settings name, for machines that lack them (`pipeline.batch.setting_files`).
    """

    settings: ReadSettings
    verify: bool = False
    pictures: bool = False
    sent: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Picture:
    """A picture of a part, for a person who reviews it; the fields are those of `pipeline.reading.jobs.MadeFile`."""

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
    """

    listed: ListedPart
    record: ReadingRecord
    pictures: tuple[Picture, ...] = ()


def read_listed(order: RunOrder, listed: ListedPart) -> ReadPart:
    """Fetch a part's files and read it; a part that cannot be read has a record with its error."""
    file = listed.files[0] if listed.files else listed.name
    record, sensed = record_of_part(listed.name, file, lambda: _sensed(order, listed))
    if sensed is None or not order.pictures:
        return ReadPart(listed, record)
    from pipeline.common.records import PartState
    from pipeline.reading.triage import state_after

    accepted = state_after(record) is PartState.ACCEPTED
    return ReadPart(listed, record, () if accepted else _pictures(sensed))


def settings_of(settings: ReadSettings, listed: ListedPart) -> ReadSettings:
    """The settings that a part is read with: its own format and fonts go before the run's."""
    own: dict[str, tuple[str, ...]] = {}
    if listed.format:
        own["format"] = (listed.format,)
    if listed.font:
        own["font"] = tuple(name.strip() for name in listed.font.split(",") if name.strip())
    return settings.model_copy(update=own) if own else settings


def _sensed(order: RunOrder, listed: ListedPart) -> tuple[Sensed, ReadSettings, Grammar | None]:
    from glyphs.errors import MissingExtraError
    from pipeline.files.remote import fetched, originally
    from pipeline.reading.expected import Expected
    from pipeline.reading.part_reader import Mode, Senses, senses_of

    mode = Mode(order.settings.mode) if order.settings.mode is not None else None
    readers = _readers_for(order, listed, senses_of(listed, mode) if listed.problem is None else ())
    expected = Expected(listed.expected) if listed.expected or order.verify else None
    if listed.expected and readers.grammar is not None:
        broken = readers.grammar.objections(listed.expected)
        if broken:
            raise FileError(
                listed.name, f"should bear {listed.expected!r}, but {'; '.join(broken)}", "mend one"
            )
    try:
        with fetched(listed, photos=mode not in (None, Mode.TACTILE)) as part:
            sensed = Senses(readers, mode=mode, expected=expected).sense(part)
            notes = tuple(originally(note, part, listed) for note in sensed.reading.notes)
            sensed = replace(sensed, reading=replace(sensed.reading, notes=notes))
            return sensed, settings_of(order.settings, listed), readers.grammar
    except MissingExtraError as error:
        raise FileError(listed.name, str(error), "where its worker runs") from error


def _readers_for(order: RunOrder, listed: ListedPart, needed: Sequence[Sense]) -> Readers:
    """The readers of a part, opened for the senses that are needed.

    Raises:
        FileError: a font, format, database or lexicon that cannot be used.
    """
    from pipeline.batch.setting_files import settled
    from pipeline.reading.part_reader import Sense

    try:
        readers = _readers(settings_of(settled(order.settings, order.sent), listed))
        for sense in needed:
            _ = readers.touch if sense is Sense.TOUCH else readers.vision
        return readers
    except MarksError as error:
        own = listed.format or listed.font
        hint = "mend its format or font in the manifest" if own else "mend the settings"
        raise FileError(listed.name, f"cannot be read so ({error})", hint) from error


@lru_cache(maxsize=MOST_READERS)
def _readers(settings: ReadSettings) -> Readers:
    from pipeline.reading.readers import Readers

    return Readers(settings)


def _pictures(sensed: Sensed) -> tuple[Picture, ...]:
    """As the service keeps them of a part."""
    from pipeline.reading.job_pictures import edges_picture, photo_picture, vision_edges_picture

    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as name:
        folder = Path(name)
        made: list[MadeFile] = []
        if sensed.touch is not None:
            made += edges_picture(sensed.touch.edge_map, folder)
        if sensed.photo is not None:
            place = sensed.vision.place if sensed.vision is not None else None
            made.append(photo_picture(sensed.photo, folder))
            made += vision_edges_picture(sensed.photo, place.height_mm if place is not None else 0.0, folder)
        return tuple(
            Picture(m.kind, m.path.name, m.path.read_bytes(), m.media_type, dict(m.meta)) for m in made
        )
