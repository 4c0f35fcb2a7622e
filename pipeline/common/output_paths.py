"""Output files and folders, checked before the work starts and written whole or not at all. Raises FileError."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from glyphs.atomic import replacing
from glyphs.errors import FileError
from pipeline.common.texts import CSV_BEGIN, csv_line

PICTURES = (".png", ".svg", ".pdf")  # suffixes of pictures that can be drawn


def make_folder(folder: Path) -> None:
    """Make an output folder and its parents if needed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made ({error.strerror})", "name another folder") from error


def check_writable(path: Path, suffixes: Collection[str] = ()) -> None:
    """Check, before the work starts, that a file of one of these suffixes (default: any) can be written."""
    if suffixes and path.suffix.lower() not in suffixes:
        raise FileError(path, "has an unsupported output format", f"end it in {', '.join(suffixes)}")
    if path.is_dir():
        raise FileError(path, "is a folder", "name a file")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise FileError(
            path, f"cannot be written ({error.strerror or error})", "name a folder that can be written"
        ) from error


def write_text(path: Path, text: str) -> None:
    """Write a text; lone surrogates, which file names may hold, are written as escapes."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def write_json(path: Path, value: object) -> None:
    """Write JSON."""
    write_text(path, json.dumps(value, indent=1, ensure_ascii=False) + "\n")


def write_table(path: Path, rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV table, the headings first, for spreadsheets; lone surrogates of file names are written as escapes."""
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", errors="backslashreplace", newline="") as stream,
    ):
        stream.write(CSV_BEGIN)
        stream.writelines(map(csv_line, rows))
