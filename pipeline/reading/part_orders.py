"""Read one part from its files in a worker process of the service. Arguments and results can be pickled.

photo                    -> vision           and a plan for touch if the camera is unsure
scan or height map       -> tactile
photo + scan (map)       -> vision, fused
earlier photo + scan (map) -> fused          the photograph of an earlier order
earlier photo + stage      -> fused          scanned pass by pass, see `read_on_stage`

Several photographs of a part are read as one.

A problem with a file that was sent raises a `FileError` that names the file as its sender did. A problem with this
machine (a glyph database, a lexicon, a full disk, too little memory) raises an `OwnFileError`: the sender cannot fix
it, and the same order may be read later. Neither message contains a path of the server.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from glyphs.errors import FileError, MarksError
from pipeline.common.job_file import files_of
from pipeline.common.records import PartState
from pipeline.common.settings import Limits, ReadSettings
from pipeline.errors import FaultError, OwnFileError, describe_fault, is_machine_error, shown_as
from pipeline.formats.part_files import PartFiles
from pipeline.reading.triage import ReadPart, why_touch

if TYPE_CHECKING:
    from recognition.active.active_reading import ActiveReading
    from recognition.reader import Reader
    from whisker_array.scan.session import SessionStage

Order = TypeVar("Order")
RECORDING = "scan.h5"
"""Name of the recording that `read_on_stage` leaves in the order's folder."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PartOrder:
    """Order to read one part.

    Attributes:
        folder: folder for output files; it exists and belongs to this order alone.
        part: its files on this machine; an expected text is verified.
        earlier: its photographs are those of an earlier order, whose reading and picture exist.
        names: names of the files in messages, without folders (default: the names in their paths).
    """

    folder: Path
    part: PartFiles
    earlier: bool = False
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def shown(self) -> dict[str, str]:
        """All files, each with its name in messages: never a path of the server."""
        return {file: self.names.get(file) or Path(file).name for file in self.part.files}


def read_order(
    order: PartOrder, settings: ReadSettings, limits: Limits, *, felt: ActiveReading | None = None
) -> ReadPart:
    """Read a part.

    Args:
        order: its files.
        settings: settings of the reader; `mode` is ignored, a part is read by all senses that it has files for.
        limits: size limits, checked from the files' headers before anything is decoded.
        felt: reading of its scan, if it was read during active touch.

    Raises:
        FileError: a file that was sent, or the expected text, cannot be used.
        OwnFileError: a file of the settings, or this machine, cannot be used now.
        ValueError: the order has no file to read, or an earlier photograph without touch.
    """
    from pipeline.reading.as_record import reading_record
    from pipeline.reading.part_pictures import pictures_of
    from pipeline.reading.part_reader import PartReader
    from pipeline.reading.scan_plan import plan_of

    part, tactile = order.part, order.part.felt
    if not tactile and (order.earlier or not part.photo):
        raise ValueError(
            "an order has a photo, a scan or a height map; an earlier photo goes with one of the latter"
        )
    reader = _reader(settings, order.folder, after_photo=order.earlier)
    started, expected = time.perf_counter(), part.expected.strip()
    with sender_names(order.folder, order.shown):
        mode = "fused" if tactile and part.photo else "auto"
        parts = PartReader(reader, settings.model_copy(update={"mode": mode}), limits=limits)
        found = parts.read(part, expected=expected, felt=felt)
        readings = [found]
        new_photo = bool(part.photo) and not order.earlier
        if new_photo and found.trace.vision is not None:
            evidence = found.trace.vision.evidence
            assert evidence is not None
            readings.insert(0, reader.decide(replace(evidence, expected=expected)))
        took = [math.fsum(r.seconds.values()) for r in readings[:-1]] + [time.perf_counter() - started]
        records = tuple(
            reading_record(r, settings, reader.grammar, part=part.name, seconds=s)
            for r, s in zip(readings, took, strict=True)
        )
        done = ReadPart(
            records,
            pictures_of(readings[-1], photo=new_photo),
            measures=found.measures if settings.certificate is not None else {},
        )
        taken = found.trace.photo
        if tactile or taken is None or done.state is not PartState.TOUCH_NEEDED:
            return done
        plan = plan_of(found, taken, settings, reason=why_touch(records[-1]))
        return replace(done, plan=plan)


