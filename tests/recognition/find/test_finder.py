"""Lines found on stamped parts: about as high as they are, about where they are, and none on bare land."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glyphs import stamp
from glyphs.stamping.layouts import Layout
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap
from recognition.find import finder
from recognition.find.finder import Finder, findings, overlap
from recognition.see.levelling import level
from recognition.see.text_line import TextLine
from recognition.see.view import heights_view

Make = Callable[..., StampedPart]
HEIGHT_RATIO, MIDDLE_HEIGHTS, END_HEIGHTS = 1.12, 0.25, 0.8
"""By which a line found may be mistaken: the reader looks at lines moved, a quarter lower and higher, and longer."""


def hull(boxes: object) -> tuple[float, float, float, float]:
    table = np.array(boxes)
    return (*table[:, :2].min(axis=0), *table[:, 2:].max(axis=0))


def check(line: TextLine, box: tuple[float, float, float, float], height_mm: float) -> None:
    x0, y0, x1, y1 = box
    assert 1.0 / HEIGHT_RATIO < line.height_mm / height_mm < HEIGHT_RATIO
    middle = line.centre_mm[[0, -1]].mean(axis=0)
    assert abs(middle[1] - 0.5 * (y0 + y1)) < MIDDLE_HEIGHTS * height_mm
    assert abs(line.centre_mm[0, 0] - x0) < END_HEIGHTS * height_mm
    assert abs(line.centre_mm[-1, 0] - x1) < END_HEIGHTS * height_mm


@pytest.mark.parametrize("height_mm", [2.5, 5.0, 10.0])
@pytest.mark.parametrize("raised", [False, True])
def test_a_line_of_unknown_height_is_found(height_mm: float, raised: bool, make_part: Make) -> None:
    part = make_part("K7B29X4", height_mm=height_mm, raised=raised)
    first = Finder(heights_view(level(part.height_map))).lines()[0]
    check(first.line, hull(part.boxes_mm), height_mm)
    assert first.score > 0.0


def test_a_height_that_is_known_is_kept_to(make_part: Make) -> None:
    part = make_part("K7B29X4")
    first = Finder(heights_view(level(part.height_map)), 5.0).lines()[0]
    # no further off than marks are struck
    assert first.line.height_mm == pytest.approx(5.0, rel=0.1)


def test_two_lines_are_two() -> None:
    part = stamp(
        "K7B29X4", fonts="gothic", height_mm=5.0, pitch_mm=5.0 / 60, seed=1,
        layout=Layout(other_text="R3X8HM5", gap=0.7),
    )  # fmt: skip
    stamped = part.stamped
    lines = [one.line for one in Finder(heights_view(level(part.height_map))).lines()][:2]
    assert len(lines) == 2
    upper, lower = sorted(lines, key=lambda line: float(line.centre_mm[:, 1].mean()))
    boxes = sorted((hull(stamped.boxes_mm), hull(stamped.other_boxes_mm)), key=lambda box: box[1])
    for line, (_, y0, _, y1) in zip((upper, lower), boxes, strict=True):
        assert y0 < float(line.centre_mm[:, 1].mean()) < y1
    assert not overlap(upper, lower)
    assert not overlap(lower, upper)


def test_a_line_that_runs_down_is_found_running_down(make_part: Make) -> None:
    part = make_part("K7B29X4")
    level_ = level(part.height_map)
    # turned clockwise: what ran to the right runs down
    turned = HeightMap(np.rot90(level_.z_mm, -1).copy(), level_.pitch_mm)
    first = Finder(heights_view(turned)).turned(90.0)[0].line
    assert first.turned_deg == pytest.approx(90.0, abs=5.0)
    x0, y0, x1, y1 = hull(part.boxes_mm)
    wide = turned.size_mm[0]
    middle = first.centre_mm[[0, -1]].mean(axis=0)
    assert middle[0] == pytest.approx(wide - 0.5 * (y0 + y1), abs=MIDDLE_HEIGHTS * 5.0)
    assert middle[1] == pytest.approx(0.5 * (x0 + x1), abs=END_HEIGHTS * 5.0)


@pytest.mark.parametrize("turned_deg", [40.0, -65.0])
def test_a_slanted_line_is_found_on_slanted_axes(turned_deg: float, make_part: Make) -> None:
    part = make_part("K7B29X4", line_rotation_deg=turned_deg)
    view = heights_view(level(part.height_map))
    near_deg = min((30.0, -30.0, 60.0, -60.0), key=lambda deg: abs(deg - turned_deg))
    first = Finder(view).turned(near_deg)[0].line
    assert first.turned_deg == pytest.approx(turned_deg, abs=5.0)
    middle = first.centre_mm[[0, -1]].mean(axis=0)
    boxes = np.array(part.boxes_mm)
    assert middle == pytest.approx(0.5 * (boxes[:, :2] + boxes[:, 2:]).mean(axis=0), abs=END_HEIGHTS * 5.0)


def test_the_network_runs_once_at_each_scale_of_each_rotation(
    make_part: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    view, runs = heights_view(level(make_part("K7B29X4").height_map)), []
    monkeypatch.setattr(finder, "findings", lambda views: runs.append(views) or findings(views))
    once = Finder(view)
    once.lines()
    level_runs = len(runs)
    once.lines(faint=True)
    assert len(runs) == level_runs > 0
    once.turned(90.0)
    turned_runs = len(runs)
    once.turned(90.0)
    assert len(runs) == turned_runs > level_runs


@pytest.mark.parametrize("roughness_mm", [0.0, 0.0005, 0.002])
def test_bare_land_has_no_line(roughness_mm: float) -> None:
    z = roughness_mm * np.random.default_rng(1).standard_normal((160, 320))
    assert Finder(heights_view(HeightMap(z.astype(np.float32), 0.08))).lines() == []


def test_lines_overlap_where_one_lies_in_the_others_band() -> None:
    def line(x: float, y: float, length: float) -> TextLine:
        return TextLine.straight(x, y, length_mm=length, height_mm=5.0)

    assert overlap(line(0, 0, 20), line(0, 0, 20))
    assert overlap(line(5, 1, 10), line(0, 0, 20))
    assert not overlap(line(0, 6, 20), line(0, 0, 20))
    # less than half of the long one lies in the short one's band
    assert not overlap(line(0, 0, 20), line(0, 0, 6))
    assert not overlap(line(30, 0, 20), line(0, 0, 20))


def test_a_straight_line_along_the_top_of_an_arc_is_the_same_ink() -> None:
    """Characters of an arc were read twice, and the part went to review for a line that was its own serial."""
    height_mm, radius_mm = 2.0, 9.0
    angles = np.linspace(-0.8, 0.8, 33)
    arc = TextLine(radius_mm * np.stack([np.sin(angles), 1.0 - np.cos(angles)], axis=1), height_mm)
    top = TextLine(np.array([(-4.0, 0.3), (4.0, 0.3)]), height_mm)
    assert overlap(top, arc, band_mm=0.9 * height_mm)
    assert overlap(arc, arc.reversed)
    below = TextLine(np.array([(-4.0, 5.5), (4.0, 5.5)]), height_mm)
    assert not overlap(below, arc, band_mm=0.9 * height_mm)
