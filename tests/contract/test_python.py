"""Reading from Python, through the names that the packages export."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest

import whisker_array
from glyphs import FileError, FontError, FormatError, HeightMap, MapError, Photo, stamp
from pipeline import read
from recognition import Reader, Reading, Verdict

PACKAGES = ("glyphs", "whisker_array", "recognition", "pipeline")


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(fonts=["gothic"], format="A9", height_mm=4.0)


@pytest.fixture(scope="module")
def reading(reader: Reader) -> Reading:
    return reader.read(stamp("K7", font="gothic", height_mm=4.0, seed=3).height_map)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_of_the_vocabulary_is_there(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None, name
    with pytest.raises(AttributeError):
        module.nothing_of_this_name  # noqa: B018


def test_a_clean_plate_is_accepted_with_places_and_candidates(reading: Reading) -> None:
    assert (reading.text, reading.decision) == ("K7", "accept")
    assert reading.confidence > 0.98
    assert [place.candidates[0].char for place in reading.characters] == ["K", "7"]
    first, second = (place.box for place in reading.characters)
    assert first.x0_mm < first.x1_mm <= second.x0_mm + 0.5
    assert first.y1_mm - first.y0_mm == pytest.approx(4.0, rel=0.15)


def test_the_same_part_is_read_alike_twice(reader: Reader, reading: Reading) -> None:
    again = reader.read(stamp("K7", font="gothic", height_mm=4.0, seed=3).height_map)
    assert (again.text, again.confidence) == (reading.text, reading.confidence)


def test_another_text_is_refuted_and_the_same_confirmed(reader: Reader, reading: Reading) -> None:
    for text, verdict in (("K7", Verdict.CONFIRMED), ("H7", Verdict.REFUTED)):
        verification = reader.verify(reading, text).trace.verification
        assert verification is not None
        assert verification.verdict is verdict


def test_a_scan_reads_as_its_height_map_does(tmp_path: Path, reader: Reader, reading: Reading) -> None:
    surface = stamp("K7", font="gothic", height_mm=4.0, seed=3).height_map
    touch = whisker_array.default_touch(4.0)
    plan = whisker_array.default_plan((0.0, 0.0, *surface.size_mm), character_height_mm=4.0)
    scan = whisker_array.trace_scan(surface, touch=touch, plan=plan)
    assert reader.read(scan).text == reading.text
    path = tmp_path / "scan.h5"
    whisker_array.save_scan(scan, path)
    assert reader.read(whisker_array.load_scan(path)).text == reading.text


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"fonts": ["comic"]}, FontError),
        ({"format": ""}, FormatError),
        ({"height_mm": -1.0}, ValueError),
        ({"colour": "red"}, TypeError),
    ],
)
def test_a_wrong_option_is_a_typed_error(options: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        Reader(**options)  # type: ignore[arg-type]


def test_what_is_no_part_is_a_typed_error(reader: Reader) -> None:
    with pytest.raises(TypeError, match="a str cannot be read; give a HeightMap, a Scan or a Photo"):
        reader.read("part.npz")  # type: ignore[arg-type]
    flat = HeightMap(np.zeros((40, 60), dtype=np.float32), 0.05)
    with pytest.raises(ValueError, match="two of HeightMap"):
        reader.read(flat, flat)
    with pytest.raises(MapError):
        HeightMap(np.zeros((40, 60), dtype=np.float32), 0.0)


def test_a_file_that_is_not_there_names_itself(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.npz"):
        read(tmp_path / "none.npz")


def test_a_blank_photograph_is_rejected_with_a_reason(reader: Reader) -> None:
    blank = reader.read(Photo(np.full((120, 200), 128, dtype=np.uint8)))
    assert (blank.text, blank.decision) == ("", "reject")
    assert blank.flags
