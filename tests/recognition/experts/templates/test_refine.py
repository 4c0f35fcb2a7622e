"""Every template in the cells of a line: heights settle, cells stand where the characters stand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import EdgeMap
from recognition.experts.templates.placed_line import PlacedLine, TouchedPart
from recognition.experts.templates.predicted import TemplateCache
from recognition.experts.templates.refine import fine_templates, guessed_cells, refine_line
from whisker_array.whisker.array import ALL_DIRECTIONS
from whisker_array.whisker.touch import Touch

Place = Callable[..., PlacedLine]
OFF_MM = 0.2
"""Places of cells: a pixel of theirs is 0.12 mm."""


def test_what_stands_there_is_guessed_better_than_what_does_not(
    place_line: Place, calm_part: StampedPart, calm_edges: EdgeMap
) -> None:
    right, wrong = (
        np.array(
            [
                c.scores.max()
                for c in guessed_cells(place_line(calm_part, calm_edges, text=text), ALL_DIRECTIONS)
            ]
        )
        for text in (calm_part.text, "B17K")
    )
    assert (right > 0.85).all()
    assert (wrong < right - 0.2).all()


@pytest.mark.parametrize("believed", ["K71B", "1B1B"])
def test_cells_stand_where_the_characters_stand(
    believed: str, place_line: Place, calm_part: StampedPart, calm_edges: EdgeMap
) -> None:
    settled, cells = refine_line(place_line(calm_part, calm_edges, text=believed), ALL_DIRECTIONS)
    chars = settled.templates.chars
    # every template answers in every cell, whatever was believed
    assert "".join(chars[int(np.argmax(c.scores))] for c in cells) == calm_part.text
    for cell, box in zip(cells, calm_part.boxes_mm, strict=True):
        x, y = settled.image.plate_from_line(cell.u_mm, cell.v_mm)
        assert (x, y) == pytest.approx((0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])), abs=OFF_MM)
        assert cell.half_width_mm == pytest.approx(0.5 * (box[2] - box[0]), abs=OFF_MM)
        assert cell.turn_deg == 0.0
        assert cell.scores.max() > 0.9
        assert np.abs(cell.scores).max() <= 1.0 + 1e-5


@pytest.mark.parametrize("supposed_mm", [4.8, 5.0, 5.2])
def test_the_height_settles(
    supposed_mm: float, place_line: Place, calm_part: StampedPart, calm_edges: EdgeMap
) -> None:
    line = place_line(calm_part, calm_edges, height_mm=supposed_mm)
    settled, _ = refine_line(line, ALL_DIRECTIONS)
    # the ladder of heights has steps of 2.2 %: half of one, or nearer than what was supposed
    assert abs(settled.height_mm - 5.0) <= max(0.6 * abs(supposed_mm - 5.0), 0.03 * 5.0)


def test_fine_templates_are_kept_and_turn_as_the_plate_turns(
    gothic: Font, touch: Touch, calm_edges: EdgeMap
) -> None:
    part = TouchedPart(calm_edges, touch, TemplateCache(), chars="K7")
    straight = part.templates(gothic, height_mm=5.0, rotation_deg=0.0)
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
