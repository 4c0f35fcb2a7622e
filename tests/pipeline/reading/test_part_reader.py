"""Which senses read a part, with readers that answer at once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.errors import FileError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from pipeline.common.settings import ReadSettings
from pipeline.formats.find_parts import discover
from pipeline.formats.grid import PartMap
from pipeline.formats.npz import soil_members, write_npz
from pipeline.formats.part_files import PartFiles
from pipeline.formats.photos import write_photo
from pipeline.reading.part_reader import PartReader, read_surface, senses_of
from recognition.decision.decide import ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.verify import Verdict, VerifyError
from recognition.language.lattice import Lattice
from recognition.reader import Reader
from recognition.senses.settings import ReaderSettings
from tests.support.readings import reading_of

SHAPE = (20, 30)


def lattice(text: str) -> Lattice:
    return Lattice(tuple("AB12"), np.log([[0.999 if c == t else 1e-5 for c in "AB12"] for t in text]))


class FakeReader(Reader):
    """Touch reads A1 and vision B1, whatever they are given; what they are given is kept.

    `openly` is what the camera would have read without a format.
    """

    def __init__(self, format: str | None = None, openly: str = "B1") -> None:
        super().__init__(fonts=["gothic"], format=format)
        self.openly = openly
        self.given: list[Any] = []
        self.asked: list[str] = []

    @property
    def touch(self) -> Any:
        self.asked.append("touch")

        def read_height_map(
            height_map: HeightMap, *, soil: Soil | None = None, part_id: str = "", feel: object = None
        ) -> Reading:
            self.given.append((height_map, soil, part_id))
            return reading_of("A1", source="tactile").with_trace(
                lattice=lattice("A1"), open_lattice=lattice("A1"), height_map=height_map
            )

        return SimpleNamespace(read_height_map=read_height_map)

    @property
    def vision(self) -> Any:
        self.asked.append("vision")

        def read_photo(photo: Photo) -> Reading:
            self.given.append(photo)
            return reading_of("B1", source="vision").with_trace(
                lattice=lattice("B1"), open_lattice=lattice(self.openly), photo=photo
            )

        return SimpleNamespace(read_photo=read_photo)


def fused_as(
    monkeypatch: pytest.MonkeyPatch,
    seen: list[Any],
    *,
    lattice: Any = None,
    flags: ReadingFlag = ReadingFlag.NONE,
) -> None:
    """Fusion that says so."""

    def fuse(touch: Reading, vision: Reading, settings: ReaderSettings) -> Reading:
        seen.append((touch.text, vision.text, settings.format))
        return reading_of("A1", source="fused", flags=flags).with_trace(touch=touch, vision=vision)

    def fused_lattice(touch: Reading, vision: Reading, *, before_format: bool = False) -> Any:
        seen.append((touch.text, vision.text, before_format))
        return lattice

    monkeypatch.setattr("recognition.decision.fuse.fuse", fuse)
    monkeypatch.setattr("recognition.decision.fuse.fused_lattice", fused_lattice)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    soil = Soil(
        np.full(SHAPE, 0.01, np.float32), np.full(SHAPE, 5.0, np.float32), np.full(SHAPE, 0.2, np.float32)
    )
    surface = HeightMap(np.zeros(SHAPE, np.float32), 0.1)
    photo = Photo(np.full((16, 24), 90, np.uint8), pitch_mm=0.05)
    write_npz(tmp_path / "both.npz", surface, more=soil_members(soil))
    write_photo(tmp_path / "both.png", photo)
    write_npz(tmp_path / "felt.npz", surface)
    write_photo(tmp_path / "seen.png", photo)
    return tmp_path


def part(folder: Path, name: str) -> PartFiles:
    (found,) = discover([str(folder / f"{name}.*")])
    return found


TOUCH, VISION, BOTH = (True, False), (False, True), (True, True)


@pytest.mark.parametrize(
    ("mode", "felt", "seen", "both"),
    [
        ("tactile", TOUCH, None, TOUCH),
        ("vision", None, VISION, VISION),
        ("fused", None, None, BOTH),
        ("auto", TOUCH, VISION, BOTH),
    ],
)
def test_modes(mode: Any, felt: Any, seen: Any, both: Any, folder: Path) -> None:
    for name, senses in (("felt", felt), ("seen", seen), ("both", both)):
        if senses is None:
            with pytest.raises(FileError, match=rf"{name}\.(npz|png): has no .*; add one"):
                senses_of(part(folder, name), mode)
        else:
            assert senses_of(part(folder, name), mode) == senses


def test_touch_is_given_the_soil(folder: Path) -> None:
    reader = FakeReader()
    found = PartReader(reader, ReadSettings(mode="tactile")).read(part(folder, "both"))
    ((_, soil, name),) = reader.given
    assert name == "both"
    assert soil.thickness_mm == pytest.approx(np.full(SHAPE, 0.01))
    assert (found.text, found.vision, found.trace.photo) == ("A1", None, None)
    PartReader(reader, ReadSettings(mode="tactile")).read(part(folder, "felt"))
    assert reader.given[1][1] is None


def test_a_photograph_alone_is_read_by_vision(folder: Path) -> None:
    reader = FakeReader()
    found = PartReader(reader).read(part(folder, "seen"))
    assert (found.source, found.touch) == ("vision", None)
    assert reader.given[0].centre_mm is None
    assert reader.asked == ["vision"]


@pytest.mark.parametrize("mode", ["fused", "auto"])
def test_both_senses_are_fused(mode: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    fused_as(monkeypatch, seen)
    reader = FakeReader()
    found = PartReader(reader, ReadSettings(mode=mode)).read(part(folder, "both"))
    assert found.source == "fused"
    assert seen == [("A1", "B1", None)]
    # the stage brings the middle of the plate under the middle of the picture
    assert reader.given[0].centre_mm == pytest.approx((1.45, 0.95))


def test_a_photograph_that_cannot_be_used_leaves_touch_to_auto_alone(folder: Path) -> None:
    (folder / "both.png").write_bytes(b"\x89PNG rubbish")
    found = PartReader(FakeReader(), ReadSettings(mode="auto")).read(part(folder, "both"))
    assert found.source == "tactile"
    assert any("read by touch alone" in message and "both.png" in message for message in found.messages())
    with pytest.raises(FileError, match=r"both\.png"):
        PartReader(FakeReader(), ReadSettings(mode="fused")).read(part(folder, "both"))


def test_templates_alone_read_by_touch_what_has_both(folder: Path) -> None:
    reader = FakeReader()
    reader.settings = replace(reader.settings, experts=("templates",))
    assert PartReader(reader).read(part(folder, "both")).source == "tactile"
    assert reader.asked == ["touch"]


def verdict_of(found: Reading) -> Verdict:
    assert found.trace.verification is not None
    return found.trace.verification.verdict


def test_touch_is_verified_on_its_beliefs(folder: Path) -> None:
    found = PartReader(FakeReader(), ReadSettings(mode="tactile")).read(part(folder, "both"), expected="B1")
    assert verdict_of(found) is Verdict.REFUTED
    assert ReadingFlag.MISMATCH in found.flags
    found = PartReader(FakeReader(), ReadSettings(mode="tactile")).read(part(folder, "both"), expected="A1")
    assert verdict_of(found) is Verdict.CONFIRMED


def test_vision_under_a_format_is_verified_on_what_it_believes_without(folder: Path) -> None:
    reader = FakeReader("A9")
    found = PartReader(reader).read(part(folder, "seen"), expected="B1")
    assert reader.asked == ["vision"]  # once
    assert verdict_of(found) is Verdict.CONFIRMED
    found = PartReader(FakeReader("A9", openly="21")).read(part(folder, "seen"), expected="B1")
    assert found.text == "B1"
    assert verdict_of(found) is Verdict.REFUTED


def test_both_senses_are_verified_together(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    fused_as(monkeypatch, seen, lattice=lattice("B1"))
    found = PartReader(FakeReader("A9"), ReadSettings(mode="fused")).read(part(folder, "both"), expected="B1")
    assert verdict_of(found) is Verdict.CONFIRMED
    assert seen == [("A1", "B1", "A9"), ("A1", "B1", True)]
    fused_as(monkeypatch, [], lattice=lattice("B1"), flags=ReadingFlag.SENSES_DISAGREE)
    found = PartReader(FakeReader(), ReadSettings(mode="fused")).read(part(folder, "both"), expected="B1")
    assert verdict_of(found) is Verdict.UNDECIDED
    assert ReadingFlag.SENSES_DISAGREE in found.flags
    # what the camera has nothing to say of, touch is asked alone
    fused_as(monkeypatch, [])
    found = PartReader(FakeReader(), ReadSettings(mode="fused")).read(part(folder, "both"), expected="A1")
    assert verdict_of(found) is Verdict.CONFIRMED


def test_an_expected_text_that_the_format_forbids_costs_no_reading(folder: Path) -> None:
    reader = FakeReader(format="A9")
    with pytest.raises(VerifyError, match="text expected of felt: is 'ZZ', but it does not fit"):
        PartReader(reader).read(part(folder, "felt"), expected="ZZ")
    assert reader.given == []


def test_several_photographs_are_given_as_one_and_a_bad_one_is_named(tmp_path: Path) -> None:
    sizes = ((20, 30), (20, 30), (8, 9))
    paths = [tmp_path / f"part.light-{n}.png" for n in range(4)]
    for path, size in zip(paths, sizes, strict=False):
        write_photo(path, Photo(np.full(size, 90, dtype=np.uint8)))
    paths[3].write_bytes(b"no picture")
    (part,) = discover([tmp_path])
    reader = FakeReader()
    found = PartReader(reader).read(part)
    (given,) = reader.given
    assert [one.shape for one in (given, *given.others)] == [(20, 30), (20, 30)]
    unlike, damaged = found.notes
    assert "part.light-2.png: photographs of one part are 20 x 30 and 8 x 9 pixels" in unlike
    assert damaged.startswith("read without one of its photographs: ")
    assert "part.light-3.png: is not a picture" in damaged
    for path in paths:
        path.write_bytes(b"no picture")
    with pytest.raises(FileError, match=r"part\.light-0\.png: is not a picture"):
        PartReader(reader).read(part)


def test_one_surer_stroke_in_the_mirrored_map_does_not_take_the_place_of_a_whole_text() -> None:
    """Of a coin that says ONE DIME, its first letter in doubt, the mirrored map showed a single M, at 0.85."""
    surface = HeightMap(np.zeros((8, 8)), pitch_mm=0.1)

    def doubtful(text: str, *beliefs: float) -> Reading:
        return reading_of(
            text, min(beliefs), beliefs=beliefs, flags=ReadingFlag.LOW_CONFIDENCE, threshold=0.98
        )

    def read(whole: Reading, mirrored: Reading) -> Reading:
        found = iter((whole, mirrored))
        touch = SimpleNamespace(
            read_height_map=lambda *_, **__: next(found),
            with_unknown_rows=lambda: touch,
            may_be_mirrored=lambda one: True,
        )
        reader: Any = SimpleNamespace(touch=touch)
        return read_surface(reader, PartMap(surface, rows_known=False))

    whole = doubtful("ONEDIME", 0.5, *[0.99] * 6)
    assert read(whole, doubtful("M", 0.85)).text == "ONEDIME"
    assert read(doubtful("M", 0.85), whole).text == "ONEDIME"
