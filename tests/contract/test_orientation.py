"""Parts that lie upside down: what is accepted, and what a person is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from recognition import Decision, Grammar, Reader, Reading

TEXT, TURNED = "9608", "8096"
PART = stamp(TEXT, fonts="gothic", height_mm=4.0, seed=5)
SURFACE, PHOTO = PART.height_map, PART.photograph()


def half_turned(grid: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(grid[::-1, ::-1])


def readings(reader: Reader, *, upside_down: bool) -> list[Reading]:
    surface, photo = SURFACE, PHOTO
    if upside_down:
        surface = HeightMap(half_turned(surface.z_mm), surface.pitch_mm)
        photo = replace(photo, pixels=half_turned(photo.pixels))
    touch, vision = reader.read(surface), reader.read(photo)
    return [touch, vision, reader.fuse(touch, vision)]


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(format="9999", height_mm=4.0)


@pytest.mark.parametrize("upside_down", [False, True])
def test_a_serial_that_reads_otherwise_upside_down_goes_to_review(reader: Reader, upside_down: bool) -> None:
    for read in readings(reader, upside_down=upside_down):
        assert read.decision is Decision.REVIEW
        assert {read.text, other_of(read)} == {TEXT, TURNED}


def other_of(read: Reading) -> str:
    (message,) = [text for text in read.messages() if "also readable upside down" in text]
    return message.split("upside down: ")[1].split()[0]


def test_where_parts_lie_upright_it_is_accepted() -> None:
    upright = Reader(format="9999", height_mm=4.0, orientation="upright")
    for read in readings(upright, upside_down=False):
        assert (read.text, read.decision) == (TEXT, Decision.ACCEPT)


@pytest.mark.parametrize("upside_down", [False, True])
def test_a_list_of_serials_with_one_of_the_two_shows_which_way_up_a_part_lies(upside_down: bool) -> None:
    listed = Reader(format=Grammar.parse("9999", lexicon=[TEXT, "1234"]), height_mm=4.0)
    photo = replace(PHOTO, pixels=half_turned(PHOTO.pixels)) if upside_down else PHOTO
    read = listed.read(photo)
    assert (read.text, read.decision) == (TEXT, Decision.ACCEPT)


def test_a_text_that_reads_one_way_is_accepted_upside_down() -> None:
    photo = stamp("K4R7", fonts="gothic", height_mm=4.0, seed=6).photograph()
    read = Reader(format="A9A9", height_mm=4.0).read(replace(photo, pixels=half_turned(photo.pixels)))
    assert (read.text, read.decision) == ("K4R7", Decision.ACCEPT)
    assert abs(read.rotation_deg) > 170.0
