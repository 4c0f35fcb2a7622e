"""Parts out of nothing."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from glyphs.errors import FileError, MarksError
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.dies import DIES
from glyphs.stamping.faces import Face
from glyphs.stamping.layouts import LAYOUTS
from glyphs.stamping.plates import PLATES
from glyphs.stamping.variation import PRACTICES
from pipeline.cli.main import main
from pipeline.common.stamping import DieName, LayoutName, PlateName, PracticeName
from pipeline.formats.npz import soil_members
from pipeline.formats.photos import read_photo
from pipeline.formats.synth import SynthSpec, make_part, write_parts
from pipeline.formats.touch_file import read_height_map
from pipeline.formats.truth import load_truth
from tests.support.run_tables import csv_rows


def test_a_part_depends_on_seed_and_number_alone(tmp_path: Path) -> None:
    spec = SynthSpec(format="A9", seed=7, height_mm=3.0)
    few = write_parts(spec, tmp_path / "few", parts=2)
    more = write_parts(spec, tmp_path / "more", parts=3)
    assert more[:2] == few
    for name, text in few:
        assert (tmp_path / "few" / f"{name}.png").read_bytes() == (
            tmp_path / "more" / f"{name}.png"
        ).read_bytes()
        first, second = (read_height_map(tmp_path / f / f"{name}.npz") for f in ("few", "more"))
        np.testing.assert_array_equal(first.z_mm, second.z_mm)
        assert len(text) == 2
    assert make_part(spec, 1).text == more[1][1]
    changed = make_part(SynthSpec(format="A9", seed=8, height_mm=3.0), 1)
    assert changed.text != more[1][1] or changed.height_map.shape != make_part(spec, 1).height_map.shape


def test_the_truth_stands_in_its_table_alone(tmp_path: Path) -> None:
    truth = write_parts(SynthSpec(format="99", height_mm=3.0), tmp_path / "out", parts=2)
    assert load_truth(tmp_path / "out" / "truth.csv") == dict(truth)
    files = [f"part-00{k}.{suffix}" for k in (0, 1) for suffix in ("npz", "png")]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [*files, "truth.csv"]
    with np.load(tmp_path / "out" / "part-000.npz") as content:
        assert sorted(content.files) == ["pitch_mm", "rows", "z_mm"]
    assert [*csv_rows(tmp_path / "out" / "truth.csv")[0]] == ["part", "text"]


def test_a_folder_that_is_not_empty_is_kept(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    spec = SynthSpec(format="9", height_mm=3.0)
    with pytest.raises(FileError, match="--overwrite"):
        write_parts(spec, tmp_path, parts=1)
    write_parts(spec, tmp_path, parts=1, overwrite=True)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "part-000.npz").is_file()
    with pytest.raises(FileError, match="cannot be made"):
        write_parts(spec, tmp_path / "mine.txt" / "deeper", parts=1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"format": ""},
        *({"seed": -1}, {"font": "comic"}, {"height_mm": 0.0}, {"bevel_deg": 90.0}, {"depth_mm": -0.1}),
        *({"light_elevation_deg": 0.0}, {"light_azimuth_deg": float("nan")}, {"pixel_mm": 0.0}),
        *({"die": "oval"}, {"die": "sharp", "face": Face.ROUND}, {"plate": "moon"}, {"layout": "spiral"}),
        *({"practice": "robot"}, {"practice": "hand", "variation": False}),
    ],
)
def test_what_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(MarksError, match=r"\S"):
        SynthSpec(**{"format": "9", **wrong})  # type: ignore[arg-type]


def test_a_soiled_part_is_written_whole(tmp_path: Path) -> None:
    spec = SynthSpec(format="A9", height_mm=3.0, soiling=Soiling(severity=0.7))
    write_parts(spec, tmp_path / "out", parts=2)
    soiled = make_part(spec, 1)
    assert soiled.soil is not None
    np.testing.assert_array_equal(
        read_height_map(tmp_path / "out" / "part-001.npz").z_mm, soiled.height_map.z_mm
    )
    with np.load(tmp_path / "out" / "part-001.npz") as content:
        assert sorted(content.files) == ["friction", "hardness_mpa", "pitch_mm", "rows", "soft_mm", "z_mm"]
        for name, values in soil_members(soiled.soil).items():  # half precision: eleven bits
            np.testing.assert_allclose(content[name].astype(np.float32), values, rtol=2**-11, atol=1e-7)
    photo = spec.photograph(soiled)
    back = read_photo(tmp_path / "out" / "part-001.png")
    np.testing.assert_array_equal(back.pixels, photo.pixels)
    assert photo.pitch_mm == 0.06
    assert back.pitch_mm == pytest.approx(0.06, rel=1e-4)
    width, height = soiled.height_map.size_mm
    assert photo.centre_mm == (width / 2, height / 2)
    assert photo.shape == (round(height / 0.06) + 1, round(width / 0.06) + 1)


def test_dirt_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["--parts", "1", "--format", "A9", "--height-mm", "3"]
    assert main(["synth", str(tmp_path / "a"), *common, "--dirt", "0.5", "--mix", "oil=0,pits=0"]) == 0
    with np.load(tmp_path / "a" / "part-000.npz") as content:
        assert content["soft_mm"].max() > 0.0
        assert content["friction"].min() > 0.19  # no oil
    assert main(["synth", str(tmp_path / "b"), *common, "--mix", "swarf=0.6", "--no-photo"]) == 0
    assert not (tmp_path / "b" / "part-000.png").exists()
    with np.load(tmp_path / "b" / "part-000.npz") as content:
        assert content["soft_mm"].max() == 0.0
    assert main(["synth", str(tmp_path / "c"), *common, "--dirt", "1.5"]) == 2
    assert "severity is 1.5" in capsys.readouterr().err
    assert main(["synth", str(tmp_path / "c"), *common, "--mix", "grime=-1"]) == 2
    assert "grime is -1" in capsys.readouterr().err
    for wrong, complaint in (("dust=1", "the kinds are grime"), ("oil", "write kinds and amounts")):
        assert main(["synth", str(tmp_path / "c"), *common, "--mix", wrong]) == 2
        assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "names"),
    [(DieName, DIES), (PlateName, PLATES), (PracticeName, PRACTICES), (LayoutName, LAYOUTS)],
)
def test_the_words_of_the_command_line_are_the_names_there_are(words: object, names: object) -> None:
    assert list(get_args(words)) == list(names)  # type: ignore[call-overload]
