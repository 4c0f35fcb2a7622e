"""Load a table of any program's answers to an exam, as trials with their truth.

part,text,confidence,decision        also allowed: file for part, serial for text, accepted for decision
rust-0.3-0000,KR804217,0.93,accept   confidence 0 to 1; accept, review or reject
lines/rust-0.3-0001-photo.png,KB7A   a picture from `benchmark export` stands for its part
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, ValidationError

from glyphs.errors import FileError
from pipeline.benchmark.exam.condition import given_levels
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.readers.own_reader import Answer, reading_of_answer
from pipeline.benchmark.readers.pictures import PICTURES
from pipeline.benchmark.trials.journal import Trial, answer_of
from pipeline.formats.table_file import number_of
from pipeline.formats.truth import PartLine, PartTexts, load_part_lines


def designed_items(parts: DesignedParts) -> list[Item]:
    """Items of a design with their truth, without making the parts."""
    return [replace(item, truth=parts.truth_of(item)) for item in parts.items()]


@dataclass(frozen=True)
class Answers:
    """The answers of one reader: a trial of each part, empty without an answer; `unknown` parts are not in the exam."""

    trials: tuple[Trial, ...]
    missing: tuple[str, ...]
    unknown: tuple[str, ...]


def load_answers(path: Path, items: Sequence[Item], *, reader: str, given: str) -> Answers:
    """Load a table of answers to the parts of an exam, by a reader that knew the facts `given`. Raises FileError: no
    such table, a part with two lines, or an invalid value; it names the line."""
    known = PartTexts((item.part, item.truth) for item in items)
    answered: dict[str, PartLine] = {}
    unknown = []
    for line in load_part_lines(path):
        part = _part_of(line.part, known)
        if part is None:
            unknown.append(line.part.rpartition("/")[2])
            continue
        if part in answered:
            earlier = answered[part].line
            raise FileError(
                path, f"lines {earlier} and {line.line} answer {part}", "keep one line for each part"
            )
        answered[part] = line
    if not answered:
        raise FileError(
            path, "answers no part of the exam", f"use the names of the exam, such as {items[0].part}"
        )
    trials = []
    for item in items:
        answer = _fields_of(path, answered[item.part]) if item.part in answered else _fields("", 0.0, None)
        levels = {**item.condition.levels, **given_levels(given)}
        trials.append(replace(Trial(item.part, item.number, levels, reader, item.truth), **answer))
    missing = tuple(item.part for item in items if item.part not in answered)
    return Answers(tuple(trials), missing, tuple(unknown))


def _part_of(name: str, known: PartTexts) -> str | None:
    stem, _, view = name.rpartition("-")
    return known.name_of(name) or (known.name_of(stem) if view in PICTURES else None)


class _Cells(BaseModel):
    confidence: Annotated[float, BeforeValidator(number_of), Field(ge=0.0, le=1.0)] = 0.0
    decision: Literal["accept", "review", "reject"] | None = None
    accepted: bool | None = None


_HINTS = {
    "confidence": "give a number from 0 to 1",
    "decision": "give one of accept, review, reject",
    "accepted": "give yes or no",
}


def _fields_of(path: Path, line: PartLine) -> dict[str, Any]:
    written = {name: line.others[name].lower() for name in _HINTS if line.others.get(name)}
    try:
        cells = _Cells.model_validate(written)
    except ValidationError as error:
        name = str(error.errors()[0]["loc"][0])
        what = name if name == "accepted" else f"the {name}"
        raise FileError(path, f"line {line.line}: {what} is {written[name]!r}", _HINTS[name]) from error
    decision = cells.decision
    if decision is None and cells.accepted is not None:
        decision = "accept" if cells.accepted else "review"
    return _fields(line.text, cells.confidence, decision)


def _fields(text: str, confidence: float, decision: str | None) -> dict[str, Any]:
    accepted = None if decision is None else decision == "accept"
    fields = answer_of(reading_of_answer(Answer(text, confidence, accepted)))
    return fields if decision in (None, "accept") else {**fields, "decision": decision}
