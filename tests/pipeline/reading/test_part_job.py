from __future__ import annotations

import errno
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib
import numpy as np
import pytest

from glyphs.errors import FileError, report_damage
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind
from pipeline.common.settings import Limits, ReadSettings
from pipeline.errors import FaultError, OwnFileError
from pipeline.formats.part_files import PartFiles
from pipeline.formats.photos import read_photo
from pipeline.formats.synth import SynthSpec, make_part, write_part
from pipeline.reading.part_job import PartJob, read_sent
from pipeline.reading.readers import reader_of
from pipeline.reading.scan_plan import plan_of
from pipeline.reading.triage import ReadPart
from pipeline.service.stage import ScanOrder, SimulatedStage
from tests.support.certificates import written
from tests.support.scans import feel_plan

LIMITS = Limits()
SETTINGS = ReadSettings(font=("gothic",), height_mm=5.0)
UNSURE = ReadSettings(font=("gothic",), height_mm=5.0, line=("lot=A9",))
"""The part has no such line: every photograph asks for touch."""
FRAMES_AGREE_MM = 0.6
"""The part lies up to half a millimetre from where the camera's stage believes it."""


def read(
    folder: Path,
    settings: ReadSettings = SETTINGS,
    *,
    earlier: bool = False,
    names: Mapping[str, str] = MappingProxyType({}),
    limits: Limits = LIMITS,
    photo: Path | None = None,
    more_photos: tuple[Path, ...] = (),
    expected: str = "",
    **files: Any,
) -> ReadPart:
    """What a job makes of a part's files."""
    given = {kind: str(one) if isinstance(one, Path) else one for kind, one in files.items()}
    part = PartFiles("part", photos=tuple(map(str, (photo, *more_photos) if photo else ())), **given)
    return read_sent(
        PartJob(part, settings, expected, limits, earlier=earlier, folder=folder, names=dict(names))
    )


