"""Read one part: the path of batch, service, study, enrolment check, `inspect`, `pipeline.read` and cluster.

    PartJob --reader, files--> Reading --record, pictures, plan--> ReadPart

| call         | for                                              | files that cannot be used             |
|--------------|--------------------------------------------------|---------------------------------------|
| `reading_of` | study, enrolment check, `inspect`, Python        | FileError                             |
| `read_listed`| batch, certification, cluster                    | a record with the error               |
| `read_sent`  | service; `read_on_stage` feels the part, too     | FileError with the sender's file name |

A problem with this machine (a glyph database, a full disk, too little memory) raises an `OwnFileError`: the sender
cannot fix it, and the same job may be read later. No message contains a path of the server.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from glyphs.errors import FileError, MarksError
from glyphs.signatures import lists_options
from pipeline.common.job_file import FILES, files_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.common.settings import Limits, ReadSettings, SettingsError
from pipeline.common.version import file_sha256, program_version
from pipeline.errors import FaultError, OwnFileError, describe_fault, require_file
from pipeline.formats.find_parts import kind_of_named, with_file
from pipeline.formats.part_files import PartFiles, key_and_kind, settings_of
from pipeline.reading.sender_names import sender_names
from pipeline.reading.triage import ReadPart, why_touch

if TYPE_CHECKING:
    from pipeline.reading.perturbation import Retake
    from recognition.active.active_reading import ActiveReading
    from recognition.decide.reading import Reading
    from recognition.reader import Reader
    from whisker_array.scan.session import SessionStage

Order = TypeVar("Order")
RECORDING = "scan.h5"  # that `read_on_stage` leaves in the job's folder
# for which a sense searches a part of the service by default, so that none holds a worker for longer
SENT_LIMIT_S = 60.0
_MOST_BYTES_SENT = 200_000_000


@dataclass(frozen=True)
class Wants:
    """What a job's caller wants beside the record."""

    pictures: Literal["", "all", "review"] = ""  # of every part, or of those to review
    measures: bool = False  # with a certificate they are returned anyway
    digest: bool = False
    # the camera's own reading before a fused one, and the plan for touch if the camera is unsure
    camera: bool = False


@dataclass(frozen=True)
class PartJob:
    """A part to read, with all that its reading depends on; without files, the job of many parts."""

    # their format and font override those of the settings
    files: PartFiles = field(default_factory=lambda: PartFiles("part"))
    settings: ReadSettings = field(default_factory=ReadSettings)
    expected: str = ""
    limits: Limits | None = None  # checked from the files' headers before anything is decoded
    wants: Wants = Wants()
    felt: ActiveReading | None = None  # reading of its scan, if it was read during active touch
    retake: Retake | None = None  # simulated second measurement, in place of the files' content
    all_senses: bool = False  # it is read by all senses that it has files for, whatever the settings' mode
    earlier: bool = False  # its photographs are those of an earlier job, whose reading and picture exist
    verify: bool = False  # texts are expected of all parts; the record of a part without one says so
    folder: Path = Path()  # for output files, of this job alone
    names: Mapping[str, str] = field(default_factory=dict)  # of files in messages (default: as in paths)
    # contents of files that the settings name, for machines without them
    sent: Mapping[str, bytes] | None = None

    @property
    def shown(self) -> dict[str, str]:
        return {file: self.names.get(file) or Path(file).name for file in self.files.files}

    def open_reader(self) -> Reader:
        """The reader of this job, cached by settings and content of the files that they name. Raises FileError: a file
        cannot be used. MarksError: settings contradict each other, or a font cannot be used."""
        from pipeline.reading.readers import reader_of

        settings = settings_of(with_local_files(self.settings, self.sent), self.files)
        return reader_of(settings, after_photo=settings.regions and self.earlier)


def reading_of(job: PartJob) -> Reading:
    """Read a part from its files. Raises FileError: a file cannot be used. MarksError: settings contradict each other,
    or a font or the expected text cannot be used."""
    return _read(job, job.open_reader())[0]


