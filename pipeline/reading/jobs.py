"""What a worker process of the service does: read one part from its files. Arguments and results can be pickled.

photo                    -> vision           and a plan for touch where the camera is unsure
scan or height map       -> tactile
photo + scan (map)       -> vision, fused
sight + scan (map)       -> fused            sight: what the camera's reader believed, kept by an earlier job

Whatever is wrong with a file is a `FileError` that calls the file as its sender did: paths of the server are
nobody's business.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from pipeline.common.records import EvidenceKind, ReadingRecord, ScanPlanRecord

if TYPE_CHECKING:
    pass

_log = logging.getLogger(__name__)
_FIELDS = {"photo": "photo", "scan": "scan", "height_map": "height map", "vision": "vision"}


@dataclass(frozen=True)
class Limits:
    """What a job may ask of the machine.

    Attributes:
        max_photo_pixels: of a photograph.
        max_map_samples: of a height map.
        max_scan_samples: of a recording, instants times channels.
        stage_field_mm: width and height that the stage can feel, where a photograph has no scale.
    """

    max_photo_pixels: int = 40_000_000
    max_map_samples: int = 30_000_000
    max_scan_samples: int = 60_000_000
    stage_field_mm: tuple[float, float] = (60.0, 25.0)


@dataclass(frozen=True)
class Job:
    """One part to be read.

    Attributes:
        folder: for the files that are made; it is there, and the job's own.
        photo: photograph.
        scan: recording (HDF5).
        height_map: surface; its format is told by the suffix of its name.
        vision: what an earlier job kept of the camera's reading (`pipeline.reading.vision_file`).
        part_name: what the line calls the part.
        expected: text it should read; empty where none is.
        database: glyph database to read with; the settings' unless given.
        names: of "photo", "scan" and "height_map", what their sender calls them; their paths' own unless given.
    """

    folder: Path
    photo: Path | None = None
    scan: Path | None = None
    height_map: Path | None = None
    vision: Path | None = None
    part_name: str = ""
    expected: str = ""
    database: Path | None = None
    names: Mapping[str, str] = field(default_factory=dict)

    def name_of(self, what: str) -> str:
        """The sender's name of a file, for messages: never a path of the server."""
        path: Path | None = getattr(self, what)
        given = self.names.get(what, "") or (path.name if path is not None else "")
        # a name is shown, not opened: its last part is enough, and no more than a line
        last = given.replace("\\", "/").rpartition("/")[2]
        return "".join(c for c in last if c.isprintable())[:120] or _FIELDS[what]


@dataclass(frozen=True)
class MadeFile:
    """A file made for a part, in the job's folder.

    Attributes:
        kind: what it is.
        path: where.
        media_type: for the browser.
        meta: of pictures, as `EvidenceRecord.meta`.
    """

    kind: EvidenceKind
    path: Path
    media_type: str
    meta: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Done:
    """What became of a job.

    Attributes:
        readings: in the order they were made; the last one counts.
        made: files to be kept.
        plan: what to feel; None where touch is not needed.
    """

    readings: tuple[ReadingRecord, ...]
    made: tuple[MadeFile, ...] = ()
    plan: ScanPlanRecord | None = None


@contextlib.contextmanager
def named_problems(job: Job, what: str, path: Path | None) -> Iterator[None]:
    """Turn whatever goes wrong with a file into a problem of the name that its sender gave it.

    Raises:
        FileError: anything did.
    """
    name = job.name_of(what) if what in _FIELDS else (path.stem if path is not None else what)
    try:
        yield
    except MemoryError as error:
        raise FileError(name, "needs more memory than a job may have", "crop or thin it") from error
    except MarksError as error:
        hint = _unplaced(error.hint, job, path) or "send another"
        raise FileError(name, _unplaced(error.what, job, path), hint) from error
    except Exception as error:
        _log.exception("fault of the program while reading %s", what)
        fault = f"{type(error).__name__}: {_one_line(error)}"
        raise FileError(
            name, f"met a fault of the program ({_unplaced(fault, job, path)[:200]})", "report it"
        ) from error


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _unplaced(message: str, job: Job, path: Path | None) -> str:
    """The message without the folders of the server."""
    for folder in (path.parent if path is not None else None, job.folder):
        if folder is not None and len(str(folder)) > 1:
            message = message.replace(f"{folder.resolve()}/", "").replace(f"{folder}/", "")
    return message
