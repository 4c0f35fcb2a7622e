"""Run a benchmark: several workers make every part once and read it by every mode; results are stored at once. A part
depends only on its seed or files, not on workers, order or interruptions."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError
from pipeline.benchmark.exam.condition import PERTURBED, Condition, given_levels
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Item, Parts
from pipeline.benchmark.readers.mode import Mode, PartReadings
from pipeline.benchmark.readers.modes import MODES, open_mode, whiskers_in
from pipeline.benchmark.trials.journal import Trial, TrialJournal, answer_of
from pipeline.common.settings import SettingsError
from pipeline.common.version import file_sha256, program_mark
from pipeline.reading.perturbation import Perturbation
from pipeline.runs.journal import resumable
from pipeline.runs.progress import Progress
from pipeline.workers.executors import Executor
from recognition.decide.risk_text import USUAL_RISK
from recognition.decide.score import FITTED
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.settings import ReaderSettings
from whisker_array.scan.sensor import Sensors
from whisker_array.simulation.traces import Fidelity

# of a worker: a design with many fonts and heights needs one for each, with about 0.1 GB
KEPT_READERS = 12


@dataclass(frozen=True)
class Benchmark:
    """Parts, modes (at least one, each once: SettingsError) and settings of a benchmark."""

    parts: Parts
    modes: tuple[str, ...]
    # for all parts; font, height and format are those of the part if the design gives them
    reading: ReaderSettings
    # under which every part is read again, by the modes that they affect
    perturbations: tuple[Perturbation, ...] = ()

    def __post_init__(self) -> None:
        if not self.modes or len(set(self.modes)) != len(self.modes):
            raise SettingsError(
                f"the modes are {', '.join(self.modes) or 'none'}", hint="give at least one, each once"
            )

    def description(self) -> dict[str, Any]:
        """Everything on which the answers depend, except the number of parts, as JSON values."""
        reading, files = self.reading, whiskers_in(self.modes)
        return {
            "parts": self.parts.description(),
            "modes": list(self.modes),
            "reading": {
                "fonts": [str(font) for font in reading.fonts],
                "format": reading.format,
                "fidelity": reading.array.fidelity.value,
                "sensors": reading.array.sensors.value,
                **({} if reading.array.whisker is None else {"whisker": reading.array.whisker.whisker}),
                **({} if reading.array.speed_mm_s is None else {"speed_mm_s": reading.array.speed_mm_s}),
                "orientation": reading.orientation.value,
                "accept_risk": reading.accept_risk,
                **({"experts": list(reading.experts)} if reading.experts else {}),
                **({} if reading.certified is None else {"certified": asdict(reading.certified)}),
            },
            **({"whiskers": {str(path): file_sha256(path) for path in files}} if files else {}),
            "scores": json.loads(FITTED.read_text(encoding="utf-8"))["scores"],
            "program": program_mark(),
            **({"perturbations": [asdict(p) for p in self.perturbations]} if self.perturbations else {}),
        }

    @property
    def accept_risk(self) -> float:
        risk = self.reading.accept_risk
        return USUAL_RISK if risk is None else risk

    @property
    def crossed(self) -> tuple[str, ...]:
        return tuple(self.parts.description().get("cross", ("severity",)))

    def settings_for(self, condition: Condition, facts: str) -> ReaderSettings:
        font = self.parts.font_of(condition) if "font" in facts else ""
        return replace(
            self.reading,
            fonts=(font,) if font else self.reading.fonts,
            format=(condition.format or self.reading.format) if "format" in facts else None,
            height_mm=condition.height_mm if "height" in facts else self.reading.height_mm,
        )


def run_benchmark(
    benchmark: Benchmark,
    folder: Path,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Trial]:
    """Run the trials of every part that is not in the folder yet; return all, by part, facts, perturbation and mode.
    Raises FileError: the folder is not usable. ModeUnavailableError: a mode cannot run here. SettingsError."""
    items = benchmark.parts.items()
    ways = ((item.condition, facts) for item in items for facts in item.given)
    for settings in dict.fromkeys(benchmark.settings_for(*way) for way in ways):
        for mode in benchmark.modes:
            open_mode(mode, Reader(settings))

    with TrialJournal(folder, benchmark.description()) as book:
        if progress:
            progress.start(len(items), sum(item.part in book.names for item in items))
        lost = partial(_failed_trials, benchmark)
        for _, trials in resumable(
            book, items, executor or Executor(), try_part, benchmark, lost=lost, name="part"
        ):
            if progress:
                progress.advance(failed=any(t.error for t in trials))
        done = book.done
    return [trial for item in items for trial in done[item.part]]


def try_part(benchmark: Benchmark, item: Item) -> tuple[Trial, ...]:
    """Make one part and read it by every mode, also perturbed; a failure is recorded in the trial."""
    try:
        specimen = benchmark.parts.make(item)
    except Exception as error:
        return _failed_trials(benchmark, item, error)
    trials: list[Trial] = []
    for facts in item.given:
        reader = reader_for(benchmark.settings_for(item.condition, facts))
        senses = PartReadings(specimen, reader)
        blanks = _blanks(benchmark, replace(item, given=(facts,), truth=specimen.truth))
        trials += [_read(blank, senses, reader) for blank in blanks]
        for how in benchmark.perturbations:
            again = senses.again(how)
            reached = [b for b in blanks if how.reaches(_mode(b.mode, reader).uses)]
            trials += [
                _read(replace(b, levels={**b.levels, PERTURBED: how.name}), again, reader) for b in reached
            ]
    return tuple(trials)


def _blanks(benchmark: Benchmark, item: Item) -> list[Trial]:
    return [
        Trial(item.part, item.number, {**item.condition.levels, **given_levels(facts)}, mode, item.truth)
        for facts in item.given
        for mode in benchmark.modes
    ]


def _failed_trials(benchmark: Benchmark, item: Item, error: Exception) -> tuple[Trial, ...]:
    return tuple(replace(b, error=f"the part: {_describe(error)}") for b in _blanks(benchmark, item))


def _read(blank: Trial, senses: PartReadings, reader: Reader) -> Trial:
    start, before = time.perf_counter(), sum(senses.seconds.values())
    # a fault of the program in one part must not end the run; the trial records it
    try:
        mode, own_mode = _mode(blank.mode, reader), blank.mode in MODES
        reading, more = mode.read(senses)
        measures = reading.measures if own_mode else {}
    except Exception as error:
        return replace(blank, error=_describe(error))
    reading_s = time.perf_counter() - start - (sum(senses.seconds.values()) - before)
    used = sum(senses.seconds.get(sense, 0.0) for sense in mode.uses)
    answer = {
        **answer_of(reading),
        "measures": {name.value: value for name, value in measures.items()},
        "compute_s": round(reading_s + used, 4),
        "scan_s": round(senses.scan_s, 3) if {"touch", "felt"} & set(mode.uses) else 0.0,
    }
    return replace(blank, **{**answer, **more})


@lru_cache(maxsize=KEPT_READERS)
def reader_for(settings: ReaderSettings) -> Reader:
    """Reader for some settings; cached, so that a worker predicts templates once."""
    return Reader(settings)


@lru_cache(maxsize=4 * KEPT_READERS)
def _mode(name: str, reader: Reader) -> Mode:
    return open_mode(name, reader)


def _describe(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"[:500]


def remake(description: Mapping[str, Any], parts: Iterable[str]) -> tuple[Benchmark, dict[str, Item]]:
    """Rebuild a benchmark, and some of its items, from the description in its journal. Raises MarksError: parts or
    whiskers are in files, or its design lacks a font or soil here."""
    wanted, source_values = set(parts), description["parts"]
    if "part" not in source_values:
        raise SettingsError("its parts are in files", hint="only parts of a design are drawn")
    if "whisker" in description["reading"]:
        raise SettingsError("it was felt with a whisker file", hint="only parts felt as usual are drawn")
    values = {name: value for name, value in source_values.items() if name != "font_files"}
    if not values.get("section"):
        # a part's name ends in its number within its cell; a longer design begins with the same parts
        values["parts_a_cell"] = 1 + max((int(part.rpartition("-")[2]) for part in wanted), default=0)
    source = DesignedParts(Design.of(**values))
    items = {item.part: item for item in source.items()}
    if not wanted <= set(items):
        raise MarksError("the design does not contain all of these parts")
    if source.description().get("font_files") != source_values.get("font_files"):
        raise MarksError("its fonts differ from those installed here")
    reading = description["reading"]
    settings = ReaderSettings(
        fonts=tuple(reading["fonts"]),
        format=reading["format"],
        array=VirtualArray(
            sensors=Sensors(reading["sensors"]),
            fidelity=Fidelity(reading["fidelity"]),
            given_speed_mm_s=reading.get("speed_mm_s"),
        ),
        orientation=Orientation(reading["orientation"]),
        accept_risk=reading["accept_risk"],
    )
    return Benchmark(source, tuple(description["modes"]), settings), {name: items[name] for name in wanted}