def read_part(job: PartJob, reader: Reader) -> ReadPart:
    """Read a part with its reader, and make all that the job wants. Raises FileError, VerifyError."""
    from pipeline.reading.as_record import reading_record
    from pipeline.reading.part_pictures import pictures_of
    from pipeline.reading.scan_plan import plan_of

    began_s = time.perf_counter()
    reading, digest = _read(job, reader)
    readings, seconds = [reading], [time.perf_counter() - began_s]
    vision = reading.trace.vision
    if job.wants.camera and not job.earlier and vision is not None:
        assert vision.evidence is not None
        seen = reader.decide(replace(vision.evidence, expected=job.expected.strip()))
        readings.insert(0, seen)
        seconds.insert(0, math.fsum(seen.seconds.values()))
    settings = settings_of(job.settings, job.files)
    done = ReadPart(
        tuple(
            reading_record(each, settings, reader.grammar, part=job.files.name, seconds=took_s)
            for each, took_s in zip(readings, seconds, strict=True)
        ),
        measures=reading.measures if job.wants.measures or settings.certificate is not None else {},
        sha256=digest,
    )
    if job.wants.pictures == "all" or (job.wants.pictures and done.state is not PartState.ACCEPTED):
        done = replace(done, pictures=pictures_of(reading, photo=not job.earlier))
    photo = reading.trace.photo
    if job.wants.camera and not job.files.felt and photo is not None and done.state is PartState.TOUCH_NEEDED:
        return replace(done, plan=plan_of(reading, photo, settings, reason=why_touch(done.record)))
    return done


def _read(job: PartJob, reader: Reader) -> tuple[Reading, str]:
    from pipeline.formats.remote import local_copies
    from pipeline.reading.part_reader import PartReader

    listed, mode = job.files, job.settings.mode
    if job.all_senses:
        mode = "fused" if listed.felt and listed.photo else "auto"
    unverified = job.verify and not job.expected
    notes = ("not verified: the table of expected texts has no such part",) if unverified else ()
    with local_copies(listed, photos=mode != "tactile") as files:
        parts = PartReader(reader, job.settings.model_copy(update={"mode": mode}), limits=job.limits)
        reading = parts.read(
            files, expected=job.expected.strip(), again=job.retake, felt=job.felt, notes=notes
        )
        if not job.wants.digest:
            return reading, ""
        texts = [*(file_sha256(Path(path)) for path in files.files), listed.format, listed.font]
        digest = sha256("\n".join((*texts, listed.expected)).encode("utf-8", "surrogatepass"))
        return reading, digest.hexdigest()


# ------------------------------------------------------------------------------------------------------- batch


def check_run(job: PartJob, _: None) -> None:
    """Open the reader of a run; this process keeps it for its first part. Errors as in `PartJob.open_reader`."""
    job.open_reader()


def read_listed(job: PartJob, files: PartFiles) -> ReadPart:
    """Read one part of a run; a part that cannot be read has a record with its error."""
    began_s = time.perf_counter()
    try:
        listed = replace(job, files=files, expected=files.expected)
        return read_part(listed, _reader_of_listed(listed))
    except MarksError as problem:
        error = str(problem) if problem.where else f"{_first_file(files)}: {problem}"
    # a fault of the program in one part must not end the run; the record names its kind
    except Exception as fault:
        error = f"{_first_file(files)}: {describe_fault(fault)}; please report it"
    failed = ReadingRecord.failed(files.name, error, seconds=round(time.perf_counter() - began_s, 4))
    return ReadPart((replace(failed, at=datetime.now(UTC), program=program_version()),))


def lost_part(files: PartFiles, error: Exception) -> ReadPart:
    """The result of a part that no worker could read."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return ReadPart((ReadingRecord.failed(files.name, f"{_first_file(files)}: {reason}; try it alone"),))


def _first_file(files: PartFiles) -> str:
    return files.files[0] if files.files else files.name


def _reader_of_listed(job: PartJob) -> Reader:
    try:
        return job.open_reader()
    except MarksError as error:
        named = job.files.format or job.files.font
        hint = "correct its format or font in the manifest" if named else "correct the settings"
        raise FileError(job.files.name, f"cannot be read with these settings ({error})", hint) from error


def files_to_send(settings: ReadSettings) -> dict[str, bytes]:
    """Contents of the files named in the settings, by name, for machines that may not have them. Raises FileError."""
    named = files_of(settings)
    for path in named:
        require_file(path, most_bytes=_MOST_BYTES_SENT)
    return {str(path): path.read_bytes() for path in named}


def with_local_files(settings: ReadSettings, sent: Mapping[str, bytes] | None) -> ReadSettings:
    """The settings with the paths of this machine's copies; unchanged if nothing was sent."""
    if not sent:
        return settings
    copies = {name: _copy(Path(name).name, content) for name, content in sent.items()}
    named = {name: path for name in FILES if (path := getattr(settings, name)) is not None}
    files = {name: copies.get(str(path), path) for name, path in named.items()}
    fonts = tuple(str(copies.get(str(Path(font)), font)) for font in settings.font)
    return settings.model_copy(update={**files, "font": fonts})


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    # removed when the process ends
    return tempfile.TemporaryDirectory(prefix="tactile-marks-")


@cache
def _copy(name: str, content: bytes) -> Path:
    """Write a file once, in a folder named by its hash; it keeps its name, which names fonts."""
    folder = Path(_folder().name) / sha256(content).hexdigest()[:32]
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return path


