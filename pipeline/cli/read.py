"""Commands `tactile-marks read` and `inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import CommandError, UsageError, resumable
from pipeline.cli.settings import (
    MAPS,
    PARTS,
    READING,
    WORKERS,
    Config,
    JobPath,
    Maps,
    Parts,
    Reading,
    ReadingOfFile,
    Workers,
    with_flags,
)
from pipeline.runs.options import RunOptions

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings

_RUN = RunOptions()


def read(
    *inputs: str,
    run: Annotated[RunOptions, Parameter(name="*")] = _RUN,
    workers: Workers = WORKERS,
    reading: Reading = READING,
    job: JobPath = None,
    config: Config = None,
) -> int:
    """Read the serials of parts: height maps, scans and photographs, folders, globs and manifests of them.

    With --out rows are written as parts are read: an interrupted run continues with the same command. The exit status
    is 1 if any part could not be read, and with --verify unless every part is confirmed.

    Args:
        inputs: Height maps (.npz, .x3p, .sdf, .sur ...), scans (.h5) and photographs (.png, .jpg ...), or folders and
            globs of them, with their subfolders; files that differ only in their endings are one part. URLs (s3://,
            gs:// ...) with the extra cluster, and manifests.
    """
    if not (inputs or run.manifest):
        raise UsageError("read: name a height map, a scan, a photograph, a folder, a glob or a manifest")
    with resumable(run.out), workers.opened(limit_s=reading.limit_s) as executor:
        from pipeline.runs.production import run_batch

        return run_batch(inputs, reading, run, executor)


def inspect(
    file: Path,
    /,
    *,
    out: Path | None = None,
    parts: Parts = PARTS,
    maps: Maps = MAPS,
    reading: ReadingOfFile = READING,
    job: JobPath = None,
    config: Config = None,
) -> None:
    """Draw how one part was read: heights, moments, edges, depth, slope, boxes and candidates.

    A photograph with the same name beside the file is also shown, if --mode is vision or fused.

    Args:
        file: A height map, a scan or a photograph.
        out: Picture to write, .png, .svg or .pdf (default: FILE-inspect.png in the working folder).
    """
    from pipeline.common.output_paths import PICTURES, check_writable
    from pipeline.workers.options import in_a_worker

    picture = out if out is not None else Path(f"{file.stem}-inspect.png")
    check_writable(picture, PICTURES)
    for line in in_a_worker(_draw, file, with_flags(reading, parts, maps), picture):
        print(line)
    print(f"wrote {picture}")


def _draw(file: Path, settings: ReadSettings, picture: Path) -> list[str]:
    from pipeline.plots.pictures import save_figure
    from pipeline.reading.part_job import PartJob, reading_of
    from pipeline.runs.production import parts_for
    from recognition.decide.picture import reading_figure

    parts = parts_for([str(file)], settings)
    if len(parts) > 1:
        raise CommandError(f"{file}: has {len(parts)} parts", hint="inspect draws one part: name its file")
    (part,) = parts
    reading = reading_of(PartJob(part, settings))
    save_figure(reading_figure(reading, title=part.name), picture)
    return [f"{part.name}: {reading}", *(f"  {message}" for message in reading.messages())]
