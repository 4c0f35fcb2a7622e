"""What a benchmark keeps: one trial a part and mode, one line of JSON a part, appended as soon as it is done.

    trials.jsonl    {"format_version": 3, "benchmark": {...}, "key": "..."}    the first line: what is tried, its hash
                    {"part": "...", "trials": [{...}, {...}]}                  a part, read by every mode
                    {"part": "...", "tri                                       a torn last line is tried again

A folder that was left half done is taken up where it stood; one that holds another benchmark is refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.errors import FileError, require_file
from pipeline.benchmark.exam.condition import GIVEN, PERTURBED, Condition, Level
from pipeline.common.atomic import replacing
from pipeline.common.run_description import differences, in_short, key_of

if TYPE_CHECKING:
    from recognition.decision.reading import Reading

TRIALS_FILE = "trials.jsonl"
FORMAT_VERSION = 3
"""2 had severity, font and format in place of the levels; 1 no version, nor simulated_s."""
_SIMULATION = ("mount", "scan")  # steps of a reading's time that a real array has not
_MAX_FILE_BYTES = 4_000_000_000


@dataclass(frozen=True)
class ReadCharacter:
    """One character as read.

    Attributes:
        char: the first candidate.
        confidence: belief in it, 0 to 1.
        margin: that less the belief in the second candidate.
    """

    char: str
    confidence: float
    margin: float


@dataclass(frozen=True)
class Trial:
    """One part read by one mode.

    Attributes:
        part: name of the part, unique in the benchmark.
        number: of the part among those of its kind.
        levels: of all factors: of the part, and what the reader was given (`pipeline.benchmark.exam.condition`).
        mode: what read it.
        truth: what was stamped, without spaces.
        text: what was read, without spaces; empty with an error.
        decision: accept, review or reject; empty with an error.
        confidence: that the whole text is right, 0 to 1.
        characters: the places as read.
        flags: what the reader says about it.
        error: why there is no reading; empty when there is one.
        compute_s: time that the program took for it, making the part and its photograph not counted.
        scan_s: time that the real array would take for the scan; 0 without touch.
        simulated_s: of compute_s, what stands in for the array: mounting the map and simulating the scan.
        measures: of the part, where a certificate asks for them (`recognition.decision.part_measures`).
    """

    part: str
    number: int
    levels: dict[str, Level]
    mode: str
    truth: str
    text: str = ""
    decision: str = ""
    confidence: float = 0.0
    characters: tuple[ReadCharacter, ...] = ()
    flags: str = ""
    error: str = ""
    compute_s: float = 0.0
    scan_s: float = 0.0
    simulated_s: float = field(default=0.0, compare=False)
    measures: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def severity(self) -> float | None:
        """Of the dirt, 0 to 1; None where it is not known."""
        return Condition(**self.levels).severity

    @property
    def font(self) -> str:
        """Of the mark; empty where it is not known."""
        return Condition(**self.levels).font

    @property
    def format(self) -> str:
        """Of the serial; empty where it is not known."""
        return Condition(**self.levels).format

    @property
    def given(self) -> str:
        """What the reader was given, in a few words."""
        names = [name for name in GIVEN if self.levels.get(f"{name}_given")]
        return ",".join(names) or "nothing"

    @property
    def perturbed(self) -> str:
        """The perturbation under which it was read; empty where it was read as it is."""
        return str(self.levels.get(PERTURBED) or "")

    @property
    def reading_s(self) -> float:
        """Of that the reading: from the scan or the photograph to the answer."""
        return max(0.0, self.compute_s - self.simulated_s)

    @property
    def right(self) -> bool:
        """Whether the whole serial is right."""
        return not self.error and self.text == self.truth

    @property
    def accepted(self) -> bool:
        """Whether the reader vouches for it."""
        return self.decision == "accept"


def answer_of(reading: Reading) -> dict[str, Any]:
    """The fields of a trial that a reading fills."""
    return {
        "text": "".join(reading.text.split()),
        "decision": reading.decision.value,
        "confidence": round(float(reading.confidence), 6),
        "characters": tuple(
            ReadCharacter(c.char, round(float(c.confidence), 6), round(float(c.margin), 6))
            for c in reading.characters
        ),
        "flags": "; ".join(reading.messages()),
        "simulated_s": round(sum(reading.seconds.get(step, 0.0) for step in _SIMULATION), 4),
    }


@dataclass
class TrialJournal:
    """The trials of one benchmark in its folder.

    Attributes:
        path: the file.
        description: what is tried: plain JSON values.
        done: trials by the part's name.

    Raises:
        FileError: the folder holds another benchmark, or a file that is damaged before its last line.
    """

    path: Path
    description: Mapping[str, Any]
    done: dict[str, tuple[Trial, ...]] = field(default_factory=dict)

    @classmethod
    def open(cls, folder: Path, description: Mapping[str, Any]) -> TrialJournal:
        """Take up the book in a folder, or begin one.

        Raises:
            FileError: see the class; or the folder cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(folder, f"cannot be made ({error.strerror})", "name another folder") from error
        book = cls(folder / TRIALS_FILE, description)
        lines, whole_bytes = _whole_lines(book.path) if book.path.exists() else ([], 0)
        if not lines:
            with replacing(book.path) as temporary:
                temporary.write_text(book._heading(), encoding="utf-8")
            return book
        book._check_heading(lines[0])
        for number, line in enumerate(lines[1:], start=2):
            book._take(line, number)
        if whole_bytes < book.path.stat().st_size:
            with book.path.open("rb+") as stream:
                stream.truncate(whole_bytes)
        return book

    @classmethod
    def read(cls, folder: Path) -> TrialJournal:
        """The book that a folder holds; nothing in it is changed.

        Raises:
            FileError: no book, of another format version, or damaged before its last line.
        """
        path = folder / TRIALS_FILE
        lines = _whole_lines(path)[0] if path.is_file() else []
        if not lines:
            raise FileError(
                path,
                "is not there" if not path.is_file() else "is empty",
                "name the folder of a benchmark (--out)",
            )
        book = cls(path, _description(path, lines[0])[0])
        for number, line in enumerate(lines[1:], start=2):
            book._take(line, number)
        return book

    def add(self, part: str, trials: Iterable[Trial]) -> None:
        """Append one part and keep it.

        Raises:
            FileError: it cannot be written.
        """
        kept = tuple(trials)
        line = json.dumps({"part": part, "trials": [asdict(t) for t in kept]}, ensure_ascii=False)
        try:
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write(line + "\n")
        except OSError as error:
            raise FileError(
                self.path, f"cannot be written ({error.strerror or error})", "make room and start it again"
            ) from error
        self.done[part] = kept

    def _heading(self) -> str:
        heading = {
            "format_version": FORMAT_VERSION,
            "benchmark": dict(self.description),
            "key": key_of(self.description),
        }
        return json.dumps(heading, ensure_ascii=False) + "\n"

    def _check_heading(self, line: str) -> None:
        held, key = _description(self.path, line)
        if key != key_of(self.description):
            changes = differences(held, self.description)
            raise FileError(
                self.path, f"holds another benchmark ({changes})", "name another folder or remove that one"
            )

    def _take(self, line: str, number: int) -> None:
        record = _parsed(line)
        try:
            if record is None:
                raise ValueError("no JSON")
            self.done[record["part"]] = tuple(_trial(values) for values in record["trials"])
        except (KeyError, TypeError, ValueError) as error:
            raise FileError(
                self.path, f"line {number} is damaged ({error})", "remove that line; its part is tried again"
            ) from error


def _description(path: Path, line: str) -> tuple[dict[str, Any], object]:
    """What the heading says is tried, and its key."""
    heading = _parsed(line)
    held = heading.get("benchmark") if heading else None
    if heading is None or not isinstance(held, dict):
        raise FileError(path, "is not a book of trials", "name another folder")
    version = heading.get("format_version", 1)
    if version != FORMAT_VERSION:
        newer = isinstance(version, int) and version > FORMAT_VERSION
        raise FileError(
            path,
            f"has format version {in_short(version)}; this program writes {FORMAT_VERSION}",
            "update this program, or name another folder" if newer else "name another folder",
        )
    return held, heading.get("key")


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
        value = json.loads(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


_FIELDS = frozenset(f.name for f in fields(Trial))


def _trial(values: Mapping[str, Any]) -> Trial:
    if not _FIELDS - {"measures"} <= set(values) <= _FIELDS:
        raise ValueError("the fields are not those of a trial")
    characters = tuple(ReadCharacter(**c) for c in values["characters"])
    return Trial(**{**values, "characters": characters})
