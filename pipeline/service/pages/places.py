"""A reading for the operator's page: places, their doubts, and the text over them, in which a space has no place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord
from pipeline.common.records import PartRecord
from pipeline.common.texts import EXTRA, align

# lead of the first over the second candidate below which a place is unsure; the reader's own limit
LOW_MARGIN = 0.3
# probability of the best candidate below which a place is unsure
LOW_PROBABILITY = 0.95
# probability of every best candidate above which its characters are not the reason for a review
BEYOND_DOUBT = 0.99
MOST_CANDIDATES = 5
_LEAST_PROBABILITY = 0.002
_FEWEST_CANDIDATES = 2
_DOUBTS = ("mismatch", "not read", "confused")
UNSURE, LEAST_SURE = "unsure", "least sure"
UNKNOWN_CHAR = "?"


@dataclass(frozen=True)
class Place:
    """One place of a reading."""

    index: int
    char: str
    doubt: str  # mismatch, not read, confused, unsure or least sure; empty if there is none
    words: str  # the state in the reader's words, such as "confused 8/B"
    grade: str
    candidates: tuple[CandidateRecord, ...]  # those worth showing, best first


@dataclass(frozen=True)
class Cell:
    """One character of a text; `place` is None where no place of the reading answers to it."""

    char: str
    place: int | None
    doubt: str


def margin(character: CharacterRecord) -> float:
    """Lead of the first over the second candidate; 0 without any."""
    beliefs = [c.probability for c in character.candidates[:2]]
    return beliefs[0] - sum(beliefs[1:]) if beliefs else 0.0


def places_of(reading: ReadingRecord | None) -> tuple[Place, ...]:
    """The places of a reading; if it is not accepted and none is in doubt, the least sure one is where to look."""
    if reading is None:
        return ()
    doubts = [_doubt(c) for c in reading.characters]
    if doubts and not any(doubts) and reading.decision != "accept":
        beliefs = [c.candidates[0].probability for c in reading.characters]
        if min(beliefs) < BEYOND_DOUBT:
            doubts[beliefs.index(min(beliefs))] = LEAST_SURE
    places = []
    for index, (character, doubt) in enumerate(zip(reading.characters, doubts, strict=True)):
        char = character.candidates[0].char if character.candidates else UNKNOWN_CHAR
        words = doubt if doubt in (UNSURE, LEAST_SURE) else character.state or doubt
        shown = _worth_showing(character.candidates)
        places.append(Place(index, char, doubt, words, character.grade, shown))
    return tuple(places)


def _doubt(character: CharacterRecord) -> str:
    for doubt in _DOUBTS:
        if character.state.startswith(doubt):
            return doubt
    if not character.candidates:
        return "not read"
    unsure = margin(character) < LOW_MARGIN or character.candidates[0].probability < LOW_PROBABILITY
    return UNSURE if unsure else ""


def _worth_showing(candidates: Sequence[CandidateRecord]) -> tuple[CandidateRecord, ...]:
    least = sum(c.probability >= _LEAST_PROBABILITY for c in candidates)
    return tuple(candidates[: min(MOST_CANDIDATES, max(_FEWEST_CANDIDATES, least))])


def cells_of(text: str, places: Sequence[Place]) -> tuple[Cell, ...]:
    """The characters of a text, each with its place."""
    answered = _place_of_each([p.char for p in places], text)
    return tuple(Cell(char, place, "" if place is None else places[place].doubt) for char, place in answered)


def _place_of_each(chars: Sequence[str], text: str) -> list[tuple[str, int | None]]:
    answers = iter(align_places(chars, [char for char in text if not char.isspace()]))
    return [(char, None if char.isspace() else next(answers)) for char in text]


def align_places(chars: Sequence[str], others: Sequence[str]) -> tuple[int | None, ...]:
    """For each of the others its place among the chars; None without one."""
    place, answers = 0, list[int | None]()
    for pair in align("".join(chars), "".join(others)):
        if pair.place is not None:
            answers.append(None if pair.true == EXTRA else place)
        place += pair.true != EXTRA
    return tuple(answers)


def why_not_accepted(part: PartRecord) -> tuple[str, ...]:
    """Reasons for which a part is not accepted, in words; the first one is shown in lists."""
    reading = part.reading
    if reading is None:
        return ("it has not been read",)
    # the messages of a reading that is refuted say so themselves
    undecided = f"the expected serial {part.expected} is not confirmed beyond doubt"
    why = ((undecided,) if reading.verdict == "undecided" else ()) + reading.messages
    why += (part.not_felt,) if part.not_felt else ()
    return why or ("the reading does not meet the thresholds of acceptance",)


def part_cells(part: PartRecord) -> tuple[Cell, ...]:
    """The present text of a part; a text from a person has no doubts."""
    cells = cells_of(part.text, places_of(part.reading))
    return cells if part.review is None else tuple(Cell(c.char, c.place, "") for c in cells)


def expected_cells(part: PartRecord) -> tuple[Cell, ...]:
    """Cells of the expected text; a character that differs from the part's own text there is a mismatch."""
    borne = [char for char in part.text if not char.isspace()]
    return tuple(
        Cell(
            char, place, "" if char.isspace() or (place is not None and borne[place] == char) else "mismatch"
        )
        for char, place in _place_of_each(borne, part.expected)
    )
