"""The virtual array: real sensors unless told otherwise, and the same for every part."""

from __future__ import annotations

from typing import Any

import numpy as np

from glyphs import stamp
from glyphs.surface.maps import HeightMap
from recognition import Reader
from recognition.decide.evidence import Evidence
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from recognition.surface import Surface
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor import Sensors
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

FLAT = HeightMap(np.zeros((210, 60), np.float32), 0.2)  # room for eight whiskers 5 mm apart


def felt(part_id: str = "", **array: Any) -> Scan:
    return VirtualBench(FLAT, 5.0, VirtualArray(**array), part_id=part_id).scan()


def test_sensors_are_real_unless_told_otherwise() -> None:
    real, ideal = felt(), felt(sensors=Sensors.IDEAL)
    land = ideal.touch.land_moment_n_mm()
    np.testing.assert_allclose(ideal.sweeps[0].moment_n_mm[0], land, rtol=1e-3)
    gains = real.sweeps[0].moment_n_mm[0].mean(axis=1) / land
    assert 0.01 < gains.std() < 0.1
    assert real.sweeps[0].air_n_mm.std() > 0.0
    assert not ideal.sweeps[0].air_n_mm.any()


def test_the_same_array_feels_every_part_and_again_with_other_noise() -> None:
    first, renamed, again, other = felt("a"), felt("b"), felt(noise_seed=1), felt(seed=1)
    np.testing.assert_array_equal(first.sweeps[0].moment_n_mm, renamed.sweeps[0].moment_n_mm)
    gains = [scan.sweeps[0].moment_n_mm[0].mean(axis=1) for scan in (first, again, other)]
    assert (gains[0] != gains[1]).all()
    np.testing.assert_allclose(gains[0], gains[1], rtol=0.01)
    assert not np.allclose(gains[0], gains[2], rtol=0.01)


def test_a_session_knows_the_gains_of_its_sensors() -> None:
    known = VirtualBench(FLAT, 5.0).open_session().fitting.calibration
    assert 0.01 < known.gain.std() < 0.1


def test_a_reader_feels_with_its_array() -> None:
    part = stamp("K7B2", fonts="gothic", height_mm=4.0, seed=3)
    own = default_touch(4.0).with_whisker(default_whisker(6.0))
    array = VirtualArray(own, Sensors.IDEAL, Fidelity.POINTWISE)
    reader = Reader(format="A9A9", height_mm=4.0, array=array)
    evidence = reader.feel(Surface(part.height_map, part.soil))
    scan = evidence.log.scan
    assert scan.touch.whisker == own.whisker
    assert scan.fidelity == Fidelity.POINTWISE
    assert not scan.sweeps[0].air_n_mm.any()
    assert reader.decide(Evidence.of(evidence)).text == "K7B2"
