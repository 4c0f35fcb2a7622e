"""One part, one row, whatever happens to it.

    part --load--> HeightMap, Scan, Photo --senses--> Sensed --> Row --> (table, page, store)

Nothing is kept from part to part but what the readers keep; `pipeline.batch.run` goes through many.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from glyphs.errors import MarksError
from pipeline.common.row import Row
from pipeline.files.parts import Part
from pipeline.reading.row_texts import (
    action_text,
    alternatives_text,
    depths_text,
    grade_letters,
    rivals_text,
    states_text,
    worst_letter,
)

if TYPE_CHECKING:
    from pipeline.reading.part_reader import Sensed
    from recognition.grammar import Grammar


class PartSenses(Protocol):
    """What reads: `pipeline.reading.part_reader.Senses` do."""

    def sense(self, part: Part) -> Sensed:
        """Load a part and read it."""


def read_part(part: Part, senses: PartSenses, *, grammar: Grammar | None = None) -> Row:
    """Read one part; one that cannot be read is a row with its error."""
    return told_row(part.name, _file(part), lambda: (senses.sense(part), grammar))[0]


def told_row(
    name: str, file: str, sense: Callable[[], tuple[Sensed, Grammar | None]]
) -> tuple[Row, Sensed | None]:
    """The row of a part, whatever happens to it, and what was sensed of it.

    Args:
        name: of the part.
        file: that an error is told of, unless it names one itself.
        sense: loads and reads the part; also gives what serials may be, of which rivals are.
    """
    started = time.perf_counter()
    try:
        sensed, grammar = sense()
        return row_of(name, sensed, seconds=_since(started), grammar=grammar), sensed
    except MarksError as error:
        told = str(error) if error.where else f"{file}: {error}"
    # A fault of the program in one part may not cost a night's run the other parts; the row tells its kind.
    except Exception as error:
        told = f"{file}: fault of the program, {type(error).__name__}: {_one_line(error)}"
    return Row(name, seconds=_since(started), error=told), None


def row_of(name: str, sensed: Sensed, *, seconds: float, grammar: Grammar | None = None) -> Row:
    """The row of a part that was read."""
    reading, verification = sensed.reading, sensed.verification
    told = [*reading.messages(), *(verification.messages() if verification is not None else ())]
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
        flags="; ".join(told),
        alternatives=alternatives_text(reading),
        depth_min_mm=_rounded(reading.depth_min_mm),
        depth_mean_mm=_rounded(reading.depth_mean_mm),
        depths=depths_text(reading),
        expected="" if verification is None else verification.expected,
        verdict="" if verification is None else verification.verdict.value,
        verify_probability=None if verification is None else round(float(verification.probability), 6),
        states=states_text(reading),
        rivals=rivals_text(reading, sensed.lattice, grammar),
        grade=worst_letter(reading),
        grades=grade_letters(reading),
        action=action_text(reading),
    )


def _rounded(depth_mm: float | None) -> float | None:
    return None if depth_mm is None else round(depth_mm, 4)


def _since(started: float) -> float:
    return round(time.perf_counter() - started, 4)


def _file(part: Part) -> str:
    return str(part.scan or part.height_map or part.photo or part.name)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
