"""A run of a benchmark and its journal: resumed, parallel, with faults; peers; folders; what a mode is charged for."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.fonts.serials import FormatError
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.analysis.statistics import plain, statistics_of
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.listed_parts import ListedParts
from pipeline.benchmark.exam.specimens import Item, Specimen
from pipeline.benchmark.readers import modes as benchmark_modes
from pipeline.benchmark.readers.mode import ModeUnavailableError, PartReadings, scan_seconds
from pipeline.benchmark.readers.modes import open_mode
from pipeline.benchmark.trials.journal import Trial, TrialJournal, answer_of
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from pipeline.common.settings import SettingsError
from pipeline.workers.pool import WorkPool
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.reading import Candidate, CharacterReading, Reading
from recognition.language.box import Box
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.settings import ReaderSettings
from tests.factories import designed_parts
from tests.support.run_tables import Counted
from whisker_array.simulation.traces import Fidelity

FAST = ReaderSettings(array=VirtualArray(fidelity=Fidelity.POINTWISE))


@dataclass(frozen=True)
class Blanks:
    """Parts without a mark, whose truth is their number; part 2 cannot be made."""

    count: int
    seed: int = 0

    def items(self) -> list[Item]:
        return [Item(f"b{n}", n, Condition(severity=0.5, format="99")) for n in range(self.count)]

    def make(self, item: Item) -> Specimen:
        if item.number == 2:
            raise FileError("b2", "is broken", "correct it")
        plate = HeightMap(np.zeros((20, 20), dtype=np.float32), 0.1)
        return Specimen(item.part, f"{item.number:02d}", plate, None, None, None)

    def font_of(self, condition: Condition) -> str:
        return condition.font

    def description(self) -> dict[str, Any]:
        return {"seed": self.seed}


@dataclass
class Echo:
    """Reads the truth; every third part it does not read at all."""

    reader: Reader
    uses: tuple[str, ...] = ()
    seen: list[str] = field(default_factory=list)

    def read(self, senses: PartReadings) -> tuple[Reading, dict[str, Any]]:
        self.seen.append(senses.specimen.part)
        if int(senses.specimen.truth) % 3 == 1:
            raise ZeroDivisionError("a fault\nof the program")
        characters = tuple(
            CharacterReading((Candidate(c, 1.0, 0.75), Candidate("x", 0.0, 0.25)), Box(0, 0, 1, 1))
            for c in senses.specimen.truth
        )
        return Reading(characters, 0.5), {}


@pytest.fixture(autouse=True)
def echo(monkeypatch: pytest.MonkeyPatch) -> None:
    from pipeline.benchmark.trials import run as benchmark

    monkeypatch.setitem(benchmark_modes.MODES, "echo", Echo)
    benchmark._mode.cache_clear()


def told(trials: list[Trial]) -> list[Trial]:
    """Without the times, which differ from run to run."""
    return [replace(t, compute_s=0.0) for t in trials]


def test_a_fault_in_one_part_is_a_row_with_its_error(tmp_path: Path) -> None:
    trials = run_benchmark(Benchmark(Blanks(5), ("echo",), FAST), tmp_path)
    assert [t.text for t in trials] == ["00", "", "", "03", ""]
    assert [t.error for t in trials] == [
        "", "ZeroDivisionError: a fault of the program", "the part: FileError: b2: is broken; correct it", "",
        "ZeroDivisionError: a fault of the program",
    ]  # fmt: skip
    assert [t.right for t in trials] == [True, False, False, True, False]
    assert trials[0].characters[0].margin == 0.5


def test_a_run_goes_on_where_it_was_broken_off(tmp_path: Path) -> None:
    """Broken off after two parts, it ends as if it had not been."""
    benchmark = Benchmark(Blanks(6), ("echo",), FAST)
    whole = run_benchmark(benchmark, tmp_path / "whole")

    with pytest.raises(KeyboardInterrupt):
        run_benchmark(benchmark, tmp_path / "broken", progress=Counted(stop_after=2))
    assert set(TrialJournal.read(tmp_path / "broken").done) == {"b0", "b1"}
    counted = Counted()
    resumed = run_benchmark(benchmark, tmp_path / "broken", progress=counted)
    assert counted.starts == [(6, 2)]
    assert counted.parts == 4
    assert counted.failed == 2
    assert told(resumed) == told(whole)
    assert json.dumps(plain(list(statistics_of(resumed).by_mode))) == json.dumps(
        plain(list(statistics_of(whole).by_mode))
    )


def test_more_parts_go_on_where_fewer_ended_and_fewer_leave_the_rest_out(tmp_path: Path) -> None:
    few = run_benchmark(Benchmark(Blanks(2), ("echo",), FAST), tmp_path)
    more = run_benchmark(Benchmark(Blanks(4), ("echo",), FAST), tmp_path)
    assert more[:2] == few
    assert run_benchmark(Benchmark(Blanks(2), ("echo",), FAST), tmp_path) == few


def test_another_benchmark_in_the_folder_is_refused(tmp_path: Path) -> None:
    run_benchmark(Benchmark(Blanks(1), ("echo",), FAST), tmp_path)
    with pytest.raises(FileError, match=r"parts.seed was 0, now 7.*name another one"):
        run_benchmark(Benchmark(Blanks(1, seed=7), ("echo",), FAST), tmp_path)


def test_the_parts_of_a_seed_are_all_kinds_in_turn() -> None:
    parts = designed_parts(severities=(0.0, 0.6), formats=("A9", "99"), parts=2, seed=3)
    items = parts.items()
    assert [i.part for i in items[:4]] == [
        "gothic-A9-0-0000", "gothic-A9-0.6-0000", "gothic-99-0-0000", "gothic-99-0.6-0000",
    ]  # fmt: skip
    assert len({i.part for i in items}) == 8
    clean, dirty = parts.make(items[0]), parts.make(items[1])
    assert clean.truth == dirty.truth  # the same part, clean and dirty
    assert clean.line_mm == dirty.line_mm
    assert not np.array_equal(clean.height_map.z_mm, dirty.height_map.z_mm)
    with pytest.raises(FormatError):
        designed_parts(formats=("",))


def test_two_workers_say_what_one_says_and_the_scan_takes_its_time(tmp_path: Path) -> None:
    benchmark = Benchmark(designed_parts(severities=(0.0, 0.3), formats=("99",), seed=2), ("tactile",), FAST)
    alone = run_benchmark(benchmark, tmp_path / "one")
    with WorkPool(2) as executor:
        shared = run_benchmark(benchmark, tmp_path / "two", executor=executor)
    assert told(alone) == told(shared)
    assert not any(t.error for t in alone)
    assert alone[0].text == alone[0].truth
    assert all(t.compute_s > 0.0 and t.scan_s > 1.0 for t in alone)


def test_a_scans_time_is_that_of_its_plan() -> None:
    from recognition.see.virtual_bench import VirtualBench
    from whisker_array.whisker.array import default_plan

    plate = HeightMap(np.zeros((60, 60), dtype=np.float32), 0.1)
    plan = default_plan((0.0, 0.0, 5.9, 5.9), character_height_mm=5.0)
    scan = VirtualBench(plate, 5.0, VirtualArray(fidelity=Fidelity.POINTWISE)).scan(plan)
    assert scan_seconds(scan) == pytest.approx(plan.scan_time_s)


def test_modes_that_cannot_run_say_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SettingsError, match="no mode 'smell'; the modes are tactile"):
        open_mode("smell", Reader(FAST))

    def never(_: Reader) -> Any:
        raise ModeUnavailableError("smell: no nose; fit one")

    monkeypatch.setitem(benchmark_modes.MODES, "smell", never)
    with pytest.raises(ModeUnavailableError, match="fit one"):
        run_benchmark(Benchmark(Blanks(1), ("echo", "smell"), FAST), tmp_path)
    assert not (tmp_path / TrialJournal.file).exists()


def test_parts_of_a_folder(tmp_path: Path) -> None:
    from pipeline.formats.npz import write_npz

    plate = HeightMap(np.zeros((20, 20), dtype=np.float32), 0.1)
    for name in ("a", "b", "stray"):
        write_npz(tmp_path / f"{name}.npz", plate)
    table = tmp_path / "truth.csv"
    table.write_text("part,text\na,0 3\nb.npz,06\ngone,1\n")
    parts = ListedParts.of_files([str(tmp_path)], table, Condition(format="99"))
    assert [(i.part, i.truth) for i in parts.items()] == [("a", "03"), ("b", "06")]
    trials = run_benchmark(Benchmark(parts, ("echo",), FAST), tmp_path / "out")
    assert [t.text for t in trials] == ["03", "06"]
    assert {(t.severity, t.levels["format"]) for t in trials} == {(None, "99")}
    table.write_text("part,text\nother,1\n")
    with pytest.raises(FileError, match="no row for these parts"):
        ListedParts.of_files([str(tmp_path)], table, Condition(severity=0.3))


SEEDED = {"seed": 1}
TRIAL = Trial(
    "p", 0, {"severity": 0.3, "font": "gothic"}, "tactile", "A1", "A1", compute_s=1.0, simulated_s=0.25
)


def test_a_book_comes_back_as_it_was(tmp_path: Path) -> None:
    with TrialJournal(tmp_path, SEEDED) as book:
        book.keep("p", (TRIAL,))
    for again in (TrialJournal.read(tmp_path), TrialJournal(tmp_path, SEEDED)):
        (trial,) = again.done["p"]
        assert asdict(trial) == asdict(TRIAL)


def test_a_book_that_may_not_be_written_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with TrialJournal(tmp_path, SEEDED) as book:
        book.keep("p", (TRIAL,))
    monkeypatch.setattr("os.access", lambda *_: False)  # the tests may run as root
    before = book.path.stat().st_mtime_ns
    assert "p" in TrialJournal.read(tmp_path).done
    assert book.path.stat().st_mtime_ns == before


def test_a_mode_is_charged_for_what_it_needs_and_the_scan_is_told_apart() -> None:
    steps = {"mount": 0.125, "scan": 0.5, "edge map": 0.25, "search": 1.0}
    reading = Reading((), 0.0, (Finding.of(ReadingFlag.NO_CHARACTERS),), seconds=MappingProxyType(steps))
    trial = replace(Trial("p", 0, {}, "m", "A"), **answer_of(reading), compute_s=4.0)
    assert (trial.compute_s, trial.simulated_s, trial.reading_s) == (4.0, 0.625, 3.375)


def test_a_reading_that_tells_no_steps_is_all_reading() -> None:
    trial = replace(TRIAL, simulated_s=0.0)
    assert trial.reading_s == trial.compute_s
    # a clock's steps may add up to a little more than what was measured around them
    assert replace(TRIAL, simulated_s=2.0).reading_s == 0.0
