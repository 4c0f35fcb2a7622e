"""Layouts that are not read are named, in place of advice to clean the part."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glyphs import stamp
from glyphs.camera.photo import Photo
from glyphs.part import Part
from glyphs.stamping.layouts import Layout
from glyphs.surface.maps import HeightMap
from recognition import Reader
from recognition.decide.decision import EXPLANATIONS, Decision, ReadingFlag
from recognition.decide.reading import Reading
from recognition.marks.grade import Action

TEXT, FORMAT = "KD2746", "AA9999"
STACKED = f"the characters stand below each other and read “{TEXT}” (columns are not accepted; type it)"
MIRRORED = f"the marks look mirrored: in a mirror they read “{TEXT}” (mirror the picture or the map)"
TWO = (
    "two lines read “KD” and “2746”, which fit the format together"
    " (give --format for one and --line for the other)"
)


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(format=FORMAT)


@pytest.fixture(scope="module")
def part() -> Part:
    return stamp(TEXT, seed=4)


@cache
def column() -> HeightMap:
    """Characters upright below each other, as on the flank of a narrow part."""
    each = [stamp(char, seed=k + 9).height_map for k, char in enumerate(TEXT)]
    columns = min(one.shape[1] for one in each)
    z_mm = np.concatenate([one.z_mm[::2, :columns:2] for one in each])
    return HeightMap(np.ascontiguousarray(z_mm), 2.0 * each[0].pitch_mm)


def says(reading: Reading, text: str) -> None:
    """It says so first, and nothing about dirt."""
    assert reading.messages()[0] == text
    assert reading.decision is not Decision.ACCEPT
    assert reading.flags & EXPLANATIONS == ReadingFlag.LAYOUT
    assert set(reading.actions) <= {Action.NONE}
    assert not any("clean" in message for message in reading.messages())


def test_characters_below_each_other(reader: Reader) -> None:
    says(reader.read(column()), STACKED)


def test_without_a_format_a_character_of_a_column_is_not_taken_for_the_serial() -> None:
    read = Reader().read(column())
    assert read.decision is not Decision.ACCEPT
    assert STACKED in read.messages()


def test_a_column_in_a_photograph(reader: Reader) -> None:
    # strokes of a column, without the noise of a camera
    z_mm = column().z_mm[::2, ::2]
    says(reader.read(Photo(np.where(z_mm < -0.1, 60, 200).astype(np.uint8))), STACKED)


def test_a_mirrored_photograph(reader: Reader, part: Part) -> None:
    photo = part.photograph()
    says(reader.read(replace(photo, pixels=np.ascontiguousarray(photo.pixels[::-1]))), MIRRORED)


def test_a_mirrored_map(reader: Reader, part: Part) -> None:
    surface = part.height_map
    shown = HeightMap(np.ascontiguousarray(surface.z_mm[:, ::-1]), surface.pitch_mm)
    says(reader.read(shown), MIRRORED)


def test_a_serial_on_two_lines(reader: Reader) -> None:
    two = stamp("KD", layout=Layout(other_text="2746"), seed=5)
    says(reader.read(two.photograph()), TWO)
    # named, each is read
    named = Reader(format="9999", lines={"head": "AA"}).read(two.photograph())
    assert (named.text, [line.text for line in named.others]) == ("2746", ["KD"])


def test_a_dirty_part_in_a_usual_layout_is_none_of_them(reader: Reader) -> None:
    dirty = stamp(TEXT, dirt=0.9, seed=8)
    seen = reader.read(dirty.photograph())
    assert seen.decision is not Decision.ACCEPT
    assert not seen.flags & ReadingFlag.LAYOUT


@pytest.mark.parametrize("text", ["KD2746", "HM4410"])
def test_a_photograph_that_lies_upside_down_is_read(text: str, reader: Reader) -> None:
    upright = stamp(text, seed=4).photograph()
    turned = replace(upright, pixels=np.ascontiguousarray(upright.pixels[::-1, ::-1]))
    assert [reader.read(photo).text for photo in (upright, turned)] == [text, text]
    told = Reader(format=FORMAT, orientation="upright").read(turned)
    assert told.decision is not Decision.ACCEPT
