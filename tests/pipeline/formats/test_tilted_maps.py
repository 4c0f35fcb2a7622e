"""Maps of plates that lie askew: read square to the plate, or said to be tilted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from glyphs.surface.maps import HeightMap
from pipeline.common.settings import MapSettings
from pipeline.errors import DataError
from pipeline.formats.grid import part_map
from pipeline.formats.raw_map import RawMap
from recognition.see.levelling import square_to_plate
from tests.support.tilted import tilted

PITCH_MM = 0.1


def grooved() -> HeightMap:
    """A plate of 14 x 8 mm with two shallow grooves, one each way."""
    y, x = np.mgrid[0.0 : 8.0 + 1e-9 : PITCH_MM, 0.0 : 14.0 + 1e-9 : PITCH_MM]
    reach = np.minimum(np.abs(x - 5.0), np.abs(y - 3.0)) - 0.5
    return HeightMap(-np.clip(-0.3 * reach, 0.0, 0.1), PITCH_MM)


def load(seen: HeightMap) -> HeightMap | DataError:
    try:
        return part_map(RawMap(seen.z_mm, PITCH_MM, PITCH_MM), MapSettings()).height_map
    except DataError as problem:
        return problem


@settings(deadline=None, max_examples=25)
@given(deg=st.floats(0.0, 69.0), azimuth_deg=st.floats(0.0, 360.0))
@example(deg=61.0, azimuth_deg=0.0)
def test_a_tilted_plate_is_turned_square_or_said_to_be_tilted(deg: float, azimuth_deg: float) -> None:
    flat = grooved()
    loaded = load(tilted(flat, deg, azimuth_deg)[0])
    if isinstance(loaded, DataError):  # never the question for the unit
        assert float(str(loaded).rsplit("tilted by ")[1].split()[0]) == pytest.approx(deg, abs=1.0)
        assert "level the part" in loaded.hint
        return
    known = np.isfinite(square_to_plate(loaded)[0].z_mm)
    x, y = (np.flatnonzero(known.any(axis=axis)) * PITCH_MM for axis in (0, 1))
    assert (np.ptp(x), np.ptp(y)) == pytest.approx(flat.size_mm, abs=4.0 * PITCH_MM)
