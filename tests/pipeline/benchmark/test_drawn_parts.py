"""Parts that were drawn and kept come back to the last bit, and nothing is simulated when they are read."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs import stamp
from glyphs.surface.maps import HeightMap
from recognition.find.first_pass import virtual_feel
from recognition.reader import Reader
from tests.benchmarks import drawn_parts
from tests.benchmarks.drawn_parts import SOIL_ARRAYS, DrawnPart, load_part, save_part, unread_parts
from tests.benchmarks.risk_parts import feel_part, kept_of, read_part


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(format="A9")


@pytest.fixture(scope="module")
def part() -> DrawnPart:
    """A part with soft dirt."""
    dirty = stamp("K7", seed=4, dirt=0.3)
    facts = (8, "stamped", 0.3, "gothic", "A9", "workshop", "K7", 5.0)
    return DrawnPart(*facts, dirty.height_map, dirty.photograph(), dirty.soil)


@pytest.fixture(scope="module")
def drawn_file(part: DrawnPart, reader: Reader, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("drawn") / "000008.h5"
    save_part(path, part, feel_part(part, reader), seconds_drawn=1.5)
    return path


def same(a: Any, b: Any) -> bool:
    """Whether two records are equal to the last bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    return bool(a == b)


def test_a_part_comes_back_as_it_was(part: DrawnPart, drawn_file: Path) -> None:
    loaded, _ = load_part(drawn_file)
    assert loaded.facts == part.facts
    assert same(loaded.height_map.z_mm, part.height_map.z_mm)
    assert loaded.height_map.pitch_mm == part.height_map.pitch_mm
    assert same(vars(loaded.photo), vars(part.photo))
    assert all(same(getattr(loaded.soil_layer, name), getattr(part.soil_layer, name)) for name in SOIL_ARRAYS)
    assert set(SOIL_ARRAYS) == {f.name for f in fields(loaded.soil_layer)}  # type: ignore[arg-type]


def test_a_kept_part_is_read_without_simulation_as_one_drawn_afresh(
    part: DrawnPart, drawn_file: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch
) -> None:
    touch, vision = reader.read(part.height_map, soil=part.soil_layer), reader.read(part.photo)
    afresh = {"tactile": touch, "vision": vision, "fused": reader.fuse(touch, vision)}
    monkeypatch.setattr(drawn_parts, "Mounted", None)
    loaded, sweeps = load_part(drawn_file)
    readings = read_part(loaded, sweeps, reader)["readings"]
    assert same(readings, {source: kept_of(reading) for source, reading in afresh.items()})
    assert sweeps.simulated == 0


def test_another_surface_is_simulated(part: DrawnPart, drawn_file: Path) -> None:
    _, sweeps = load_part(drawn_file)
    raised = HeightMap(-part.height_map.z_mm, part.height_map.pitch_mm)
    with sweeps.in_place_of_simulation():
        scan = virtual_feel()(raised, part.height_mm)
    assert sweeps.simulated == len(scan.sweeps)
    again = virtual_feel()(raised, part.height_mm)
    assert same([s.moment_n_mm for s in scan.sweeps], [s.moment_n_mm for s in again.sweeps])


def test_runs_share_the_parts_that_have_no_reading(tmp_path: Path) -> None:
    drawn, out = tmp_path / "drawn", tmp_path / "new" / "readings"
    drawn.mkdir()
    for number in range(8):
        (drawn / f"{number:06d}.h5").touch()
    assert [target.name for _, target in unread_parts(drawn, out, first=1, step=2)] == [
        *("000001.pkl", "000003.pkl", "000005.pkl", "000007.pkl")
    ]
    (out / "000003.pkl").touch()
    later = [source.stem for source, _ in unread_parts(drawn, out, first=1, step=2)]
    assert later == ["000001", "000005", "000007"]
    assert not list(unread_parts(drawn, out, hours=-1.0))