class Parts:
    """A clean part on a plate, as files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        spec = SynthSpec("AA99", seed=7)
        self.text = write_part(spec, folder / "part", 0, photos=True)
        self.photo, self.map = folder / "part.png", folder / "part.npz"
        self.size_mm = make_part(spec, 0).height_map.size_mm


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    return Parts(tmp_path_factory.mktemp("parts"))


@pytest.fixture(scope="module")
def unsure(parts: Parts, tmp_path_factory: pytest.TempPathFactory) -> ReadPart:
    """What a job makes of a photograph that is not sure enough."""
    return read(tmp_path_factory.mktemp("unsure"), UNSURE, photo=parts.photo, expected=parts.text)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "work"
    made.mkdir()
    return made


def kinds(done: ReadPart) -> list[EvidenceKind]:
    return [made.kind for made in done.pictures]


def middle(record: ReadingRecord) -> np.ndarray:
    """Of the line, x and y."""
    boxes = np.array([c.box_mm for c in record.characters])
    return np.array([boxes[:, [0, 2]].mean(), boxes[:, [1, 3]].mean()])


def test_unsure_photograph_asks_for_touch_around_the_line(parts: Parts, unsure: ReadPart) -> None:
    done = unsure
    assert done.plan is not None
    x0, y0, x1, y1 = done.plan.region_mm
    boxes = np.array([c.box_mm for c in done.readings[0].characters])
    assert x0 <= boxes[:, 0].min()
    assert y0 <= boxes[:, 1].min()
    assert x1 >= boxes[:, 2].max()
    assert y1 >= boxes[:, 3].max()
    assert x0 >= 0.0
    assert x1 <= parts.size_mm[0] + 0.06
    assert done.plan.directions_deg == (0, 90, 180, 270)
    assert done.plan.seconds > 0.0
    assert parts.text in done.plan.reason


def test_scan_of_the_plan_is_fused_with_the_earlier_photograph(
    parts: Parts, unsure: ReadPart, folder: Path
) -> None:
    done = unsure
    assert done.plan is not None
    scan = feel_plan(SimulatedStage(parts.folder), ScanOrder("part", done.plan), folder)
    later = read(folder, scan=scan, photo=parts.photo, expected=parts.text, earlier=True)
    (reading,) = later.readings
    assert (reading.source, reading.text, reading.decision) == ("fused", parts.text, "accept")
    assert reading.verdict == "confirmed"
    assert done.readings[0].decision == "review"
    # the recording lies in the photograph's frame
    assert np.abs(middle(reading) - middle(done.readings[0])).max() < FRAMES_AGREE_MM
    assert kinds(later) == [EvidenceKind.EDGES_PICTURE]


def test_photo_and_height_map_give_two_readings_in_the_plate_frame(parts: Parts, folder: Path) -> None:
    done = read(folder, height_map=parts.map, photo=parts.photo)
    seen, both = done.readings
    assert (seen.source, both.source) == ("vision", "fused")
    assert seen.text == both.text == parts.text
    assert np.abs(middle(seen) - middle(both)).max() < FRAMES_AGREE_MM
    assert kinds(done) == [EvidenceKind.PHOTO_PICTURE, EvidenceKind.EDGES_PICTURE]
    assert done.plan is None


def test_several_photographs_are_read_as_one_and_one_that_cannot_be_is_called_as_its_sender_did(
    parts: Parts, folder: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "photo-2.png"
    broken.write_bytes(b"no picture")
    sent = read(folder, photo=parts.photo, more_photos=(broken,), names={str(broken): "left lamp.png"})
    (reading,) = sent.readings
    assert (reading.text, reading.photos) == (parts.text, 1)
    (note,) = [message for message in reading.messages if "read without one of its photographs" in message]
    assert "left lamp.png: is not a picture" in note
    assert str(tmp_path) not in note


def test_expected_text_that_the_format_forbids_is_told(parts: Parts, folder: Path) -> None:
    settings = SETTINGS.model_copy(update={"format": ("AA99",)})
    with pytest.raises(FileError, match=r"^expected: is '12'"):
        read(folder, settings, photo=parts.photo, expected="12")


def test_job_without_anything_to_read_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a job has"):
        read(tmp_path)
    with pytest.raises(ValueError, match="an earlier photo goes with"):
        read(tmp_path, photo=tmp_path / "b", earlier=True)


def test_database_that_cannot_be_used_is_told_by_its_name(parts: Parts, folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "dies.npz"
    path.write_bytes(b"no database")
    settings = SETTINGS.model_copy(update={"database": path})
    with pytest.raises(OwnFileError) as caught:
        read(folder, settings, photo=parts.photo)
    assert str(caught.value).startswith("dies.npz: ")
    assert str(tmp_path) not in str(caught.value)


@pytest.mark.parametrize(
    ("raised", "own"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), True),
        (OSError(errno.EIO, "Input/output error"), True),
        (MemoryError(), True),
        (ValueError("cut short"), False),
    ],
)
def test_a_disk_or_memory_that_fails_at_a_file_is_not_the_files_fault(
    parts: Parts, folder: Path, monkeypatch: pytest.MonkeyPatch, raised: Exception, own: bool
) -> None:
    def failing(*_: object, **__: object) -> None:
        with report_damage(parts.photo, kind="picture"):
            raise raised

    monkeypatch.setattr("pipeline.reading.part_reader.PartReader.read", failing)
    with pytest.raises(FileError) as caught:
        read(folder, photo=parts.photo)
    assert isinstance(caught.value, OwnFileError) == own


def test_without_a_scale_the_whole_field_is_asked_for(parts: Parts) -> None:
    photo = replace(read_photo(parts.photo), pitch_mm=None)
    plan = plan_of(None, photo, ReadSettings(), field_mm=(50.0, 20.0), reason="unsure")
    assert plan.region_mm == (0.0, 0.0, 50.0, 20.0)
    assert plan.middle_mm is None
    assert plan.reason == "unsure"


def test_a_fault_of_the_program_is_not_put_down_to_the_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: ReadSettings, **__: object) -> None:
        raise ZeroDivisionError("no marks")

    monkeypatch.setattr("pipeline.reading.readers.reader_of", broken)
    says = r"fault of the program \(ZeroDivisionError: no marks\); please report it"
    with pytest.raises(FaultError, match=says):
        read(folder, photo=folder / "photo.png")


FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"


@pytest.mark.parametrize("edited", ["lexicon", "font", "certificate"])
def test_a_reader_is_made_anew_when_a_file_of_its_settings_changes(edited: str, tmp_path: Path) -> None:
    lexicon, font, certificate = tmp_path / "known.txt", tmp_path / "die.ttf", tmp_path / "c.json"
    lexicon.write_text("AB12\n", encoding="utf-8")
    shutil.copy(FONTS / "DejaVuSans.ttf", font)
    named = ReadSettings(format=("AA99",), lexicon=lexicon, font=(str(font),))
    settings = named.model_copy(update={"certificate": written(certificate, named)})
    before = reader_of(settings)
    assert reader_of(settings) is before
    assert before.settings.certified is not None

    if edited == "lexicon":
        lexicon.write_text("AB12\nCD34\n", encoding="utf-8")
    elif edited == "font":
        shutil.copy(FONTS / "DejaVuSansMono.ttf", font)
    else:
        written(certificate, ReadSettings(format=("A9",)))  # what it was made with, too, is others' now
    after = reader_of(settings)
    assert after is not before
    assert reader_of(settings) is after
    if edited == "lexicon":
        assert [bool(reader.grammar.objections("CD34")) for reader in (before, after)] == [True, False]
    if edited == "certificate":
        assert after.settings.certified is not None
        assert after.settings.certified.sources == ()
