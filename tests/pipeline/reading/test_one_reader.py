"""One part is read alike by whoever reads it: command line, cluster, service, benchmark and library."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pipeline
from glyphs.errors import FileError
from glyphs.soiling.soiled import Soiling
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.listed_parts import ListedParts
from pipeline.benchmark.trials.run import Benchmark, try_part
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import Limits, ReadSettings
from pipeline.formats.find_parts import discover, with_file
from pipeline.formats.part_files import PartFiles
from pipeline.formats.photos import read_photo
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.formats.touch_file import read_part_map, read_scan
from pipeline.reading.as_record import reading_record
from pipeline.reading.part_job import PartJob, read_listed, read_sent
from recognition.active.felt_log import read_and_log
from recognition.decide.decision import ReadingFlag
from recognition.decide.reading import Reading
from recognition.reader import Reader
from recognition.see.photo_sizes import SIZES
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from recognition.settings import ReaderSettings
from tests.support.bench_faults import recorded
from whisker_array.estimation.faults import FaultKind
from whisker_array.scan.recording import save_scan
from whisker_array.simulation.traces import Fidelity

SETTINGS = ReadSettings(font=("gothic",), format=("AA99",))
FEW_PIXELS = 150_000
"""The first size at which photographs are read here: a quarter of the program's, and of its time."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Path]]:
    """A dirty part whose photograph has more pixels than its characters need, of which few are enough here."""
    stem = tmp_path_factory.mktemp("part") / "part"
    text = write_part(
        SynthSpec("AA99", seed=1, soiling=Soiling(severity=0.2), pixel_mm=0.03), stem, 0, photos=True
    )
    (stem.parent / "truth.csv").write_text(f"part,text\npart,{text}\n", encoding="utf-8")
    photo = pipeline.read_photo(stem.with_suffix(".png"))
    assert photo.shape[0] * photo.shape[1] > 1.5 * FEW_PIXELS, "or there is but one size to read it at"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.see.photo_sizes.SIZES", (FEW_PIXELS, SIZES[-1]))
        yield {"photo": stem.with_suffix(".png"), "height_map": stem.with_suffix(".npz")}


def told(record: ReadingRecord) -> tuple[object, ...]:
    """All but names, times and settings."""
    return (
        record.text,
        record.decision,
        record.confidence,
        record.characters,
        record.height_mm,
        record.source,
    )


def test_whoever_reads_a_part_reads_the_same(files: dict[str, Path], tmp_path: Path) -> None:
    # the same settings for all, that templates are made once; the service reads by whatever files there are
    settings = SETTINGS.model_copy(update={"mode": "fused"})
    listed = PartFiles("part")
    for kind, path in files.items():
        listed = with_file(listed, kind, str(path))
    by_command = read_listed(PartJob(settings=settings), listed).record
    by_cluster = pickle.loads(
        pickle.dumps(read_listed(*pickle.loads(pickle.dumps((PartJob(settings=settings), listed)))))
    )
    sent = PartFiles("part", height_map=str(files["height_map"]), photos=(str(files["photo"]),))
    by_service = read_sent(PartJob(sent, settings, limits=Limits(), folder=tmp_path)).readings[-1]
    assert by_command.error == ""
    assert told(by_command) == told(by_cluster.record) == told(by_service)

    by_library = pipeline.read(*files.values(), fonts="gothic", format="AA99", mode="fused")
    assert (by_library.text, by_library.decision) == (by_command.text, by_command.decision)
    assert by_library.confidence == pytest.approx(by_command.confidence, abs=1e-6)  # as the record rounds

    folder = files["photo"].parent
    parts = ListedParts.of_files([str(folder)], folder / "truth.csv", Condition(format="AA99"))
    (trial,) = try_part(Benchmark(parts, ("fused",), ReaderSettings(fonts=("gothic",))), parts.items()[0])
    assert (trial.error, trial.text, trial.decision) == ("", by_command.text, by_command.decision)
    assert trial.confidence == pytest.approx(by_command.confidence, abs=1e-6)
    assert [c.char for c in trial.characters] == [c.char for c in by_command.characters]