def read_on_stage(
    order: PartOrder,
    settings: ReadSettings,
    limits: Limits,
    stage: SessionStage[Order],
    scan_order: Order,
) -> ReadPart:
    """Scan a part pass by pass until its serial is sure, save the recording, and read the part with it.

    If the stage fails on the way, the part is read from the passes before, and goes to review. The recording is
    `RECORDING` in the order's folder.

    Args:
        order: the part's other files; a scan is ignored.
        settings: as in `read_order`; `budget_s` limits the stage time.
        limits: likewise.
        stage: opens a session.
        scan_order: order for which the session is opened.

    Raises:
        StageError: not even one pass could be scanned.
        FileError: as in `read_order`.
    """
    from recognition.active.replay import read_kept
    from whisker_array.scan.recording import save_scan
    from whisker_array.scan.stage_error import StageError

    reader = _reader(settings, order.folder, after_photo=order.earlier)
    session = stage.open(scan_order)
    try:
        felt = read_kept(reader.touch, session, budget_s=settings.budget_s)
    finally:
        session.close()
    if felt.scan is None:
        raise StageError(felt.problem or "the stage has scanned nothing")
    recording = order.folder / RECORDING
    with sender_names(order.folder, {str(recording): RECORDING}):
        save_scan(felt.scan, recording)
    felt_part = replace(order.part, scan=str(recording))
    return read_order(replace(order, part=felt_part), settings, limits, felt=felt)


def check_settings(settings: ReadSettings) -> None:
    """Open the reader of these settings, to find errors before the next order.

    Raises:
        OwnFileError: a file that they name cannot be used.
    """
    _reader(settings, Path())


def _reader(settings: ReadSettings, folder: Path, *, after_photo: bool = False) -> Reader:
    """The reader for the settings; for a part that was photographed earlier, it searches the whole scan.

    Raises:
        OwnFileError: it cannot be opened; all its files are the service's own.
    """
    from pipeline.reading.readers import reader_of

    try:
        with sender_names(folder, {str(path): path.name for path in files_of(settings)}):
            return reader_of(settings, after_photo=settings.regions and after_photo)
    except FaultError:
        raise
    except FileError as error:
        raise OwnFileError(error.path, error.what, error.hint) from error


@contextlib.contextmanager
def sender_names(folder: Path, names: Mapping[str, str]) -> Iterator[None]:
    """Turn every problem into a file error with the sender's name for the file.

    Args:
        folder: folder whose path is removed from the messages.
        names: names of the files by path; the first is used if an error names no file.

    Raises:
        FileError: a problem with one of the files.
        OwnFileError: a problem with this machine, or with any other file.
        FaultError: a fault of this program.
    """
    from recognition.decide.verify import VerifyError

    def without_folders(message: str) -> str:
        for one in (*(Path(path).parent for path in names), folder):
            if len(str(one)) > 1:
                message = message.replace(f"{one.resolve()}/", "").replace(f"{one}/", "")
        return message

    name = next(iter(names.values()), "part")
    try:
        with shown_as(names):
            yield
    except VerifyError as error:
        raise FileError("expected", error.what, error.hint) from error
    except FileError as error:
        kind = OwnFileError if error.path.is_absolute() or is_machine_error(error) else FileError
        raise kind(error.path.name, without_folders(error.what), error.hint) from error
    except MarksError as error:
        raise FileError(name, without_folders(error.what), error.hint) from error
    except MemoryError as error:
        raise OwnFileError(name, "needs more memory than a worker may have", "crop or thin it") from error
    except OSError as error:
        what = without_folders(f"cannot be read ({error.strerror or error})")
        raise OwnFileError(name, what, "check the disk") from error
    except Exception as error:
        _log.exception("fault of the program while reading %s", name)
        raise FaultError(name, without_folders(describe_fault(error)), "please report it") from error
