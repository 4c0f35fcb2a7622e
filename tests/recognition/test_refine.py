"""The second look: heights settle, cells stand where the characters stand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import EdgeMap
from recognition.refine import Cell, fine_templates, refine_line
from recognition.search import Hypothesis, LineFit, LineSearch
from recognition.templates import TemplateCache
from whisker_array.whisker.array import ALL_DIRECTIONS
from whisker_array.whisker.touch import Touch

Second = Callable[[float], tuple[LineFit, LineFit, tuple[Cell, ...]]]


@pytest.fixture(scope="module")
def read_robustly(gothic: Font, touch: Touch, calm_edges: EdgeMap) -> Second:
    """Search with a supposed height, then the second look."""
    search = LineSearch(calm_edges, touch, TemplateCache(), chars="K7B1", places=None)

    def look(height_mm: float) -> tuple[LineFit, LineFit, tuple[Cell, ...]]:
        found = search.fit(Hypothesis(gothic, height_mm, 1.0, 0.0))
        templates = search.templates(found.hypothesis, raised=False)
        return (found, *refine_line(found, search.image(0.0), templates, calm_edges.directions))

    return look


def test_the_search_finds_the_line(read_robustly: Second, calm_part: StampedPart) -> None:
    found, _, _ = read_robustly(5.0)
    assert found.text == calm_part.text
    assert not found.raised
    assert found.mean_score > 0.85
    # rows of a common line
    assert np.ptp(found.rows) <= 1
    assert abs(found.slope_deg()) < 1.0


def test_cells_stand_where_the_characters_stand(read_robustly: Second, calm_part: StampedPart) -> None:
    found, settled, cells = read_robustly(5.0)
    chars = settled.templates.chars
    assert "".join(chars[int(np.argmax(c.scores))] for c in cells) == calm_part.text
    for cell, box in zip(cells, calm_part.boxes_mm, strict=True):
        x, y = found.image.plate_from_line(cell.u_mm, cell.v_mm)
        # a pixel of the search is 0.31 mm, of the second look 0.12 mm
        assert (x, y) == pytest.approx((0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])), abs=0.2)
        assert cell.half_width_mm == pytest.approx(0.5 * (box[2] - box[0]), abs=0.2)
        assert cell.turn_deg == 0.0
        assert cell.scores.max() > 0.9
        assert np.abs(cell.scores).max() <= 1.0 + 1e-5


@pytest.mark.parametrize("supposed_mm", [4.8, 5.2])
def test_the_height_settles(supposed_mm: float, read_robustly: Second) -> None:
    _, settled, _ = read_robustly(supposed_mm)
    # the ladder of heights has steps of 2.2 %
    assert abs(settled.hypothesis.height_mm - 5.0) < 0.6 * abs(supposed_mm - 5.0)


def test_the_right_height_stays(read_robustly: Second) -> None:
    _, settled, _ = read_robustly(5.0)
    assert settled.hypothesis.height_mm == pytest.approx(5.0, rel=0.03)


def test_fine_templates_are_kept_and_turn_as_the_plate_turns(
    gothic: Font, touch: Touch, calm_edges: EdgeMap
) -> None:
    search = LineSearch(calm_edges, touch, TemplateCache(), chars="K7", places=None)
    straight = search.templates(Hypothesis(gothic, 5.0, 1.0, 0.0), raised=False)
    made = fine_templates(straight, ALL_DIRECTIONS)
    assert fine_templates(straight, ALL_DIRECTIONS) is made
    assert set(made) == {-3.0, 0.0, 3.0}
    profile = {turn: stack[:, 0] for turn, stack in made.items()}
    rows, cols = np.indices(profile[0.0].shape[1:]).astype(np.float64)
    rows, cols = rows - rows.mean(), cols - cols.mean()
    for t in range(2):

        def heading(turn: float, t: int = t) -> float:
            """Direction of the ink's principal axis, degrees from +x towards +y."""
            weight = np.abs(profile[turn][t])
            x = (weight * cols).sum() / weight.sum()
            y = (weight * rows).sum() / weight.sum()
            xx, yy = (weight * (cols - x) ** 2).sum(), (weight * (rows - y) ** 2).sum()
            xy = (weight * (cols - x) * (rows - y)).sum()
            return float(np.degrees(0.5 * np.arctan2(2 * xy, xx - yy)))

        for turn in (-3.0, 3.0):
            moved = (heading(turn) - heading(0.0) + 90.0) % 180.0 - 90.0
            assert moved == pytest.approx(turn, abs=0.5)


@pytest.mark.parametrize("shift_mm", [0.0, 1.0, -6.0])
def test_a_fit_near_a_line_is_the_fit_of_all_rows(
    shift_mm: float, gothic: Font, touch: Touch, calm_edges: EdgeMap
) -> None:
    search = LineSearch(calm_edges, touch, TemplateCache(), chars="K7B1", places=None)
    hypothesis = Hypothesis(gothic, 5.1, 1.0, 0.0)
    plain = search.fit(hypothesis, raised=False)
    middle = plain.middle_v_mm()
    assert middle is not None
    # far off, where there is nothing, all rows are looked at after all
    near = search.fit(hypothesis, raised=False, near_v_mm=middle + shift_mm)
    assert (near.placed, near.rows, near.scores) == (plain.placed, plain.rows, plain.scores)
    assert near.value_mm == plain.value_mm
