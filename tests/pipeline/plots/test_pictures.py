"""Pictures: drawn for every kind of reading, in the plate frame; sheets of fonts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from glyphs.errors import FileError
from glyphs.fonts.outlines import load_font
from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from pipeline.common.texts import same_text
from pipeline.plots.fonts_picture import sheet_figure
from pipeline.plots.pictures import SheetPart, overview_figure, save_figure
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.picture import moment_image, reading_figure
from recognition.decide.reading import Box, Candidate, CharacterReading, Reading, ReadingTrace
from recognition.marks.depth import MarkDepth
from tests.support.readings import traced
from whisker_array.estimation.relief import Route, relief_from_edges
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.touch import default_touch

EMPTY = Reading((), 0.0, (Finding.of(ReadingFlag.NO_CHARACTERS),))


def tilted() -> HeightMap:
    y, x = np.mgrid[0:50, 0:80]
    z = (0.02 * (x > 40) + 0.01 * (y > 25)).astype(np.float32)
    z[3:6, 70:75] = np.nan
    return HeightMap(z, 0.1)


def scan_of(height_map: HeightMap) -> Scan:
    plan = RasterPlan(WhiskerArray(3, 1.0), (0.5, 0.5, 7.0, 4.0), 0.25, 0.1, lead_mm=0.5)
    return trace_scan(height_map, touch=default_touch(5.0), plan=plan, fidelity=Fidelity.POINTWISE)


def part() -> Reading:
    candidates = (Candidate("A", 0.9, 0.97), Candidate("$", 0.2, 0.01), Candidate("_", 0.1, 0.005))
    depths = (MarkDepth(0.2, 0.151, 0.25), None, MarkDepth(0.2, 0.123, 0.25))
    characters = tuple(
        CharacterReading(candidates, Box(x, 1.0, x + 1.0, 4.0), depth)
        for x, depth in zip((1.0, 2.5, 4.0), depths, strict=True)
    )
    layers = np.zeros((3, 40, 60), np.float32)
    layers[:, 10:20, 5:50] = -0.2
    edges = EdgeMap(layers, tuple(TraceDirection)[:3], layers[0] <= 0.0, 0.1)
    relief = relief_from_edges(edges, default_touch(5.0))
    return Reading(
        characters,
        0.7,
        findings=(Finding(ReadingFlag.TOO_SHALLOW, "too shallow for $x$: A 0.123 mm (at least 0.2)"),),
        font="gothic",
        height_mm=3.0,
        rotation_deg=-2.0,
        trace=ReadingTrace(edges, scan=scan_of(tilted()), height_map=tilted(), relief=relief),
    )


def inked(figure: Figure, path: Path) -> float:
    save_figure(figure, path)
    picture = matplotlib.image.imread(path)
    return float((picture[..., :3].min(axis=2) < 0.9).mean())


def test_all_of_a_trace_is_drawn_with_rows_downwards(tmp_path: Path) -> None:
    figure = reading_figure(part(), title="part $7$ _x_")
    (relief,) = (a for a in figure.axes if a.get_title(loc="left").startswith("height by touch"))
    assert [t.get_text() for t in relief.texts] == ["0.151\n0.200", "?", "0.123\n0.200"]
    assert [b.get_xy() for b in relief.patches] == [(1.0, 1.0), (2.5, 1.0), (4.0, 1.0)]
    plate = [a.get_ylim() for a in figure.axes if a.get_ylabel() == "y, mm"]
    assert plate
    assert all(bottom > top for bottom, top in plate)
    # what to know about the reading stands below, not taken for a formula
    assert figure.get_supxlabel() == "\n".join(part().messages())
    assert "$x$" in figure.get_supxlabel()
    assert inked(figure, tmp_path / "a.png") > 0.05


def test_what_there_is_not_has_no_panel() -> None:
    whole = part()
    assert whole.trace.relief is not None
    one_way = replace(whole.trace.relief, slope_x=None, slope_y=None, route=Route.FLOORS)
    panels = [
        len(reading_figure(reading, title="part").axes)
        for reading in (whole, traced(whole, height_map=None), traced(whole, relief=one_way), EMPTY)
    ]
    assert panels[0] > max(panels[1:3]) > panels[3] == 1


def test_moments_of_every_direction_lie_alike_in_the_plate() -> None:
    z = np.zeros((50, 80), np.float32)
    z[30:40, 60:75] = -0.3  # below right of the middle
    for sweep in scan_of(HeightMap(z, 0.1)).sweeps:
        values, (left, right, bottom, top) = moment_image(sweep)
        away = np.abs(values - np.nanmedian(values))
        row, col = np.array(np.nonzero(away > 0.5 * np.nanmax(away))).mean(axis=1)
        x = left + (col / (values.shape[1] - 1)) * (right - left)
        y = top + (row / (values.shape[0] - 1)) * (bottom - top)
        assert x == pytest.approx(6.7, abs=0.9)
        assert y == pytest.approx(3.45, abs=0.6)


def test_the_overview_says_what_is_right() -> None:
    figure = overview_figure([SheetPart("one", "AAA", part()), SheetPart("two", "AAB", part())])
    titles = [a.get_title(loc="left") for a in figure.axes]
    assert ["right" in titles[1], "WRONG" in titles[3]] == [True, True]
    figure.draw_without_rendering()
    ends = [a._left_title.get_window_extent() for a in figure.axes]
    assert all(left.x1 < right.x0 for left, right in zip(ends[::2], ends[1::2], strict=True))
    assert all(e.x1 < figure.bbox.width for e in ends)


def test_pictures_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.png, \.svg, \.pdf"):
        save_figure(Figure(), tmp_path / "a.jpeg")
    with pytest.raises(FileError, match="cannot be written"):
        save_figure(Figure(), tmp_path / "none" / "a.png")


@pytest.mark.parametrize(
    ("text", "truth", "same"), [("AB C", "ABC", True), ("", "", True), ("AB", "BA", False)]
)
def test_spaces_are_not_stamped(text: str, truth: str, same: bool) -> None:
    assert same_text(text, truth) is same


def test_the_headline_tells_the_reading() -> None:
    line: Any = str(part())
    facts = "“AAA”, review, confidence 0.700, gothic, 3.00 mm, sunk, -2.0°"
    assert line == f"{facts}, shallowest mark 0.123 mm (2 of 3 measured)"
    assert str(EMPTY) == "no characters"


def test_sheet_shows_the_ink_of_every_font():
    figure = sheet_figure([load_font("gothic"), load_font("timesr")])
    assert [a.get_title(loc="left").split()[0] for a in figure.axes] == ["gothic", "timesr"]
    assert all(a.collections for a in figure.axes)


def test_sheet_needs_a_font():
    with pytest.raises(ValueError, match="at least one font"):
        sheet_figure([])