# ----------------------------------------------------------------------------------------------------- service


def read_sent(job: PartJob) -> ReadPart:
    """Read a part that was sent, by all senses that it has files for.

    photo                      -> vision           and a plan for touch if the camera is unsure
    scan or height map         -> tactile
    photo + scan (map)         -> vision, fused
    earlier photo + scan (map) -> fused            the photograph of an earlier job
    earlier photo + stage      -> fused            scanned pass by pass, see `read_on_stage`

    Raises FileError: a file that was sent, or the expected text, cannot be used. OwnFileError: a file of the settings,
    or this machine, cannot be used now. ValueError: no file to read, or an earlier photograph without touch.
    """
    if not job.files.felt and (job.earlier or not job.files.photo):
        raise ValueError(
            "a job has a photo, a scan or a height map; an earlier photo goes with one of the latter"
        )
    reader = _own_reader(job)
    with sender_names(job.folder, job.shown):
        return read_part(replace(job, all_senses=True, wants=Wants(pictures="all", camera=True)), reader)


def read_on_stage(job: PartJob, stage: SessionStage[Order], scan_order: Order) -> ReadPart:
    """Scan a part pass by pass until its serial is sure, save the recording, and read the part with it.

    If the stage fails on the way, the part is read from the passes before, and goes to review. The recording is
    `RECORDING` in the job's folder. Raises StageError: not even one pass could be scanned. FileError: as in
    `read_sent`.
    """
    from recognition.active.felt_log import read_and_log
    from whisker_array.scan.recording import save_scan
    from whisker_array.scan.stage_error import StageError

    reader = _own_reader(job)
    session = stage.open(scan_order)
    try:
        felt = read_and_log(reader.touch, session, budget_s=job.settings.budget_s)
    finally:
        session.close()
    if felt.scan is None:
        raise StageError(felt.problem or "the stage has scanned nothing")
    recording = job.folder / RECORDING
    with sender_names(job.folder, {str(recording): RECORDING}):
        save_scan(felt.scan, recording)
    return read_sent(replace(job, files=replace(job.files, scan=str(recording)), felt=felt))


def check_settings(settings: ReadSettings) -> None:
    """Open the reader of these settings, to find errors before the next part. Raises OwnFileError."""
    _own_reader(PartJob(settings=settings))


def _own_reader(job: PartJob) -> Reader:
    """A reader with the service's time limit; all its files are ours. Raises OwnFileError: it cannot be opened."""
    if job.settings.limit_s is None:
        job = replace(job, settings=job.settings.model_copy(update={"limit_s": SENT_LIMIT_S}))
    try:
        with sender_names(job.folder, {str(path): path.name for path in files_of(job.settings)}):
            return job.open_reader()
    except FaultError:
        raise
    except FileError as error:
        raise OwnFileError(error.path, error.what, error.hint) from error


# ------------------------------------------------------------------------------------------------------ Python


@lists_options(ReadSettings, {*ReadSettings.model_fields} - {"font"})
def read(
    file: str | Path,
    /,
    *more: str | Path,
    fonts: str | Sequence[str] = (),
    expected: str = "",
    **settings: Any,
) -> Reading:
    """Read one part from its height map, scan or photograph, or from several of these.

    Example::

        reading = pipeline.read("part.npz", fonts="gothic", format="AA999999")

    Soil in an `.npz` is used. Several files are all read: touch and a photograph are fused. Readers and their
    templates are cached for the next call with the same settings.

    Args:
        file: a file of the part.
        more: further files of the same part, at most one of each kind.
        fonts: built-in fonts, or font files, whose shapes the marks are compared with; one may be a string.
        expected: expected text of the part; the verdict is `reading.trace.verification`.
        settings: fields of `ReadSettings`, such as format, height_mm, mode.

    Raises:
        FileError: a file cannot be used, or there are two of a kind.
        SettingsError: an unknown or invalid setting.
        MarksError: a font or the expected text cannot be used.
    """
    if "font" in settings:
        raise SettingsError("unknown setting font", hint="did you mean fonts?")
    checked = ReadSettings.of(font=fonts, **settings)
    part, kinds = PartFiles(Path(file).stem), dict[str, Path]()
    for path in map(Path, (file, *more)):
        kind = key_and_kind(str(path), height_images=checked.height_image)[1] or kind_of_named(str(path))
        if kind in kinds:
            raise FileError(
                path, f"is a second {kind.replace('_', ' ')} beside {kinds[kind]}", "read one at a time"
            )
        kinds[kind], part = path, with_file(part, kind, str(path))
    return reading_of(PartJob(part, checked, expected))
