"""Parts that lie upside down, and files whose rows are not known: what is accepted, and what a person is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pipeline
from glyphs import HeightMap, stamp
from recognition import Decision, Grammar, Reader, Reading

TEXT, TURNED = "9608", "8096"
PART = stamp(TEXT, fonts="gothic", height_mm=4.0, seed=5)
SURFACE, PHOTO = PART.height_map, PART.photograph()


def half_turned(grid: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(grid[::-1, ::-1])


def readings(reader: Reader, *, upside_down: bool) -> list[Reading]:
    surface, photo = SURFACE, PHOTO
    if upside_down:
        surface = HeightMap(half_turned(surface.z_mm), surface.pitch_mm)
        photo = replace(photo, pixels=half_turned(photo.pixels))
    touch, vision = reader.read(surface), reader.read(photo)
    return [touch, vision, reader.fuse(touch, vision)]


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(format="9999", height_mm=4.0)


@pytest.mark.parametrize("upside_down", [False, True])
def test_a_serial_that_reads_otherwise_upside_down_goes_to_review(reader: Reader, upside_down: bool) -> None:
    for read in readings(reader, upside_down=upside_down):
        assert read.decision is Decision.REVIEW
        assert {read.text, other_of(read)} == {TEXT, TURNED}


def other_of(read: Reading) -> str:
    (message,) = [text for text in read.messages() if "also readable upside down" in text]
    return message.split("upside down: ")[1].split()[0]


def test_where_parts_lie_upright_it_is_accepted() -> None:
    upright = Reader(format="9999", height_mm=4.0, orientation="upright")
    for read in readings(upright, upside_down=False):
        assert (read.text, read.decision) == (TEXT, Decision.ACCEPT)


@pytest.mark.parametrize("upside_down", [False, True])
def test_a_list_of_serials_with_one_of_the_two_shows_which_way_up_a_part_lies(upside_down: bool) -> None:
    listed = Reader(format=Grammar.parse("9999", lexicon=[TEXT, "1234"]), height_mm=4.0)
    photo = replace(PHOTO, pixels=half_turned(PHOTO.pixels)) if upside_down else PHOTO
    read = listed.read(photo)
    assert (read.text, read.decision) == (TEXT, Decision.ACCEPT)


def test_a_text_that_reads_one_way_is_accepted_upside_down() -> None:
    photo = stamp("K4R7", fonts="gothic", height_mm=4.0, seed=6).photograph()
    read = Reader(format="A9A9", height_mm=4.0).read(replace(photo, pixels=half_turned(photo.pixels)))
    assert (read.text, read.decision) == ("K4R7", Decision.ACCEPT)
    assert abs(read.rotation_deg) > 170.0


# 2 and 5 are each other's mirror images; a text with 4 and 7 has none
DIGITS, ONE_WAY = "3353", "R47K"
SETTINGS = {"format": "****", "height_mm": 4.0, "fonts": "gothic", "orientation": "upright"}


def surface(text: str) -> tuple[np.ndarray, float]:
    made = stamp(text, fonts="gothic", height_mm=4.0, seed=5).height_map
    return made.z_mm, made.pitch_mm


def read(path: Path, **more: object) -> Reading:
    return pipeline.read(path, **{**SETTINGS, "format": "9999"}, **more)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The digits with rows that are stated, not stated, and the other way round."""
    folder = tmp_path_factory.mktemp("maps")
    z, pitch = surface(DIGITS)
    for name, values in {
        "stated": {"z_mm": z, "rows": "top-first"},
        "stated-bottom-first": {"z_mm": z[::-1], "rows": "bottom-first"},
        "unstated": {"z_mm": z},
        "unstated-bottom-first": {"z_mm": z[::-1]},
    }.items():
        np.savez(folder / f"{name}.npz", pitch_mm=pitch, **values)
    return {path.stem: path for path in folder.iterdir()}


@pytest.mark.parametrize("name", ["stated", "stated-bottom-first"])
def test_rows_that_a_file_states_are_taken(files: dict[str, Path], name: str) -> None:
    found = read(files[name])
    assert (found.text, found.decision) == (DIGITS, Decision.ACCEPT)


@pytest.mark.parametrize(
    ("name", "rows"), [("unstated", "top-first"), ("unstated-bottom-first", "bottom-first")]
)
def test_rows_that_are_not_known_are_never_taken_the_wrong_way(
    files: dict[str, Path], name: str, rows: str
) -> None:
    """The shapes of the digits may tell the order of the rows; where they do not, a person is asked."""
    found = read(files[name])
    if found.decision is Decision.ACCEPT:
        assert found.text == DIGITS
    else:
        (message,) = [text for text in found.messages() if "with its rows in the other order" in text]
        assert {found.text, message.split("order: ")[1].split()[0]} == {DIGITS, "3323"}
    found = read(files[name], rows=rows)
    assert (found.text, found.decision) == (DIGITS, Decision.ACCEPT)


def test_points_with_y_down_are_read_by_the_text_that_reads_one_way(tmp_path: Path) -> None:
    z, pitch = surface(ONE_WAY)
    z, pitch = z[::2, ::2], 2 * pitch
    y, x = np.mgrid[: z.shape[0], : z.shape[1]] * pitch
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    np.savetxt(tmp_path / "part.xyz", points, fmt="%.4f")
    found = pipeline.read(tmp_path / "part.xyz", **{**SETTINGS, "format": "A99A"})
    assert found.text == ONE_WAY
    assert any("rows of the map in the other order" in note for note in found.notes)
    found = pipeline.read(tmp_path / "part.xyz", **{**SETTINGS, "format": "A99A"}, rows="top-first")
    assert (found.text, found.decision, found.notes) == (ONE_WAY, Decision.ACCEPT, ())
