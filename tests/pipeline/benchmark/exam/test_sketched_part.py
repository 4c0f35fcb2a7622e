"""Parts of the second generator: their seed, their marks, and the dirt of the first."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.errors import MarksError
from glyphs.sketch import ROWS, ROWS_PER_HEIGHT
from glyphs.soiling.soiled import Soiling
from pipeline.benchmark.exam.designed_parts import sketch_part

CLEAN = Soiling()


def test_a_part_is_that_of_its_seed_and_its_text_stands_in_its_boxes() -> None:
    part, same, other = (
        sketch_part("AA99", font="gothic", height_mm=5.0, soiling=CLEAN, seed=(7, k)) for k in (0, 0, 1)
    )
    np.testing.assert_array_equal(part.height_map.z_mm, same.height_map.z_mm)
    assert part.text == same.text != other.text
    rows = part.height_map.shape[0]
    assert rows == ROWS + ROWS_PER_HEIGHT
    middle_mm = 0.5 * rows * part.height_map.pitch_mm
    assert [char.isalpha() for char in part.text] == [True, True, False, False]
    for x0, y0, x1, y1 in part.stamped.boxes_mm:
        assert 0.0 < x0 < x1 < part.height_map.size_mm[0]
        assert y0 < middle_mm < y1
        assert 3.0 < y1 - y0 < 7.0


def test_marks_stand_out_of_the_land_as_deep_as_is_usual() -> None:
    for number in range(8):
        part = sketch_part("9999", font="futuram", height_mm=4.0, soiling=CLEAN, seed=(1, number))
        z_mm = part.height_map.z_mm
        x0, y0, x1, y1 = (round(v / part.height_map.pitch_mm) for v in part.stamped.boxes_mm[0])
        assert 0.04 < np.ptp(z_mm[y0:y1, x0:x1]) < 2.0


def test_dirt_and_photograph_are_those_of_stamped_parts() -> None:
    clean, muddy = (
        sketch_part("AA99", font="gothic", height_mm=5.0, soiling=soiling, seed=(7, 0))
        for soiling in (CLEAN, Soiling(("mud",), 0.6))
    )
    assert clean.soil is None
    assert muddy.soil is not None
    assert muddy.text == clean.text
    assert np.mean(muddy.height_map.z_mm - clean.height_map.z_mm) > 0.005
    assert muddy.photograph().pixels.std() > 1.0


def test_a_font_without_the_characters_is_named() -> None:
    with pytest.raises(MarksError):
        sketch_part("AA99", font="nothing.ttf", height_mm=5.0, soiling=CLEAN, seed=(0,))
