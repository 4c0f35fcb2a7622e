"""Journal of a benchmark's trials: one for each part, mode and set of given facts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from pipeline.benchmark.exam.condition import GIVEN, PERTURBED, Condition, Level
from pipeline.common.texts import without_blanks
from pipeline.runs.journal import Journal
from recognition.decide.decision import BROKEN, ReadingFlag

if TYPE_CHECKING:
    from recognition.decide.reading import Reading

_SIMULATION = ("mount", "scan")  # timed steps of a reading that a real array does not need


@dataclass(frozen=True)
class ReadCharacter:
    """One character of a reading, with its probability and its lead over the second candidate."""

    char: str
    confidence: float
    margin: float


@dataclass(frozen=True)
class Trial:
    """One part read by one mode."""

    part: str
    number: int  # of the part among those of its kind
    # of all factors, and facts given to the reader (`pipeline.benchmark.exam.condition`)
    levels: dict[str, Level]
    mode: str
    truth: str  # without spaces, as the text
    text: str = ""  # empty with an error
    decision: str = ""
    confidence: float = 0.0
    characters: tuple[ReadCharacter, ...] = ()
    flags: str = ""
    broken: bool = False  # it breaks a contract, so that no score is enough
    error: str = ""
    compute_s: float = 0.0  # time that the program took, without making the part and its photograph
    scan_s: float = 0.0  # time that the real array would take for the scan; 0 without touch
    # part of compute_s that replaces the array: mounting the map and simulating the scan
    simulated_s: float = field(default=0.0, compare=False)
    # of the part by our own modes (`recognition.decide.score`)
    measures: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def severity(self) -> float | None:
        return Condition(**self.levels).severity

    @property
    def given(self) -> str:
        names = [name for name in GIVEN if self.levels.get(f"{name}_given")]
        return ",".join(names) or "nothing"

    @property
    def perturbed(self) -> str:
        return str(self.levels.get(PERTURBED) or "")

    @property
    def reading_s(self) -> float:
        """Time from the scan or the photograph to the answer."""
        return max(0.0, self.compute_s - self.simulated_s)

    @property
    def right(self) -> bool:
        return not self.error and self.text == self.truth

    @property
    def accepted(self) -> bool:
        return self.decision == "accept"


def answer_of(reading: Reading) -> dict[str, Any]:
    """Fields of a trial from a reading."""
    return {
        "text": without_blanks(reading.text),
        "decision": reading.decision.value,
        "confidence": round(float(reading.confidence), 6),
        "characters": tuple(
            ReadCharacter(c.char, round(float(c.confidence), 6), round(float(c.margin), 6))
            for c in reading.characters
        ),
        "flags": "; ".join(reading.messages()),
        "broken": bool(reading.flags & BROKEN & ~ReadingFlag.RISK_NOT_KEPT),
        "simulated_s": round(sum(reading.seconds.get(step, 0.0) for step in _SIMULATION), 4),
    }


class TrialJournal(Journal[tuple[Trial, ...]]):
    """The trials of one benchmark in its folder, by part."""

    kind: ClassVar[str] = "benchmark"
    version: ClassVar[int] = 4
    keeps: ClassVar[Any] = tuple[Trial, ...]
    file: ClassVar[str] = "trials.db"
