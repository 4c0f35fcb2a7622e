"""Read a part from any of its files in one call."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.errors import FileError
from glyphs.signatures import lists_options
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.find_parts import kind_of_named, with_file
from pipeline.formats.part_files import PartFiles, key_and_kind

if TYPE_CHECKING:
    from recognition.decide.reading import Reading


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
    from pipeline.reading.part_reader import PartReader
    from pipeline.reading.readers import reader_of

    if "font" in settings:
        raise SettingsError("unknown setting font", hint="did you mean fonts?")
    checked = ReadSettings.of(font=fonts, **settings)
    part, files = PartFiles(Path(file).stem), dict[str, Path]()
    for path in map(Path, (file, *more)):
        kind = key_and_kind(str(path), height_images=checked.height_image)[1] or kind_of_named(str(path))
        if kind in files:
            raise FileError(
                path, f"is a second {kind.replace('_', ' ')} beside {files[kind]}", "read one at a time"
            )
        files[kind], part = path, with_file(part, kind, str(path))
    return PartReader(reader_of(checked), checked).read(part, expected=expected)
