"""`tactile-marks inspect`: one part as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import FAILED, CommandError, failures_reported
from pipeline.cli.settings import READING, Config, Reading

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.formats.part_files import PartFiles
    from recognition.decision import reading as readings


def inspect(
    file: Path,
    *,
    out: Path | None = None,
    reading: Reading = READING,
    config: Config = None,
) -> int:
    """Draw how one part was read: heights, moments, edges, depth, slope, boxes and candidates.

    A photograph beside the file with the same name is shown, too, whether or not it is read.

    Parameters
    ----------
    file
        A height map, a scan or a photograph.
    out
        Picture to write, .png, .svg or .pdf; FILE-inspect.png in the working folder unless given.
    """
    with failures_reported():
        from pipeline.plots.pictures import check_picture
        from pipeline.workers.options import in_a_worker

        picture = out if out is not None else Path(f"{file.stem}-inspect.png")
        check_picture(picture)
        for line in in_a_worker(drawn, file, reading, picture):
            print(line)
    print(f"wrote {picture}")
    return 0


def drawn(file: Path, settings: ReadSettings, picture: Path) -> list[str]:
    """Read a file and draw what was read; lines that say what that is.

    Raises:
        FileError: a file that cannot be used.
        CommandError: it holds several parts.
    """
    from pipeline.formats.find_parts import discover
    from pipeline.plots.pictures import save_figure
    from pipeline.reading.part_reader import Mode, PartReader
    from pipeline.reading.readers import open_reader
    from recognition.decision.picture import reading_figure

    parts = discover([file], beside=True, height_images=settings.height_image)
    if len(parts) > 1:
        raise CommandError(
            f"{file}: holds {len(parts)} parts", hint="inspect draws one, name its file", status=FAILED
        )
    (part,) = parts
    mode = Mode(settings.mode) if settings.mode else None
    found = PartReader(
        open_reader(settings), mode=mode, maps=settings, budget_s=settings.touch_budget_s
    ).read(part)
    shown, problem = _with_photo(found, part)
    save_figure(reading_figure(shown, title=part.name), picture)
    return [*problem, f"{part.name}: {found}", *(f"  {message}" for message in found.messages())]


def _with_photo(reading: readings.Reading, part: PartFiles) -> tuple[readings.Reading, list[str]]:
    """The part with its photograph to be shown; without one that cannot be used, which nobody asked for, and why."""
    from glyphs.errors import FileError
    from pipeline.reading.part_reader import load_photo
    from recognition.reader import centre_on

    if reading.trace.photo is not None or not part.photo:
        return reading, []
    try:
        photo = load_photo(part)
    except FileError as problem:
        return reading, [f"  not shown: {problem}"]
    surface = None if reading.touch is None else reading.touch.trace.height_map
    return reading.with_trace(photo=photo if surface is None else centre_on(photo, surface)), []
