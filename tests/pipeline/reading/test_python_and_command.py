"""`Reader` in Python and the command read a part alike to the last bit, whatever it is given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.soiling.soiled import Soiling
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.formats.find_parts import discover
from pipeline.formats.photos import read_photo
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.formats.touch_file import read_part_map, read_scan
from pipeline.reading.as_record import reading_record
from pipeline.reading.part_job import PartJob, read_listed
from recognition.active.felt_log import read_and_log
from recognition.decide.decision import ReadingFlag
from recognition.decide.reading import Reading
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from tests.support.bench_faults import recorded
from whisker_array.estimation.faults import FaultKind
from whisker_array.scan.recording import save_scan
from whisker_array.simulation.traces import Fidelity

SETTINGS = ReadSettings(
    font=("gothic",), format=("AA99",), height_mm=3.0, orientation="upright", fidelity="pointwise"
)
OPTIONS: dict[str, Any] = {
    "fonts": "gothic", "format": "AA99", "height_mm": 3.0, "orientation": "upright",
    "array": VirtualArray(fidelity=Fidelity.POINTWISE),
}  # fmt: skip
READER = Reader(**OPTIONS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of one dirty part, a file of each kind under a name of its own."""
    folder = tmp_path_factory.mktemp("parts")
    spec = SynthSpec("AA99", seed=4, height_mm=3.0, soiling=Soiling(severity=0.5), lights=2)
    write_part(spec, folder / "whole", 0, photos=True)
    top = read_part_map(folder / "whole.npz")
    bench = VirtualBench.mount(
        top.height_map, 3.0, VirtualArray(fidelity=Fidelity.POINTWISE, seed=3), soil=top.soil
    )
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
    return read_listed(PartJob(settings=SETTINGS), listed).record


def by_python(*data: Any) -> Reading:
    """The reading of `Reader.read`."""
    return READER.read(*data)


def same(record: ReadingRecord, reading: Reading) -> None:
    """All that a record keeps of a reading, but for times."""
    other = reading_record(reading, SETTINGS, READER.grammar, part=record.part, seconds=record.seconds)
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
