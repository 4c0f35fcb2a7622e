"""Reading from Python, through the names that the packages export."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import pydoc
from dataclasses import fields
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import whisker_array
from glyphs import FileError, FontError, FormatError, HeightMap, MapError, Photo, stamp
from pipeline import SettingsError, read
from recognition import Reader, ReaderSettings, Reading, Verdict
from tests.contract.front_doors import environment, run_process

PACKAGES = ("glyphs", "whisker_array", "recognition", "pipeline")


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(fonts=["gothic"], format="A9", height_mm=4.0)


@pytest.fixture(scope="module")
def reading(reader: Reader) -> Reading:
    return reader.read(stamp("K7", fonts="gothic", height_mm=4.0, seed=3).height_map)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_of_the_vocabulary_is_there(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None, name
    with pytest.raises(AttributeError):
        module.nothing_of_this_name  # noqa: B018


def test_a_clean_plate_is_accepted_with_places_and_candidates(reading: Reading) -> None:
    assert (reading.text, reading.decision) == ("K7", "accept")
    assert reading.confidence > 0.98
    assert [place.candidates[0].char for place in reading.characters] == ["K", "7"]
    first, second = (place.box for place in reading.characters)
    assert first.x0_mm < first.x1_mm <= second.x0_mm + 0.5
    assert first.y1_mm - first.y0_mm == pytest.approx(4.0, rel=0.15)


def test_the_same_part_is_read_alike_twice(reader: Reader, reading: Reading) -> None:
    again = reader.read(stamp("K7", fonts="gothic", height_mm=4.0, seed=3).height_map)
    assert (again.text, again.confidence) == (reading.text, reading.confidence)


def test_another_text_is_refuted_and_the_same_confirmed(reader: Reader, reading: Reading) -> None:
    for text, verdict in (("K7", Verdict.CONFIRMED), ("H7", Verdict.REFUTED)):
        verification = reader.verify(reading, text).trace.verification
        assert verification is not None
        assert verification.verdict is verdict


def test_a_part_an_array_and_a_map_read_alike(reader: Reader, reading: Reading) -> None:
    part = stamp("K7", fonts=["gothic"], height_mm=4.0, seed=3)
    heights = np.asarray(part.height_map.z_mm)
    for again in (reader.read(part), reader.read(heights, pitch_mm=part.height_map.pitch_mm)):
        assert (again.text, again.confidence) == (reading.text, reading.confidence)


def test_a_picture_is_a_photograph(reader: Reader) -> None:
    photo = stamp("K7", fonts="gothic", height_mm=4.0, seed=3).photograph()
    seen = reader.read(np.array(photo.pixels), pitch_mm=photo.pitch_mm)
    assert (seen.source, seen.text, seen.confidence) == ("vision", "K7", reader.read(photo).confidence)


@pytest.mark.parametrize(
    ("item", "error", "told"),
    [
        ("part.npz", TypeError, "a str cannot be read; pipeline.read reads files"),
        (Path("part.npz"), TypeError, "pipeline.read reads files"),
        (np.zeros((40, 40)), ValueError, "has no pitch; give pitch_mm"),
        (7, TypeError, "give a HeightMap, Scan, Photo or Part"),
    ],
)
def test_what_is_not_data_of_a_part_is_told(
    item: object, error: type[Exception], told: str, reader: Reader
) -> None:
    with pytest.raises(error, match=told):
        reader.read(item)  # type: ignore[arg-type]


def test_fonts_are_spelled_alike_and_one_may_be_a_string() -> None:
    for spelling in ("gothic", ["gothic"], ("gothic",)):
        assert stamp("K7", fonts=spelling).stamped.font_name == "gothic"
        assert Reader(fonts=spelling).settings.fonts == ("gothic",)
    assert "fonts" in inspect.signature(read).parameters
    with pytest.raises(SettingsError, match="unknown setting font; did you mean fonts"):
        read("part.npz", font="gothic")


@pytest.mark.parametrize(
    ("function", "options"),
    [
        (Reader, {field.name for field in fields(ReaderSettings)}),
        (whisker_array.trace_scan, {"fidelity", "friction", "soil", "sensor", "stage", "rng"}),
        (read, {"format", "height_mm", "mode", "unit", "pitch_mm", "fonts"}),
    ],
)
def test_options_are_listed_where_one_types(function: object, options: set[str]) -> None:
    parameters = inspect.signature(function).parameters  # type: ignore[arg-type]
    assert options <= set(parameters)
    assert not [p for p in parameters.values() if p.kind is inspect.Parameter.VAR_KEYWORD]
    assert all(name in pydoc.render_doc(function) for name in options)


def test_a_scan_reads_as_its_height_map_does(tmp_path: Path, reader: Reader, reading: Reading) -> None:
    surface = stamp("K7", fonts="gothic", height_mm=4.0, seed=3).height_map
    touch = whisker_array.default_touch(4.0)
    plan = whisker_array.default_plan((0.0, 0.0, *surface.size_mm), character_height_mm=4.0)
    scan = whisker_array.trace_scan(surface, touch=touch, plan=plan)
    assert reader.read(scan).text == reading.text
    path = tmp_path / "scan.h5"
    whisker_array.save_scan(scan, path)
    assert reader.read(whisker_array.load_scan(path)).text == reading.text


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"fonts": ["comic"]}, FontError),
        ({"format": ""}, FormatError),
        ({"height_mm": -1.0}, ValueError),
        ({"colour": "red"}, TypeError),
    ],
)
def test_a_wrong_option_is_a_typed_error(options: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        Reader(**options)  # type: ignore[arg-type]


def test_what_is_no_part_is_a_typed_error(reader: Reader) -> None:
    with pytest.raises(TypeError, match=r"a str cannot be read; pipeline\.read reads files"):
        reader.read("part.npz")  # type: ignore[arg-type]
    flat = HeightMap(np.zeros((40, 60), dtype=np.float32), 0.05)
    with pytest.raises(ValueError, match="two of HeightMap"):
        reader.read(flat, flat)
    with pytest.raises(MapError):
        HeightMap(np.zeros((40, 60), dtype=np.float32), 0.0)


def test_a_file_that_is_not_there_names_itself(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.npz"):
        read(tmp_path / "none.npz")


def test_a_blank_photograph_is_rejected_with_a_reason(reader: Reader) -> None:
    blank = reader.read(Photo(np.full((120, 200), 128, dtype=np.uint8)))
    assert (blank.text, blank.decision) == ("", "reject")
    assert blank.flags


mpl.use("Agg")


@pytest.mark.parametrize(("text", "format"), [("7", "9"), ("KX407251", "AA999999")])
def test_words_are_not_cut_and_panels_fill_the_width(text: str, format: str) -> None:
    part = stamp(text, fonts="gothic", height_mm=4.0, seed=3)
    figure = (
        Reader(format=format, fonts=["gothic"], height_mm=4.0, experts=("network",))
        .read(part.height_map)
        .plot(title="part-000")
    )
    figure.draw_without_rendering()
    whole = figure.bbox
    for axes in figure.axes:
        for title in (axes.title, axes._left_title):
            words = title.get_window_extent()
            assert not title.get_text() or whole.x0 <= words.x0 <= words.x1 <= whole.x1, title.get_text()
    pictures = [axes.get_window_extent() for axes in figure.axes if axes.images]
    widest_row = max(
        sum(p.width for p in pictures if abs(p.y0 - row.y0) < 0.1 * row.height) for row in pictures
    )
    assert widest_row > 0.4 * whole.width


def test_a_part_is_read_where_networks_cannot_be_opened(height_map: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "onnxruntime.py").write_text("raise ImportError('networks are not for this test')\n", "utf-8")
    known = environment()
    known["PYTHONPATH"] = f"{broken}:{known.get('PYTHONPATH', '')}".rstrip(":")
    table = tmp_path / "read.jsonl"
    asked = ("--font", "gothic", "--format", "A9", "--height-mm", "4", "--jobs", "1", "--out", table)
    alone = run_process("read", height_map, *asked, "--experts", "templates", env=known)
    assert alone.status == 0, alone.err
    assert json.loads(table.read_text("utf-8").splitlines()[0])["text"] == "K7"


PRODUCT = {"glyphs", "whisker_array", "recognition", "pipeline"}
HERE = Path(__file__).parent


def inner_imports(source: str) -> list[str]:
    """Modules below the four packages that a source imports."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
    return [name for name in names if "." in name and name.partition(".")[0] in PRODUCT]


def test_inner_imports_are_found() -> None:
    assert inner_imports("import pipeline.cli.main\nfrom glyphs import stamp") == ["pipeline.cli.main"]


@pytest.mark.parametrize("path", sorted(HERE.glob("*.py")), ids=lambda path: path.stem)
def test_only_the_vocabulary_of_the_packages_is_imported(path: Path) -> None:
    assert inner_imports(path.read_text(encoding="utf-8")) == []
