"""A user's reader in the exam, `module:function`: def read(part: ExamPart) -> str | Answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.named import load_named
from pipeline.benchmark.readers.mode import Mode, PartReadings
from pipeline.benchmark.readers.peers import ACCEPTED_FROM, peer_reading
from pipeline.benchmark.readers.pictures import PICTURES
from pipeline.common.settings import SettingsError
from pipeline.common.texts import without_blanks

if TYPE_CHECKING:
    from recognition.decide.reading import Reading
    from recognition.settings import ReaderSettings


@dataclass(frozen=True)
class Answer:
    """The answer of a reader to a part, accepted by itself or by its confidence, 0 to 1, from `ACCEPTED_FROM`."""

    text: str
    confidence: float = 0.0
    accepted: bool | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.confidence <= 1.0:
            raise MarksError(f"the reader's confidence is {self.confidence}", hint="it lies between 0 and 1")


class ExamPart:
    """A part, as given to a user's reader; what is not given is None or empty. A felt map is charged to the reader."""

    def __init__(self, senses: PartReadings, settings: ReaderSettings) -> None:
        self.name = senses.specimen.part
        self.format = settings.format if isinstance(settings.format, str) else None
        self.height_mm = settings.height_mm
        self.fonts = tuple(str(font) for font in settings.fonts)
        self.felt = False
        self._senses = senses

    @property
    def photo(self) -> tuple[NDArray[np.uint8], float | None]:
        """The whole photograph (rows, cols, 3) or (rows, cols), and the size of a pixel on the part, mm."""
        photo = self._senses.photo
        return photo.eight_bit, photo.pitch_mm

    @property
    def relief(self) -> tuple[NDArray[np.float32], float]:
        """Felt heights (rows, cols), mm, NaN where unknown, and their pitch, mm; a MarksError without a relief."""
        self.felt = True
        return self._senses.relief.height_mm, self._senses.relief.pitch_mm

    @property
    def edges(self) -> tuple[NDArray[np.float32], float]:
        """Edge maps (directions, rows, cols) by direction of travel, and their pitch, mm; a MarksError without."""
        self.felt = True
        return self._senses.edges.enhancement, self._senses.edges.pitch_mm

    @property
    def surface(self) -> tuple[NDArray[np.float32], float]:
        """True heights (rows, cols), mm, and their pitch, mm."""
        return self._senses.specimen.height_map.z_mm, self._senses.specimen.height_map.pitch_mm

    def line_picture(self, kind: str) -> NDArray[np.uint8]:
        """The line cut out and drawn, (rows, cols, 3): photo, edges, relief or ideal, as for the peers."""
        if kind not in PICTURES:
            raise MarksError(f"there is no picture {kind!r}", hint=f"the pictures are {', '.join(PICTURES)}")
        self.felt |= kind in ("edges", "relief")
        return PICTURES[kind](self._senses)


def own_mode(name: str, settings: ReaderSettings) -> Mode:
    """Make a mode from a user's function. Raises SettingsError: there is no such function."""
    function: Any = load_named(name, what="reader", error=SettingsError)
    if not callable(function):
        raise SettingsError(f"the reader {name!r} is not a function", hint="name one that takes a part")

    def read(senses: PartReadings) -> tuple[Reading, Mapping[str, Any]]:
        part = ExamPart(senses, settings)
        try:
            answered = function(part)
        except SystemExit as error:
            raise MarksError("the reader tried to end the program", hint="let it raise an error") from error
        answer = Answer(answered) if isinstance(answered, str) else answered
        if not isinstance(answer, Answer):
            raise MarksError(
                f"the reader returned a {type(answered).__name__}", hint="return a text or an Answer"
            )
        return reading_of_answer(answer), {"scan_s": round(senses.scan_s, 3)} if part.felt else {}

    return Mode((), read)


def reading_of_answer(answer: Answer) -> Reading:
    """Convert an answer to a reading."""
    text = without_blanks(answer.text)
    # the confidence is that of the whole text: the characters' product must equal it
    each = answer.confidence ** (1.0 / max(1, len(text)))
    accepted = answer.confidence >= ACCEPTED_FROM if answer.accepted is None else answer.accepted
    return peer_reading([(char, each) for char in text], accepted=accepted)
