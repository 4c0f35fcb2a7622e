"""Plates that lie turned: what was measured is turned upright, and the reading back."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs import EdgeMap, TraceDirection, stamp
from recognition.box import Box
from recognition.levelling import first_look, level
from recognition.reader_settings import ReaderSettings
from recognition.reading import Candidate, CharacterReading, Decision, Reading
from recognition.tactile_reader import TactileReader
from recognition.turning import is_better, turned_back, turned_edges, turned_map

PART = stamp("KX407", font="gothic", height_mm=5.0, seed=1)


def edges(rows: int = 4, cols: int = 7) -> EdgeMap:
    """Four layers, each with one mark of its own, off the origin."""
    layers = np.zeros((4, rows, cols), np.float32)
    for k in range(4):
        layers[k, 0, k] = 1.0 + k
    return EdgeMap(layers, tuple(TraceDirection), layers[0] >= 0.0, 0.5, (2.0, 3.0))


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_four_quarters_are_none(quarters: int) -> None:
    there = turned_edges(edges(), quarters)
    assert there.shape == ((7, 4) if quarters % 2 else (4, 7))
    back = turned_edges(there, 4 - quarters)
    np.testing.assert_array_equal(back.enhancement, edges().enhancement)
    assert back.origin_mm == pytest.approx(edges().origin_mm)


def test_directions_turn_with_the_plate() -> None:
    """Against the clock, what was dragged to the right is dragged up, towards smaller y."""
    turned = turned_edges(edges(), 1)
    assert turned.directions == tuple(TraceDirection)
    up = turned.enhancement[turned.directions.index(TraceDirection.BACK_Y)]
    np.testing.assert_array_equal(up, np.rot90(edges().enhancement[0]))


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_boxes_come_back_to_where_the_mark_is(quarters: int) -> None:
    """A mark at row 0, column 2 of the plate as it lies, found in the turned map."""
    turned = turned_edges(edges(), quarters)
    k = turned.directions.index(TraceDirection((180 - 90 * quarters) % 360))
    row, col = (int(v[0]) for v in np.nonzero(turned.enhancement[k]))
    x, y = turned.origin_mm[0] + 0.5 * col, turned.origin_mm[1] + 0.5 * row
    here = Box(x - 0.1, y - 0.2, x + 0.1, y + 0.2)
    read = Reading(
        (CharacterReading((Candidate("A", 1.0, 1.0),), here),),
        Decision.ACCEPT,
        1.0,
        rotation_deg=1.0,
        box=here,
    )
    back = turned_back(read, quarters, edges=edges())
    (box,) = (c.box for c in back.characters)
    assert (0.5 * (box.x0_mm + box.x1_mm), 0.5 * (box.y0_mm + box.y1_mm)) == pytest.approx((3.0, 3.0))
    assert box.x1_mm - box.x0_mm == pytest.approx(0.4 if quarters % 2 else 0.2)
    assert back.box == box
    assert back.rotation_deg == pytest.approx({1: 91.0, 2: -179.0, 3: -89.0}[quarters])


@pytest.mark.parametrize("quarters", range(4))
def test_the_line_says_whether_it_runs_down(quarters: int) -> None:
    assert first_look(turned_map(level(PART.height_map), quarters)).runs_down is bool(quarters % 2)


def test_what_reads_either_way_stays_as_it_lies() -> None:
    given = Reading((), Decision.REVIEW, 0.5).traced(support_mm=10.0)
    sure = Reading((), Decision.ACCEPT, 0.99)
    assert is_better(sure.traced(support_mm=16.0), given)
    assert not is_better(sure.traced(support_mm=11.0), given)
    assert not is_better(Reading((), Decision.REVIEW, 0.4).traced(support_mm=16.0), given)


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_turned_plate_is_read(quarters: int) -> None:
    reader = TactileReader(ReaderSettings(fonts=("gothic",), format="AA999"))
    surface = turned_map(PART.height_map, quarters)
    found = reader.read_height_map(surface)
    assert (found.text, found.decision) == ("KX407", Decision.ACCEPT)
    # the plate was turned against the clock, so its line runs with -90 degrees a quarter
    assert (found.rotation_deg + 90.0 * quarters + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=2.0)
    assert found.depth_min_mm is not None
    middles = [
        (0.5 * (c.box.x0_mm + c.box.x1_mm), 0.5 * (c.box.y0_mm + c.box.y1_mm)) for c in found.characters
    ]
    z = surface.z_mm - np.median(surface.z_mm)
    for c, (x, y) in zip(found.characters, middles, strict=True):
        assert 0.0 < x < surface.size_mm[0]
        assert 0.0 < y < surface.size_mm[1]
        rows, cols = (
            slice(int(low / surface.pitch_mm), int(high / surface.pitch_mm))
            for low, high in ((c.box.y0_mm, c.box.y1_mm), (c.box.x0_mm, c.box.x1_mm))
        )
        assert z[rows, cols].min() < -0.1  # the mark is in its box
    assert found.trace.scan is not None
    assert reader.read_scan(found.trace.scan).text == "KX407"
