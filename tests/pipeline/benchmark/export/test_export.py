"""An exam as files: what is written, that it fits the part, that it goes on and is checked; maps of 16 bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glyphs.errors import FileError
from pipeline import read_height_map
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.export.exported_part import FINEST, polygon_px, step_of, write_layer
from pipeline.benchmark.export.folder import ExportError, check, export
from pipeline.formats.touch_file import read_part_map
from tests.factories import designed_parts
from tests.support.run_tables import Counted, csv_rows

EMPTY_MM = 0.06
"""A two-tone test of places: a mark is deeper than half of its 0.2 mm where the land is not."""


@pytest.fixture(scope="module")
def exam(tmp_path_factory: pytest.TempPathFactory) -> tuple[DesignedParts, Path]:
    parts = designed_parts(severities=(0.0, 0.4), depth_mm=0.2, layout="two-lines")
    folder = tmp_path_factory.mktemp("exam")
    assert export(parts, folder) == 2
    return parts, folder


def _labels(folder: Path) -> list[dict[str, object]]:
    return [json.loads(path.read_text()) for path in sorted((folder / "labels").iterdir())]


def test_a_part_is_written_as_it_is_made(exam: tuple[DesignedParts, Path]) -> None:
    parts, folder = exam
    for item in parts.items():
        specimen, path = parts.make(item), folder / "parts" / f"{item.part}.npz"
        np.testing.assert_array_equal(read_height_map(path).z_mm, specimen.height_map.z_mm)
        assert (
            (read_part_map(path).soil is None) == (specimen.soil is None) == (item.condition.severity == 0.0)
        )
        with Image.open(folder / "ideal" / f"{item.part}.png") as picture:
            step, zero = float(picture.text["step"]), int(picture.text["zero"])  # type: ignore[attr-defined]
            heights = (np.asarray(picture, dtype=np.float64) - zero) * step
        # rounded to a step
        np.testing.assert_allclose(heights, specimen.height_map.z_mm, atol=0.5001 * step)


def test_truth_in_all_layouts(exam: tuple[DesignedParts, Path]) -> None:
    parts, folder = exam
    texts = {item.part: parts.truth_of(item) for item in parts.items()}
    table = csv_rows(folder / "truth.csv")
    assert {row["part"]: row["text"] for row in table} == texts
    assert [row["severity"] for row in table] == ["0.0", "0.4"]
    lines = [line.split("\t") for line in (folder / "rec_gt.txt").read_text().splitlines()]
    assert len(lines) == 2 * 4
    assert all((folder / path).is_file() for path, _ in lines)
    assert {text for _, text in lines} == set(texts.values())
    for path, boxes in (line.split("\t") for line in (folder / "det_gt.txt").read_text().splitlines()):
        wanted_line, beside = json.loads(boxes)
        assert wanted_line["transcription"] in texts.values()
        assert beside["transcription"] == "###"
        with Image.open(folder / path) as picture:
            assert max(x for x, _ in wanted_line["points"]) < picture.width
            assert max(y for _, y in wanted_line["points"]) < picture.height
    pictures = [json.loads(line) for line in (folder / "truth.jsonl").read_text().splitlines()]
    assert [p["view"] for p in pictures] == 2 * ["photo", "edges", "relief", "ideal"]
    assert all("".join(c["char"] for c in p["characters"]) == p["transcription"] for p in pictures)


def test_places_are_where_touch_feels_marks(exam: tuple[DesignedParts, Path]) -> None:
    _, folder = exam
    clean = next(label for label in _labels(folder) if "0-0000" in str(label["part"]))
    view = clean["views"]["relief-16"]  # type: ignore[index]
    with Image.open(folder / view["file"]) as picture:
        heights = (np.asarray(picture, dtype=np.float64) - 32768) * view["step"]
    inked = np.zeros(heights.shape, dtype=bool)
    for box in [*(c["box_mm"] for c in clean["characters"]), clean["beside_mm"]]:  # type: ignore[attr-defined, misc]
        (x0, y0), _, (x1, y1), _ = np.round(polygon_px(box, view)).astype(int)
        inside = heights[y0:y1, x0:x1]
        assert inside.min() < -EMPTY_MM
        inked[y0 - 2 : y1 + 3, x0 - 2 : x1 + 3] = True  # the walls reach a little beyond the ink
    known = ~inked & (heights > -32768 * view["step"])
    assert heights[known].min() > -EMPTY_MM


def test_an_export_goes_on_where_it_was_broken_off(exam: tuple[DesignedParts, Path], tmp_path: Path) -> None:
    parts, whole = exam
    first, _ = (item.part for item in parts.items())
    beginning = replace(parts, first=1)
    counted = Counted()
    assert export(beginning, tmp_path, progress=counted) == 1
    assert not check(parts, tmp_path)
    (tmp_path / "photos" / f"{first}.png").write_bytes(b"torn")
    export(parts, tmp_path, progress=counted)
    assert (counted.parts, counted.starts) == (3, [(1, 0), (2, 0)])
    export(parts, tmp_path, progress=counted)
    assert (counted.parts, counted.starts[-1]) == (3, (2, 2))
    assert (tmp_path / "manifest.json").read_text() == (whole / "manifest.json").read_text()
    first_photo, stray = tmp_path / "photos" / f"{first}.png", tmp_path / "photos" / "stray.png"
    first_photo.rename(stray)
    (tmp_path / "truth.csv").write_text("part,text\n")
    assert list(check(parts, tmp_path).items()) == [
        (f"photos/{first}.png", "missing"),
        ("photos/stray.png", "not in the manifest"),
        ("truth.csv", "changed"),
    ]


def test_another_folder_is_refused(exam: tuple[DesignedParts, Path], tmp_path: Path) -> None:
    parts, folder = exam
    other = replace(parts, design=parts.design.model_copy(update={"seed": 77}))
    with pytest.raises(FileError, match=r"holds another export \(seed was \d+, now 77\)"):
        export(other, folder)
    with pytest.raises(FileError, match="no export of this design"):
        check(other, folder)
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(FileError, match="holds no export"):
        export(parts, tmp_path)


def test_a_part_that_cannot_be_made_costs_no_other(tmp_path: Path) -> None:
    design = Design.of(
        parts=2, cross=("soil",), part={"font": "gothic", "format": "A9", "severity": 0.5,
                                        "soil": (f"{__name__}:broken", "caked")},
    )  # fmt: skip
    with pytest.raises(ExportError, match=r"1 parts could not be made, the first is .*out of dirt"):
        export(DesignedParts(design), tmp_path)
    assert [p.name for p in (tmp_path / "labels").iterdir()] == ["caked-0000.json"]


def broken(*_: object, **__: object) -> None:
    raise RuntimeError("out of dirt")


@pytest.mark.parametrize("format", ["AA99", "A 9", "9A*"])
def test_the_truth_needs_no_part(format: str) -> None:
    parts = designed_parts(formats=(format,), parts=2, severities=(0.0,))
    assert [parts.truth_of(i) for i in parts.items()] == [parts.make(i).truth for i in parts.items()]


@pytest.mark.parametrize("most", [1e-5, 0.3, 3.2767, 3.3, 50.0])
def test_values_come_back_to_half_a_step(tmp_path: Path, most: float) -> None:
    values = np.linspace(-most, most, 30).reshape(5, 6)
    values[2, 3] = np.nan
    step = write_layer(tmp_path / "a.png", values, unit="mm", pitch_mm=0.05, origin_mm=(0.5, -1.0))
    with Image.open(tmp_path / "a.png") as picture:
        text: dict[str, str] = picture.text  # type: ignore[attr-defined]
        pixels = np.asarray(picture)
    assert pixels.dtype == np.uint16
    assert pixels[2, 3] == 0
    decoded = np.where(pixels == 0, np.nan, (pixels.astype(float) - int(text["zero"])) * float(text["step"]))
    np.testing.assert_allclose(decoded, values, atol=0.5001 * step)
    assert (text["unit"], text["pitch_mm"], text["origin_mm"]) == ("mm", "0.05", "0.5 -1")
    assert step == step_of(values)
    assert step == FINEST or step / 2 * 32767 < most  # the least that fits


def test_only_png(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="unsupported output format"):
        write_layer(tmp_path / "a.jpg", np.zeros((4, 4)), unit="mm", pitch_mm=0.1, origin_mm=(0.0, 0.0))
