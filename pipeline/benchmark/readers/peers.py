"""Third-party readers as modes: their input (`pictures`), the engine (`engines`) and the rule of acceptance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from glyphs.fonts.serials import allowed_characters
from pipeline.benchmark.readers.engines import Line, open_engine
from pipeline.benchmark.readers.mode import Mode, PartReadings
from pipeline.benchmark.readers.pictures import PICTURES

if TYPE_CHECKING:
    from recognition.decision.reading import Reading

ACCEPTED_FROM = 0.9
"""Product of the confidences in the characters from which a reading counts as accepted, if it fits the format."""
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
_FELT = ("edges", "relief")
_LEAST_PX = 8  # of a side: engines fail on smaller pictures


def open_peer(engine: str, picture: str, *, format: str | None) -> Mode:
    """A mode that reads by a third-party engine.

    Args:
        engine: "rapidocr" or "tesseract".
        picture: a name of `pipeline.benchmark.readers.pictures.PICTURES`.
        format: of the serial; None: any letter or digit.

    Raises:
        ModeUnavailableError: the engine or its data are not installed.
    """
    places = tuple(p for p in allowed_characters(format) if p != " ") if format else ()
    read_line = open_engine(engine, "".join(sorted(set("".join(places)))) or _ALPHABET)
    felt = picture in _FELT

    def read(senses: PartReadings) -> Reading:
        drawn = PICTURES[picture](senses)
        line = read_line(drawn, places) if min(drawn.shape[:2]) >= _LEAST_PX else []
        reading = peer_reading(line, places=places)
        return replace(reading, seconds={"scan": senses.felt.simulated_s}) if felt else reading

    return Mode.of(("felt",) if felt else (), read)


def peer_reading(line: Line, *, places: tuple[str, ...] = (), accepted: bool | None = None) -> Reading:
    """Make a reading of a peer's line: accepted if it fits the format and the peer is sure, or says so itself."""
    from recognition.decision.flags import ReadingFlag
    from recognition.decision.reading import Candidate, CharacterReading, Reading
    from recognition.language.box import Box as PlateBox

    line = [(char, min(1.0, max(0.0, sure))) for char, sure in line if not char.isspace()]
    nowhere = PlateBox(0.0, 0.0, 0.0, 0.0)
    sure = math.prod(s for _, s in line) if line else 0.0
    fits = bool(line) and (
        not places
        or (len(line) == len(places) and all(c in p for (c, _), p in zip(line, places, strict=True)))
    )
    threshold = ACCEPTED_FROM if accepted is None else 0.0 if accepted else math.inf
    flags = ReadingFlag.NONE if line else ReadingFlag.NO_CHARACTERS
    return Reading(
        characters=tuple(CharacterReading((Candidate(c, s, s),), nowhere) for c, s in line),
        confidence=sure,
        flags=flags if fits or not line else ReadingFlag.FORMAT_NOT_MET,
        source="peer",
        threshold=threshold,
    )
