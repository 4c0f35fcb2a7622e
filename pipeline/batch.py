"""A run over many parts: one row a part, whatever happens to it.

    parts --load--> HeightMap or Scan --reader--> Reading --> Row --on_row--> (table, file, progress)

One part is in memory at a time. `read_part` neither keeps nor needs state beyond the reader's, so that a
later pool of workers can be handed (reader, part) pairs in place of the loop in `read_parts`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pipeline.files import read_height_map, read_scan, row_order_matters
from pipeline.parts import Part
from pipeline.problems import FileProblem

if TYPE_CHECKING:
    from glyphs.maps import HeightMap
    from recognition.reader import ReadingWithEvidence
    from recognition.reading import MarkDepth, Reading
    from whisker_array.scan import Scan


class PartReader(Protocol):
    """What reads: `recognition.reader.Reader` is one."""

    def read_height_map(self, height_map: HeightMap, *, part_id: str = "") -> ReadingWithEvidence:
        """Scan a height map with the virtual array and read it."""

    def read_scan(self, scan: Scan) -> ReadingWithEvidence:
        """Read a recorded scan."""


@dataclass(frozen=True)
class Row:
    """What is said of one part; the fields are the columns, in this order.

    Attributes:
        part: name of the part.
        text: as read; empty when nothing was.
        decision: accept, review or reject; empty with an error.
        confidence: that the whole text is right, 0 to 1.
        source: tactile.
        seconds: time spent, loading included.
        error: why there is no reading; empty when there is one.
        font: font whose templates answered best.
        height_mm: character height found.
        rotation_deg: of the line, from +x towards +y.
        raised: raised marks.
        flags: what to know about the reading, and what the mark lacks for the rules asked for.
        alternatives: a place's other candidates with some belief, as "3:8B 5:S", places from 1.
        depth_min_mm: depth of the mark where it is least (height of a raised one); None where it was not felt.
        depth_mean_mm: mean depth of the characters; None where it was not felt.
        depths: least and mean depth of every character, mm, as "K 0.212/0.231 7 0.198/0.220"; "?" where not felt.
    """

    part: str
    text: str = ""
    decision: str = ""
    confidence: float = 0.0
    source: str = ""
    seconds: float = 0.0
    error: str = ""
    font: str = ""
    height_mm: float = 0.0
    rotation_deg: float = 0.0
    raised: bool = False
    flags: str = ""
    alternatives: str = ""
    depth_min_mm: float | None = None
    depth_mean_mm: float | None = None
    depths: str = ""


_BELIEF_WORTH_TELLING = 0.01


def read_parts(
    parts: Iterable[Part], reader: PartReader, *, on_row: Callable[[Row], None] | None = None
) -> list[Row]:
    """Read every part; a part that cannot be read is a row with its error and the run goes on."""
    rows = []
    for part in parts:
        row = read_part(part, reader)
        rows.append(row)
        if on_row is not None:
            on_row(row)
    return rows


def read_part(part: Part, reader: PartReader) -> Row:
    """Read one part."""
    from glyphs.maps import MapError

    started = time.perf_counter()
    try:
        reading = evidence_of(part, reader).reading
    except FileProblem as problem:
        return Row(part.name, seconds=_since(started), error=str(problem))
    except MapError as error:
        return Row(part.name, seconds=_since(started), error=f"{_file(part)}: {_one_line(error)}")
    # A fault of the program in one part may not cost a night's run the other parts; the row tells its kind.
    except Exception as error:
        fault = f"{_file(part)}: fault of the program, {type(error).__name__}: {_one_line(error)}"
        return Row(part.name, seconds=_since(started), error=fault)
    return row_of(part.name, reading, seconds=_since(started))


def evidence_of(part: Part, reader: PartReader) -> ReadingWithEvidence:
    """Load the part and read it; a recorded scan goes before a height map.

    Of a format that is met with either row first, the other order is tried where the standards' is not
    accepted.

    Raises:
        FileProblem: the part's file cannot be used.
    """
    if part.problem is not None:
        raise part.problem
    if part.scan is not None:
        return reader.read_scan(read_scan(part.scan))
    if part.height_map is None:
        raise FileProblem(part.photo or part.name, "has no height map and no scan", "add one")
    found = reader.read_height_map(read_height_map(part.height_map), part_id=part.name)
    if not row_order_matters(part.height_map) or not found.reading.text or found.reading.decision == "accept":
        return found
    from pipeline.instruments import RowOrder

    turned = read_height_map(part.height_map, row_order=RowOrder.TOP_FIRST)
    other = reader.read_height_map(turned, part_id=part.name)
    return max(found, other, key=lambda e: e.reading.confidence)


def row_of(name: str, reading: Reading, *, seconds: float) -> Row:
    """The row of a reading."""
    return Row(
        part=name,
        text=reading.text,
        decision=reading.decision.value,
        confidence=round(float(reading.confidence), 6),
        source=reading.source,
        seconds=seconds,
        font=reading.font,
        height_mm=round(float(reading.height_mm), 4),
        rotation_deg=round(float(reading.rotation_deg), 3),
        raised=bool(reading.raised),
        flags="; ".join(reading.messages()),
        alternatives=" ".join(_alternatives(reading)),
        depth_min_mm=_rounded(reading.depth_min_mm),
        depth_mean_mm=_rounded(reading.depth_mean_mm),
        depths=" ".join(f"{c.char} {depth_text(c.depth)}" for c in reading.characters),
    )


def depth_text(depth: MarkDepth | None) -> str:
    """Least and mean depth of a character, mm."""
    return "?" if depth is None else f"{depth.min_mm:.3f}/{depth.mean_mm:.3f}"


def _rounded(depth_mm: float | None) -> float | None:
    return None if depth_mm is None else round(depth_mm, 4)


def _alternatives(reading: Reading) -> Iterator[str]:
    for place, character in enumerate(reading.characters, start=1):
        others = [c.char for c in character.candidates[1:] if c.probability >= _BELIEF_WORTH_TELLING]
        if others:
            yield f"{place}:{''.join(others)}"


def _since(started: float) -> float:
    return round(time.perf_counter() - started, 4)


def _file(part: Part) -> str:
    return str(part.scan or part.height_map or part.name)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
