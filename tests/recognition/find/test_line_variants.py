"""Lines that are bent keep their place, length and height, and get the sag that is asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.find.line_variants import bend
from recognition.see.text_line import TextLine


@given(turn_deg=st.floats(-180.0, 180.0), sag=st.floats(-1.0, 1.0), height_mm=st.floats(1.0, 12.0))
def test_the_ends_of_a_bent_line_lie_lower_than_its_middle_by_the_sag(
    turn_deg: float, sag: float, height_mm: float
) -> None:
    line = TextLine.straight(3.0, -2.0, length_mm=8.0 * height_mm, height_mm=height_mm, turned_deg=turn_deg)
    bent = bend(line, sag)
    turn = math.radians(turn_deg)
    down = bent.centre_mm @ (-math.sin(turn), math.cos(turn))
    middle = down[len(down) // 2]
    assert (down[[0, -1]] - middle) / height_mm == pytest.approx([sag, sag], abs=1e-9)
    assert bent.centre_mm.mean(axis=0) == pytest.approx(line.centre_mm.mean(axis=0), abs=0.05 * height_mm)
    assert np.ptp(bent.centre_mm @ (math.cos(turn), math.sin(turn))) == pytest.approx(line.length_mm)
    assert bent.height_mm == height_mm
