"""One part is read alike by whoever reads it: command line, cluster, service, benchmark and library."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest

import pipeline
from glyphs.errors import FileError
from glyphs.soiling.soiled import Soiling
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.listed_parts import ListedParts
from pipeline.benchmark.trials.run import Benchmark, try_part
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import Limits, ReadSettings
from pipeline.formats.find_parts import with_file
from pipeline.formats.part_files import PartFiles
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.part_job import PartJob, read_listed, read_sent
from recognition.see.photo_sizes import SIZES
from recognition.settings import ReaderSettings

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
