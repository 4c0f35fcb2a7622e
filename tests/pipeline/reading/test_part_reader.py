"""Which senses read a part, with readers that answer at once, and what parts should read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.errors import FileError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.find_parts import discover
from pipeline.formats.npz import soil_members, write_npz
from pipeline.formats.part_files import PartFiles
from pipeline.formats.photos import write_photo
from pipeline.formats.truth import load_expected
from pipeline.reading.part_reader import PartReader, senses_of
from recognition.decide import risk
from recognition.decide.decision import ReadingFlag
from recognition.decide.evidence import Log, SenseEvidence
from recognition.decide.reading import Reading
from recognition.decide.verify import Verdict, VerifyError
from recognition.find.part_lines import PartLines
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.reader import Reader
from recognition.surface import Surface
from tests.support.evidence import believed_line, sense_of

SHAPE = (20, 30)


def lattice(text: str) -> Lattice:
    return Lattice(tuple("AB12"), np.log([[0.999 if c == t else 1e-5 for c in "AB12"] for t in text]))


@pytest.fixture(autouse=True)
def low_threshold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(risk, "threshold_of", lambda source, allowed: 0.5)


class FakeReader(Reader):
    """Touch reads A1 and vision B1, whatever they are given; what they are given is kept.

    `openly` is what the camera would have read without a format.
    """

    def __init__(self, format: str | None = None, openly: str = "B1") -> None:
        super().__init__(fonts=["gothic"], format=format)
        self.openly = openly
        self.given: list[Any] = []
        self.asked: list[str] = []

    def feel(self, surface: Surface) -> SenseEvidence:
        self.asked.append("touch")
        self.given.append(surface)
        return sense_of(lattice("A1"), surface=surface.height_map)

    def look_at(self, photo: Photo) -> SenseEvidence:
        self.asked.append("vision")
        self.given.append(photo)
        line = believed_line(lattice("B1"), lattice(self.openly))
        log = Log(photo=photo, photos=1 + len(photo.others))
        return SenseEvidence("vision", lines=PartLines(line), log=log)


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


def test_a_photograph_that_cannot_be_used_leaves_touch_to_auto_alone(folder: Path) -> None:
    (folder / "both.png").write_bytes(b"\x89PNG rubbish")
    found = PartReader(FakeReader(), ReadSettings(mode="auto")).read(part(folder, "both"))
    assert found.source == "tactile"
    assert any("read by touch alone" in message and "both.png" in message for message in found.messages())
    with pytest.raises(FileError, match=r"both\.png"):
        PartReader(FakeReader(), ReadSettings(mode="fused")).read(part(folder, "both"))


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


def test_both_senses_are_verified_together(folder: Path) -> None:
    found = PartReader(FakeReader("A9"), ReadSettings(mode="fused")).read(part(folder, "both"), expected="B1")
    # touch and camera contradict each other: then nothing is confirmed
    assert verdict_of(found) in (Verdict.UNDECIDED, Verdict.REFUTED)
    assert ReadingFlag.SENSES_DISAGREE in found.flags
    assert found.touch is not None
    assert found.touch.trace.verification is None


@pytest.mark.parametrize(("earlier", "accepted"), [("", True), ("A1", True), ("A 1", True), ("B2", False)])
def test_a_text_other_than_that_of_an_earlier_pass_must_be_surer(
    earlier: str, accepted: bool, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, settings = FakeReader("A9"), ReadSettings(mode="tactile")
    listed = replace(part(folder, "felt"), other_text=earlier)
    score = PartReader(reader, settings).read(listed).confidence
    monkeypatch.setattr(risk, "threshold_of", lambda source, allowed: score)
    found = PartReader(reader, settings).read(listed)
    assert (found.decision == "accept") is accepted
    assert bool(found.flags & ReadingFlag.BELIEVED_OTHERWISE) is not accepted


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


def test_one_text_for_all_or_a_table(tmp_path: Path) -> None:
    assert load_expected(" AB 18 ") == "AB 18"
    path = tmp_path / "wanted.csv"
    path.write_text("part,text\na.npz,AB18\nb,AB81\n", encoding="utf-8")
    table = load_expected(str(path))
    assert table == {"a": "AB18", "b": "AB81"}
    # a table by any other name is one too, a text with a point in it is none
    assert load_expected(str(path.rename(tmp_path / "wanted"))) == table
    assert load_expected("A.B") == "A.B"


def test_what_cannot_be_expected_is_told_before_the_run(tmp_path: Path) -> None:
    grammar = Grammar(format="AA99")
    with pytest.raises(
        SettingsError, match="--verify is 'AB1', but it does not fit the format AA99; correct"
    ):
        load_expected("AB1", grammar)
    with pytest.raises(SettingsError, match="--verify is empty"):
        load_expected(" ")
    with pytest.raises(FileError, match="is not there"):
        load_expected(str(tmp_path / "none.csv"))
    path = tmp_path / "wanted.csv"
    path.write_text("part,text\na,AB18\nb,\n", encoding="utf-8")
    with pytest.raises(FileError, match="gives no text for b"):
        load_expected(str(path))
    path.write_text("part,text\na,AB18\nb,AB1\n", encoding="utf-8")
    with pytest.raises(
        FileError, match=r"wanted\.csv: b should read 'AB1', but it does not fit the format AA99"
    ):
        load_expected(str(path), grammar)
