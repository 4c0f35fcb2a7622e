"""What a long run keeps so that it can be broken off: a line of JSON a part, appended as soon as it is done.

    {"format_version": 3, "benchmark": {...}, "key": "..."}    the first line: what is run, its hash
    {"part": "...", "trials": [{...}, {...}]}                  a part, as the kind of journal writes it
    {"part": "...", "tri                                       a torn last line is done again

A journal that was left half done is taken up where it stood; one of another run is refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

from glyphs.atomic import replacing
from glyphs.errors import FileError, require_file
from pipeline.common.parsed import json_of
from pipeline.common.run_description import differences, in_short, key_of

_MAX_FILE_BYTES = 4_000_000_000
Kept = TypeVar("Kept")


class LineJournal(Generic[Kept]):
    """The parts of one run, kept in one file; for one writer at a time.

    A kind of journal says what it is of, and how what it keeps of a part is written: `kind`, `version`, `encoded`,
    `decoded`.

    Attributes:
        path: the file.
        description: what is run: plain JSON values.
        done: what is kept, by the part's name.
    """

    kind: ClassVar[str]
    version: ClassVar[int]

    def __init__(self, path: Path, description: Mapping[str, Any]) -> None:
        self.path = path
        self.description = description
        self.done: dict[str, Kept] = {}

    def encoded(self, kept: Kept) -> dict[str, Any]:
        """The entries of a part's line, beside its name."""
        raise NotImplementedError

    def decoded(self, line: Mapping[str, Any]) -> Kept:
        """The same, read.

        Raises:
            KeyError, TypeError, ValueError: it is damaged.
        """
        raise NotImplementedError

    @classmethod
    def at(cls, place: Path) -> Path:
        """The journal's file in a place that a person names; that file itself unless a kind says otherwise."""
        return place

    @classmethod
    def open(cls, place: Path, description: Mapping[str, Any]) -> Self:
        """Take up the journal there, or begin one.

        Raises:
            FileError: it is of another run, or damaged before its last line; the folder cannot be written.
        """
        path = cls.at(place)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(
                path.parent, f"cannot be made ({error.strerror})", "name another folder"
            ) from error
        journal = cls(path, description)
        lines, whole_bytes = _whole_lines(path) if path.exists() else ([], 0)
        if not lines:
            with replacing(path) as temporary:
                temporary.write_text(journal._heading(), encoding="utf-8")
            return journal
        held, key = cls._description(path, lines[0])
        if key != key_of(description):
            changes = differences(held, description)
            raise FileError(
                path, f"holds another {cls.kind} ({changes})", "name another folder or remove that one"
            )
        journal._take(lines[1:])
        if whole_bytes < path.stat().st_size:
            with path.open("rb+") as stream:
                stream.truncate(whole_bytes)
        return journal

    @classmethod
    def read(cls, place: Path) -> Self:
        """The journal there; nothing in it is changed.

        Raises:
            FileError: no journal, of another format version, or damaged before its last line.
        """
        path = cls.at(place)
        lines = _whole_lines(path)[0] if path.is_file() else []
        if not lines:
            what = "is empty" if path.is_file() else "is not there"
            raise FileError(path, what, f"name the folder of a {cls.kind} (--out)")
        journal = cls(path, cls._description(path, lines[0])[0])
        journal._take(lines[1:])
        return journal

    def add(self, part: str, kept: Kept) -> None:
        """Append one part and keep it.

        Raises:
            FileError: it cannot be written.
        """
        line = json.dumps({"part": part, **self.encoded(kept)})  # in ASCII: a file's name may be no text
        try:
            with self.path.open("ab", buffering=0) as stream:
                end = stream.tell()
                try:
                    rest = memoryview(f"{line}\n".encode())
                    while rest:
                        rest = rest[stream.write(rest) :]
                except OSError:
                    stream.truncate(end)  # the next line begins where this one did
                    raise
        except OSError as error:
            raise FileError(
                self.path, f"cannot be written ({error.strerror or error})", "make room and start it again"
            ) from error
        self.done[part] = kept

    def _heading(self) -> str:
        heading = {
            "format_version": self.version,
            self.kind: dict(self.description),
            "key": key_of(self.description),
        }
        return json.dumps(heading) + "\n"

    @classmethod
    def _description(cls, path: Path, line: str) -> tuple[dict[str, Any], object]:
        """What the heading says is run, and its key."""
        heading = _parsed(line)
        held = heading.get(cls.kind) if heading else None
        if heading is None or not isinstance(held, dict):
            raise FileError(path, f"is no journal of a {cls.kind}", "name another folder")
        version = heading.get("format_version", 1)
        if version != cls.version:
            newer = isinstance(version, int) and version > cls.version
            raise FileError(
                path,
                f"has format version {in_short(version)}; this program writes {cls.version}",
                "update this program, or name another folder" if newer else "name another folder",
            )
        return held, heading.get("key")

    def _take(self, lines: list[str]) -> None:
        for number, line in enumerate(lines, start=2):
            record = _parsed(line)
            try:
                if record is None:
                    raise ValueError("no JSON")
                self.done[record["part"]] = self.decoded(record)
            except (KeyError, TypeError, ValueError) as error:
                raise FileError(
                    self.path,
                    f"line {number} is damaged ({error})",
                    "remove that line; its part is done again",
                ) from error


def _whole_lines(path: Path) -> tuple[list[str], int]:
    """The lines that end, and how many bytes they take; a file without one is as good as none."""
    if path.stat().st_size == 0:
        return [], 0
    require_file(path, most_bytes=_MAX_FILE_BYTES)
    data = path.read_bytes()
    whole = data[: data.rfind(b"\n") + 1]
    try:
        return whole.decode("utf-8").split("\n")[:-1], len(whole)
    except UnicodeDecodeError as error:
        raise FileError(path, "is not UTF-8 text", "name another folder") from error


def _parsed(line: str) -> dict[str, Any] | None:
    try:
        value = json_of(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None
