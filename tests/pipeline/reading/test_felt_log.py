"""What was felt pass by pass: kept in a recording, and read from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.soiling.soiled import Soiling
from pipeline.formats.synth import SynthSpec, make_part
from recognition.active.active_reading import ActiveReading
from recognition.active.felt_log import logged_evidence, read_and_log
from recognition.decide.decision import ReadingFlag
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from recognition.touch import TactileReader
from whisker_array.scan.recording import load_scan, save_scan
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import StageSession
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.passes import Pass

HEIGHT_MM, BUDGET_S = 3.0, 7.0


@pytest.fixture(scope="module")
def reader() -> TactileReader:
    return Reader(format="AA99", fonts=("gothic",), height_mm=HEIGHT_MM).touch


def session_of(dirt: float) -> StageSession:
    part = make_part(SynthSpec("AA99", seed=4, height_mm=HEIGHT_MM, soiling=Soiling(severity=dirt)), 0)
    array = VirtualArray(fidelity=Fidelity.POINTWISE, seed=3)
    return VirtualBench(part.height_map, HEIGHT_MM, array, soil=part.soil).mounted().open_session()


@pytest.fixture(scope="module")
def felt(reader: TactileReader) -> ActiveReading:
    """A part so dirty that several choices are made."""
    return read_and_log(reader, session_of(0.8), budget_s=BUDGET_S)


@pytest.fixture(scope="module")
def recording(felt: ActiveReading, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("felt") / "scan.h5"
    assert felt.scan is not None
    save_scan(felt.scan, path)
    return path


def test_a_recording_is_read_as_it_was_felt(
    felt: ActiveReading, recording: Path, reader: TactileReader
) -> None:
    """Its passes, read at once, give the same decision for the same reasons; passes and texts are those of the log."""
    assert len([p for p in felt.passes if p.text]) > 3  # looks, and so choices
    scan = load_scan(recording)
    evidence = logged_evidence(reader, scan)
    assert evidence.log.chosen_passes
    assert evidence.log.scan is not None
    assert evidence.log.scan.log is scan.log
    again = reader.reading_of(evidence)
    assert (again.text, again.decision, again.confidence, again.flags) == (
        felt.reading.text, felt.reading.decision, felt.reading.confidence, felt.reading.flags,
    )  # fmt: skip


def test_texts_of_fewer_passes_still_count_when_the_recording_is_read(reader: TactileReader) -> None:
    scan = read_and_log(reader, session_of(0.0), budget_s=BUDGET_S).scan
    assert scan is not None
    assert scan.log is not None
    assert ReadingFlag.BELIEVED_OTHERWISE not in reader.reading_of(logged_evidence(reader, scan)).flags
    others = frozenset(f"ZZ{number:02d}" for number in range(100))
    other = replace(scan, log=replace(scan.log, other_texts=others))
    assert ReadingFlag.BELIEVED_OTHERWISE in reader.reading_of(logged_evidence(reader, other)).flags


def log_of(scan: Scan) -> list[tuple[Pass, str, str, float]]:
    assert scan.log is not None
    return [(p.order, p.why, p.text, p.confidence) for p in scan.log.passes]


def test_a_recording_keeps_order_plan_and_stop(felt: ActiveReading, recording: Path) -> None:
    kept, scan = load_scan(recording), felt.scan
    assert scan is not None
    assert scan.log is not None
    assert kept.log is not None
    assert log_of(kept) == log_of(scan)
    assert kept.log.array == replace(scan.log.array, body=None)  # what room whiskers take is not kept
    assert kept.log.region_mm is not None
    for name in ("height_mm", "field_mm", "region_mm", "other_texts", "stopped", "problem", "budget_s"):
        assert getattr(kept.log, name) == getattr(scan.log, name)
    for one, other in zip(kept.log.passes, scan.log.passes, strict=True):
        for name in ("moment_n_mm", "flags", "air_n_mm"):
            np.testing.assert_array_equal(getattr(one.sweep, name), getattr(other.sweep, name))
    for mine, theirs in zip(
        kept.sweeps, scan.sweeps, strict=True
    ):  # passes of several lengths, gathered alike
        np.testing.assert_array_equal(mine.moment_n_mm, theirs.moment_n_mm)
        np.testing.assert_array_equal(mine.flags, theirs.flags)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda log: log.__delitem__("along_mm"), "no dataset /log/along_mm"),
        (lambda log: log.__getitem__("along_mm").__setitem__(0, (0.0, 1.0)), "its plan"),
        (lambda log: log.__getitem__("speed_mm_s").__setitem__(1, -1.0), "speed_mm_s is -1"),
        (lambda log: log.attrs.__setitem__("array", "[]"), "no array of whiskers"),
        (
            lambda log: log.attrs.__setitem__("array", '{"n_whiskers": 8, "colour": 1}'),
            "no array of whiskers",
        ),
        (lambda log: log.attrs.__delitem__("field_mm"), "no valid field"),
        (lambda log: log.attrs.__setitem__("budget_s", -1.0), "must be positive"),
        (lambda log: log.attrs.__setitem__("region_mm", (0.0, 0.0, 1.0)), "no valid region"),
        (lambda log: log.attrs.__setitem__("region_mm", (1.0, 0.0, 1.0, 2.0)), "region .* is empty"),
    ],
)
def test_a_log_that_does_not_fit_is_told(recording: Path, tmp_path: Path, damage: object, says: str) -> None:
    path = tmp_path / "scan.h5"
    path.write_bytes(recording.read_bytes())
    with h5py.File(path, "r+") as file:
        damage(file["log"])  # type: ignore[operator]
    with pytest.raises(FileError, match=says):
        load_scan(path)
