"""Parts out of nothing."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from glyphs.die import Face
from pipeline.files import FileProblem, read_height_map
from pipeline.synth import SynthSpec, make_part, write_parts
from pipeline.truth import load_truth


def test_a_part_depends_on_seed_and_number_alone(tmp_path: Path) -> None:
    spec = SynthSpec(mask="A9", seed=7, height_mm=3.0)
    few = write_parts(spec, tmp_path / "few", parts=2)
    more = write_parts(spec, tmp_path / "more", parts=3)
    assert more[:2] == few
    for name, text in few:
        one, other = (read_height_map(tmp_path / f / f"{name}.npz") for f in ("few", "more"))
        np.testing.assert_array_equal(one.z_mm, other.z_mm)
        assert len(text) == 2
    assert make_part(spec, 1).text == more[1][1]
    changed = make_part(SynthSpec(mask="A9", seed=8, height_mm=3.0), 1)
    assert changed.text != more[1][1] or changed.height_map.shape != make_part(spec, 1).height_map.shape


def test_the_truth_stands_in_its_table_alone(tmp_path: Path) -> None:
    made = write_parts(SynthSpec(mask="99", height_mm=3.0), tmp_path / "out", parts=2)
    assert load_truth(tmp_path / "out" / "truth.csv") == dict(made)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "part-000.npz",
        "part-001.npz",
        "truth.csv",
    ]
    with np.load(tmp_path / "out" / "part-000.npz") as content:
        assert sorted(content.files) == ["pitch_mm", "z_mm"]
    with (tmp_path / "out" / "truth.csv").open(newline="") as stream:
        assert next(csv.reader(stream)) == ["part", "text"]


def test_a_folder_that_is_not_empty_is_kept(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    spec = SynthSpec(mask="9", height_mm=3.0)
    with pytest.raises(FileProblem, match="--overwrite"):
        write_parts(spec, tmp_path, parts=1)
    write_parts(spec, tmp_path, parts=1, overwrite=True)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "part-000.npz").is_file()
    with pytest.raises(FileProblem, match="cannot be made"):
        write_parts(spec, tmp_path / "mine.txt" / "deeper", parts=1)


def test_what_is_asked_for_is_stamped() -> None:
    sunk = make_part(SynthSpec(mask="8", height_mm=4.0, depth_mm=0.3, variation=False), 0)
    assert sunk.height_map.z_mm.min() == pytest.approx(-0.3, abs=0.01)
    assert sunk.height_map.z_mm.max() == pytest.approx(0.0, abs=0.01)
    raised = make_part(SynthSpec(mask="8", height_mm=4.0, depth_mm=0.3, variation=False, raised=True), 0)
    assert raised.height_map.z_mm.max() == pytest.approx(0.3, abs=0.01)
    steep, gentle = (
        make_part(SynthSpec(mask="8", height_mm=4.0, face=Face.SHARP, bevel_deg=b, variation=False), 0)
        for b in (60.0, 30.0)
    )
    assert np.abs(np.diff(steep.height_map.z_mm)).max() > np.abs(np.diff(gentle.height_map.z_mm)).max()


@pytest.mark.parametrize(
    "wrong",
    [
        {"mask": ""},
        {"mask": "9", "seed": -1},
        {"mask": "9", "font": "comic"},
        {"mask": "9", "height_mm": 0.0},
        {"mask": "9", "bevel_deg": 90.0},
        {"mask": "9", "depth_mm": -0.1},
    ],
)
def test_what_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        SynthSpec(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("parts", [0, -3, 10_000_000])
def test_a_number_of_parts_that_cannot_be_is_refused(parts: int, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="number of parts"):
        write_parts(SynthSpec(mask="9"), tmp_path / "out", parts=parts)
    assert not (tmp_path / "out").exists()
