"""The scale of a scan when nobody gives the character height."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from glyphs.errors import MarksError
from pipeline.reading.simulated_scan import VirtualBench, find_height_mm
from recognition.reader import Reader
from recognition.settings import ReaderSettings
from whisker_array.scan.scan import Scan


def read_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose font it is takes long and is not the subject."""
    gothic = Reader(ReaderSettings(fonts=("gothic",), experts=("network",)))
    monkeypatch.setattr("pipeline.reading.simulated_scan.Reader", lambda: gothic)


def test_dirt_does_not_make_the_characters_taller(monkeypatch: pytest.MonkeyPatch) -> None:
    """On this part the highest band is dirt and line together."""
    read_quickly(monkeypatch)
    part = stamp("KX407251", fonts="gothic", height_mm=5.0, seed=3, dirt=0.6)
    # shops stamp within a few percent of the height asked for
    assert find_height_mm(part.height_map, soil=part.soil) == pytest.approx(5.0, rel=0.06)


def test_a_map_without_characters_needs_a_height(monkeypatch: pytest.MonkeyPatch) -> None:
    read_quickly(monkeypatch)
    flat = HeightMap(np.zeros((30, 60), np.float32), 0.1)
    with pytest.raises(MarksError, match="--height-mm"):
        find_height_mm(flat)


def felt(**options: bool) -> Scan:
    flat = HeightMap(np.zeros((60, 120), np.float32), 0.1)
    return VirtualBench(flat, 5.0, **options).scan()


def test_a_bench_creeps_and_has_play_unless_told_otherwise() -> None:
    real, steady, ideal = felt(), felt(memory=False), felt(noise=False)
    land_n_mm = abs(real.touch.land_moment_n_mm())
    # gains, noise and drift are the same, so what is between the two is creep and hysteresis: in the air before the
    # first pass nothing, before the last one what has gathered, 1 to 4 % of the land's moment
    shift = (real.sweeps[-1].air_n_mm[-1] - steady.sweeps[-1].air_n_mm[-1]) / land_n_mm
    assert -0.06 < shift.min() < -0.01  # whiskers beyond the part have felt nothing
    np.testing.assert_array_equal(real.sweeps[0].air_n_mm[0], steady.sweeps[0].air_n_mm[0])
    assert np.ptp(ideal.sweeps[0].moment_n_mm[0, 0]) < 1e-4  # rounding
    np.testing.assert_array_equal(
        felt(noise=False, memory=False).sweeps[0].moment_n_mm, ideal.sweeps[0].moment_n_mm
    )


def test_the_bench_of_a_session_knows_its_creep() -> None:
    flat = HeightMap(np.zeros((60, 120), np.float32), 0.1)
    for memory in (True, False):
        known = VirtualBench(flat, 5.0, memory=memory).open_session().fitting.calibration
        assert known is not None
        assert (known.memory is not None) == memory
