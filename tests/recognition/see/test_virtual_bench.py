"""The virtual array, and its first pass: what chooses the whiskers of the scan that is read is felt, not known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from glyphs import stamp
from glyphs.surface.maps import HeightMap, MapError
from recognition import Reader
from recognition.decide.evidence import Evidence
from recognition.find.first_pass import FIRST_HEIGHT_MM, felt_heights_mm
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from recognition.surface import Surface
from tests.support.felt import felt
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor import Sensors
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

# ----------------------------------------------------------------------------------------------------- virtual bench

LAND = HeightMap(np.zeros((210, 60), np.float32), 0.2)  # room for eight whiskers 5 mm apart


def scan_by(part_id: str = "", **array: Any) -> Scan:
    return VirtualBench(LAND, 5.0, VirtualArray(**array), part_id=part_id).scan()


def test_sensors_are_real_unless_told_otherwise() -> None:
    real, ideal = scan_by(), scan_by(sensors=Sensors.IDEAL)
    land = ideal.touch.land_moment_n_mm()
    np.testing.assert_allclose(ideal.sweeps[0].moment_n_mm[0], land, rtol=1e-3)
    gains = real.sweeps[0].moment_n_mm[0].mean(axis=1) / land
    assert 0.01 < gains.std() < 0.1
    assert real.sweeps[0].air_n_mm.std() > 0.0
    assert not ideal.sweeps[0].air_n_mm.any()


def test_the_same_array_feels_every_part_and_again_with_other_noise() -> None:
    first, renamed, again, other = scan_by("a"), scan_by("b"), scan_by(noise_seed=1), scan_by(seed=1)
    np.testing.assert_array_equal(first.sweeps[0].moment_n_mm, renamed.sweeps[0].moment_n_mm)
    gains = [scan.sweeps[0].moment_n_mm[0].mean(axis=1) for scan in (first, again, other)]
    assert (gains[0] != gains[1]).all()
    np.testing.assert_allclose(gains[0], gains[1], rtol=0.01)
    assert not np.allclose(gains[0], gains[2], rtol=0.01)


def test_the_speed_of_an_array_is_that_of_its_plans_and_passes() -> None:
    usual, slow = VirtualBench(LAND, 5.0), VirtualBench(LAND, 5.0, VirtualArray(given_speed_mm_s=20.0))
    assert (usual.whole.speed_mm_s, slow.whole.speed_mm_s) == (50.0, 20.0)
    assert (usual.open_session().fitting.speed_mm_s, slow.open_session().fitting.speed_mm_s) == (50.0, 20.0)
    assert slow.scan().sample_rate_hz == pytest.approx(0.4 * usual.scan().sample_rate_hz)
    felt = Reader(format="A9A9", height_mm=5.0, array=slow.array).feel(Surface(PART.height_map)).log.scan
    assert felt.sample_rate_hz == pytest.approx(slow.whole.sample_rate_hz)


def test_real_whiskers_ring_and_ideal_ones_do_not() -> None:
    z = np.zeros((96, 96), dtype=np.float32)
    z[:, 40:56] = -0.2
    part = HeightMap(z, 0.0625)
    for sensors in Sensors:
        whisker = default_touch(5.0)
        scans = [
            VirtualBench(part, 5.0, VirtualArray(touch, sensors)).scan()
            for touch in (whisker, replace(whisker, ringing=None))
        ]
        apart = np.abs(scans[0].sweeps[0].moment_n_mm - scans[1].sweeps[0].moment_n_mm).max()
        assert apart > 0.1 if sensors is Sensors.REAL else apart == 0.0


def test_a_session_knows_the_gains_of_its_sensors() -> None:
    known = VirtualBench(LAND, 5.0).open_session().fitting.calibration
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


# -------------------------------------------------------------------------------------------------------- first pass

PART = stamp("K7B2", fonts="gothic", height_mm=5.0, seed=3)


class Recorder:
    """Feels as the reader would, and keeps for which character heights."""

    def __init__(self) -> None:
        self.heights_mm: list[float] = []

    def __call__(self, surface: HeightMap, height_mm: float) -> Scan:
        self.heights_mm.append(height_mm)
        return felt(surface, height_mm)


def test_whiskers_are_chosen_by_what_a_pass_of_fixed_scale_has_felt() -> None:
    feel = Recorder()
    reader = Reader(format="A9A9")
    read = reader.decide(Evidence.of(reader.feel(Surface(PART.height_map, feel=feel))))
    assert read.text == "K7B2"
    assert feel.heights_mm[0] == FIRST_HEIGHT_MM
    assert feel.heights_mm[1] == pytest.approx(5.0, rel=0.15)


def test_a_height_that_is_given_is_taken_as_it_is() -> None:
    feel = Recorder()
    Reader(format="A9A9", height_mm=5.0).feel(Surface(PART.height_map, feel=feel))
    assert feel.heights_mm == [5.0]


@pytest.mark.parametrize(("height_mm", "seed", "near"), [(0.8, 3, 0.3), (0.8, 7, 0.15), (25.0, 3, 0.15)])
def test_small_and_large_characters_are_found_by_it_and_read(
    height_mm: float, seed: int, near: float
) -> None:
    """The smallest are up to a quarter larger by it, with ideal sensors too, and read all the same."""
    part = stamp("K7B2", fonts="gothic", height_mm=height_mm, seed=seed)
    reader = Reader(format="A9A9")
    found = felt_heights_mm(reader.touch.request, part.height_map)
    assert any(one == pytest.approx(height_mm, rel=near) for one in found)
    assert reader.read(part.height_map).text == "K7B2"


@pytest.mark.parametrize(
    ("height_mm", "said"),
    [
        (None, "the map is 0.083 x 0.2 mm: too small for characters; measure the whole serial"),
        (5.0, "the map is 0.083 x 0.2 mm with samples .* it exceeds 64,000,000 samples; check the unit"),
    ],
)
def test_a_map_with_a_wrong_unit_is_refused_by_its_own_size(height_mm: float | None, said: str) -> None:
    tiny = HeightMap(np.zeros((1601, 651), dtype=np.float32), 0.000_128)
    with pytest.raises(MapError, match=said):
        Reader(height_mm=height_mm).read(tiny)
