"""The first pass: what chooses the whiskers of the scan that is read is felt, not known."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs import stamp
from glyphs.surface.maps import HeightMap, MapError
from recognition import Reader
from recognition.decide.evidence import Evidence
from recognition.find.first_pass import FIRST_HEIGHT_MM, felt_heights_mm
from recognition.surface import Surface
from tests.support.felt import felt
from whisker_array.scan.scan import Scan

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


@pytest.mark.parametrize("height_mm", [0.8, 25.0])
def test_small_and_large_characters_are_found_by_it(height_mm: float) -> None:
    part = stamp("K7B2", fonts="gothic", height_mm=height_mm, seed=3)
    found = felt_heights_mm(Reader(format="A9A9").touch.request, part.height_map)
    assert any(one == pytest.approx(height_mm, rel=0.15) for one in found)


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
