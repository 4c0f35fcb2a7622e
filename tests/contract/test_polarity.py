"""Raised and sunk marks are told apart by the relief."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from recognition import Reader
from tests.contract.front_doors import ROOT


def test_a_coin_is_raised() -> None:
    with np.load(ROOT / "tests/data/penny_1997.npz") as coin:
        surface = HeightMap(coin["z_mm"], float(coin["pitch_mm"]))
    reading = Reader(format="9999").read(surface)
    assert (reading.text, reading.raised) == ("1997", True)


@pytest.mark.parametrize("raised", [False, True])
def test_a_plate_is_what_its_die_made(raised: bool) -> None:
    sunk = stamp("K7", font="gothic", height_mm=4.0).height_map
    surface = HeightMap(-sunk.z_mm, sunk.pitch_mm) if raised else sunk
    reading = Reader(format="A9").read(surface)
    assert (reading.text, reading.raised) == ("K7", raised)
