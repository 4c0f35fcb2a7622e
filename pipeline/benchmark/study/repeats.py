"""Measure every part of a study several times.

KX.1.h5, KX.2.h5, KX.3.h5    one part, KX, recorded three times: each recording is a trial
KX.npz                       a height map: scanned again for every trial, by each of several virtual arrays
KX.h5, KX.png                one recording: perturbed for every trial (`pipeline.reading.perturbation.REMOUNTED`)

A virtual array keeps the gains and offsets of its sensors.
"""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import TYPE_CHECKING, ClassVar

from glyphs.errors import MarksError
from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.trials.journal import Trial, TrialJournal, answer_of
from pipeline.common.settings import ReadSettings
from pipeline.errors import describe_fault
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob, reading_of
from pipeline.reading.perturbation import REMOUNTED, Retake
from pipeline.runs.journal import resumable

if TYPE_CHECKING:
    from pipeline.workers.executors import Executor

# factor that distinguishes a real recording from a perturbed one
RECORDED = "recorded"
_DEPTH = "depth_mm"
_REPEAT = re.compile(r"(.+)\.(\d+)")


@dataclass(frozen=True)
class StudiedPart:
    """One part, without the number of a recording, and its recordings in the order of their numbers."""

    name: str
    recordings: tuple[PartFiles, ...]

    @property
    def simulated(self) -> bool:
        return (
            len(self.recordings) == 1 and bool(self.recordings[0].height_map) and not self.recordings[0].scan
        )


@dataclass(frozen=True)
class StudyPlan:
    """Number of trials of every array, and of virtual arrays."""

    settings: ReadSettings
    repeats: int
    arrays: int

    def appraiser(self, array: int) -> str:
        return f"array {array + 1}" if self.arrays > 1 else "the reader"


class StudyJournal(TrialJournal):
    """The trials of an interrupted study; the mode of a trial is its appraiser, and trials count from 1."""

    kind: ClassVar[str] = "study"
    file: ClassVar[str] = "study.unfinished"


def depth_of(trial: Trial) -> float | None:
    """Mean depth of the characters, mm; None if unknown."""
    return trial.measures.get(_DEPTH)


def studied_parts(listed: Sequence[PartFiles]) -> list[StudiedPart]:
    """Group parts whose names differ only in a number after a full stop."""
    numbered = {part.name: match for part in listed if (match := _REPEAT.fullmatch(part.name))}
    times = Counter(match[1] for match in numbered.values())
    parts: dict[str, list[tuple[int, PartFiles]]] = {}
    for part in listed:
        match = numbered.get(part.name)
        stem, number = (match[1], int(match[2])) if match and times[match[1]] > 1 else (part.name, 0)
        parts.setdefault(stem, []).append((number, part))
    return [
        StudiedPart(stem, tuple(part for _, part in sorted(recordings, key=itemgetter(0))))
        for stem, recordings in parts.items()
    ]


def measure(
    plan: StudyPlan,
    parts: Sequence[StudiedPart],
    executor: Executor,
    journal: StudyJournal,
    on_part: Callable[[], None] = lambda: None,
) -> list[Trial]:
    """Measure every trial of every part, in order; failures are recorded in the trial, finished ones in the journal."""

    def lost(part: StudiedPart, error: Exception) -> tuple[Trial, ...]:
        return tuple(replace(blank, error=describe_fault(error)) for _, blank in _blanks(plan, part))

    for _ in resumable(journal, parts, executor, _measure_part, plan, lost=lost):
        on_part()
    done = journal.done
    return [m for part in parts for m in done[part.name]]


def _measure_part(plan: StudyPlan, part: StudiedPart) -> tuple[Trial, ...]:
    return tuple(_measure(plan, part, array, blank) for array, blank in _blanks(plan, part))


def _blanks(plan: StudyPlan, part: StudiedPart) -> Iterator[tuple[int, Trial]]:
    several = len(part.recordings) if len(part.recordings) > 1 else 0
    for array in range(plan.arrays):
        for trial in range(1, plan.repeats + 1):
            levels: dict[str, Level] = {RECORDED: trial <= several}
            yield array, Trial(part.name, trial, levels, plan.appraiser(array), truth="")


def _measure(plan: StudyPlan, part: StudiedPart, array: int, blank: Trial) -> Trial:
    recording = part.recordings[(blank.number - 1) % len(part.recordings)]
    seed = zlib.crc32(f"{part.name} {array} {blank.number}".encode())
    again = None if blank.levels[RECORDED] else Retake(REMOUNTED, seed, array=array)
    settings = plan.settings.model_copy(update={"active": False})
    try:
        reading = reading_of(PartJob(recording, settings, retake=again))
    except MarksError as error:
        return replace(blank, error=str(error))
    # a fault of the program in one part must not end the study
    except Exception as error:
        return replace(blank, error=f"{describe_fault(error)}; please report it")
    depth_mm = None if reading.touch is None else reading.touch.depth_mean_mm
    measures = {} if depth_mm is None else {_DEPTH: depth_mm}
    return replace(blank, **answer_of(reading), measures=measures)
