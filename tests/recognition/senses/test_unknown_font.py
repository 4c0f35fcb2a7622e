"""Depths and grades if no font is named, or a wrong one."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import pytest

from glyphs.fonts.outlines import load_font
from glyphs.part import stamp
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.depth_rules import depth_rule
from recognition.marks.no_depth import NoDepth
from recognition.reader import Reader
from tests.benchmarks.depth_unnamed import true_depths

DEJAVU = Path(matplotlib.get_data_path(), "fonts", "ttf")
PART = {"height_mm": 5.0, "depth_mm": 0.16, "pitch_mm": 0.06}
FIREARMS = depth_rule("27CFR478.92")


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(format="AA9999", height_mm=5.0, depth_rules=(FIREARMS,))


@pytest.mark.parametrize(
    ("font", "dirt", "measured"),
    [
        ("gothic", 0.0, 5),  # a stand-in
        ("gothic", 0.5, 0),
        ("timesrb", 0.5, 0),
        (DEJAVU / "DejaVuSans-Bold.ttf", 0.0, 0),
        (DEJAVU / "DejaVuSerif.ttf", 0.5, 0),
    ],
)
def test_without_a_named_font_a_depth_is_true_or_not_measured(
    font: str | Path, dirt: float, measured: int, reader: Reader
) -> None:
    loaded = load_font(font)
    part = stamp(format="AA9999", fonts=loaded, dirt=dirt, seed=(71, 0), **PART)
    reading = reader.read(part.height_map, soil=part.soil)
    assert reading.text == part.text
    for c, truth in zip(reading.characters, true_depths(part, loaded), strict=True):
        assert (c.depth is None) == (c.no_depth is not None)
        if c.depth is not None:
            assert c.depth.mean_mm == pytest.approx(truth.mean_mm, abs=0.02)
            # the least depth of a stroke also has the noise of the sensors
            assert c.depth.min_mm == pytest.approx(truth.min_mm, abs=0.03)
    # nothing is too shallow for the rule; what was not measured is said
    assert not reading.flags & ReadingFlag.TOO_SHALLOW
    unknown = sum(c.depth is None for c in reading.characters)
    assert len(reading.characters) - unknown >= measured
    assert bool(reading.flags & ReadingFlag.DEPTH_UNKNOWN) is bool(unknown)
    assert any("(name the font)" in text for text in reading.messages()) is bool(unknown)


@pytest.mark.parametrize(("named", "font"), [("timesr", "gothic"), ("gothic", "timesr")])
def test_a_wrong_font_is_said_and_measured_along_the_strokes_that_are_there(named: str, font: str) -> None:
    part = stamp(format="AA9999", fonts=font, seed=(9, 0), **PART)
    reading = Reader(fonts=[named], format="AA9999", height_mm=5.0).read(part.height_map)
    assert reading.text == part.text
    assert reading.decision is Decision.REVIEW
    assert reading.font != named
    assert f"the font {named} does not fit the marks (name the right font, or none)" in reading.messages()
    # no grade, and no depth, from strokes that are not there
    assert all(c.grade is None for c in reading.characters)
    for c, truth in zip(reading.characters, true_depths(part, load_font(font)), strict=True):
        assert c.no_depth is NoDepth.FONT or (
            c.depth is not None and c.depth.min_mm == pytest.approx(truth.min_mm, abs=0.02)
        )


@pytest.mark.parametrize(("font", "dirt"), [("gothic", 0.5), ("timesr", 0.0)])
def test_the_right_font_fits(font: str, dirt: float) -> None:
    part = stamp(format="AA9999", fonts=font, dirt=dirt, seed=(73, 0), **PART)
    reading = Reader(fonts=[font], format="AA9999", height_mm=5.0).read(part.height_map, soil=part.soil)
    assert not reading.flags & ReadingFlag.FOREIGN_SHAPES
    assert reading.font == font
    assert all(c.grade is not None and c.depth is not None for c in reading.characters)