def test_the_library_uses_the_soil_of_the_file_and_verifies(files: dict[str, Path]) -> None:
    reading = pipeline.read(files["height_map"], fonts="gothic", format="AA99", expected="ZZ00")
    assert reading.source == "tactile"
    assert reading.trace.verification is not None
    assert reading.trace.verification.verdict == "refuted"
    with pytest.raises(FileError, match="is a second height map beside"):
        pipeline.read(files["height_map"], "other.x3p")


UPRIGHT = ReadSettings(font=("gothic",), format=("AA99",), height_mm=3.0, orientation="upright")
OPTIONS: dict[str, Any] = {
    "fonts": "gothic", "format": "AA99", "height_mm": 3.0, "orientation": "upright",
}  # fmt: skip
READER = Reader(**OPTIONS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of one dirty part, a file of each kind under a name of its own."""
    folder = tmp_path_factory.mktemp("parts")
    spec = SynthSpec("AA99", seed=4, height_mm=3.0, soiling=Soiling(severity=0.5), lights=2)
    write_part(spec, folder / "whole", 0, photos=True)
    top = read_part_map(folder / "whole.npz")
    bench = VirtualBench(
        top.height_map, 3.0, VirtualArray(fidelity=Fidelity.POINTWISE, seed=3), soil=top.soil
    ).mounted()
    scan = bench.scan()
    save_scan(scan, folder / "scan.h5")
    dead = recorded(scan, rng=np.random.default_rng(1), fault=FaultKind.DEAD)
    save_scan(dead, folder / "faults.h5")
    chosen = read_and_log(READER.touch, bench.open_session(), budget_s=4.0)
    assert chosen.scan is not None
    save_scan(chosen.scan, folder / "chosen.h5")
    return folder


def by_command(*files: Path) -> ReadingRecord:
    """The record of the command `read`."""
    (listed,) = discover(list(map(str, files)))
    named = {Path(file).name for file in listed.files}
    assert named == {file.name for file in files}
    return read_listed(PartJob(settings=UPRIGHT), listed).record


def by_python(*data: Any) -> Reading:
    """The reading of `Reader.read`."""
    return READER.read(*data)


def same(record: ReadingRecord, reading: Reading) -> None:
    """All that a record keeps of a reading, but for times."""
    other = reading_record(reading, UPRIGHT, READER.grammar, part=record.part, seconds=record.seconds)
    assert record.error == ""
    assert replace(other, at=record.at) == replace(record, settings=other.settings)


def lights(folder: Path) -> list[Path]:
    return sorted(folder.glob("whole.*.png")) or sorted(folder.glob("whole*.png"))


@pytest.mark.parametrize("name", ["scan.h5", "chosen.h5", "faults.h5"])
def test_a_scan(folder: Path, name: str) -> None:
    reading = by_python(read_scan(folder / name))
    assert reading.evidence is not None
    assert reading.evidence.touch is not None
    assert reading.evidence.touch.log.chosen_passes == (name == "chosen.h5")
    assert bool(reading.flags & ReadingFlag.WHISKER_FAULTY) == (name == "faults.h5")
    same(by_command(folder / name), reading)


def test_a_height_map(folder: Path, tmp_path: Path) -> None:
    file = copied(folder / "whole.npz", tmp_path)
    top = read_part_map(file)
    same(by_command(file), READER.read(top.height_map, soil=top.soil, part_id="part"))


def test_touch_and_camera(folder: Path, tmp_path: Path) -> None:
    photo = copied(lights(folder)[0], tmp_path)
    for name in ("whole.npz", "chosen.h5"):
        file = copied(folder / name, tmp_path)
        if name.endswith("npz"):
            top = read_part_map(file)
            reading = READER.read(top.height_map, read_photo(photo), soil=top.soil, part_id="part")
        else:
            reading = by_python(read_scan(file), read_photo(photo))
        assert reading.source == "fused"
        same(by_command(file, photo), reading)
        file.unlink()


def copied(file: Path, folder: Path, stem: str = "part") -> Path:
    """A copy of a file under another name."""
    copy = folder / f"{stem}{file.suffix}"
    copy.write_bytes(file.read_bytes())
    return copy
