"""Height maps whose rows may be in either order: what is accepted, and what a person is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pipeline
from glyphs import stamp
from recognition import Decision, Reading

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
