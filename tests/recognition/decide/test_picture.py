"""Pictures of a part by both senses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from glyphs.camera.photo import Photo
from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from recognition.decide.picture import reading_figure
from recognition.decide.reading import Candidate, CharacterReading, Reading
from recognition.language.box import Box
from recognition.language.confusions import CharacterState, PlaceState
from recognition.marks.grade import Action, MarkGrade, Parameter
from tests.support.readings import traced


def reading(source: str) -> Reading:
    state = PlaceState(CharacterState.CONFUSED, "8", 0.6, "B", 0.3)
    grade = MarkGrade((Parameter("contrast", 0.45, 2), Parameter("contamination", 0.0, 4)), Action.NONE)
    character = CharacterReading(
        (Candidate("8", 0.9, 0.6), Candidate("B", 0.8, 0.3)),
        Box(1.0, 1.0, 2.0, 4.0),
        state=state,
        grade=grade,
    )
    return Reading((character,), 0.6, height_mm=3.0, source=source)


def photo(pitch_mm: float | None = 0.1, *, placed: bool = False) -> Photo:
    rng = np.random.default_rng(1)
    pixels = rng.integers(60, 200, (50, 80, 3)).astype(np.uint8)
    return Photo(pixels, pitch_mm=pitch_mm, centre_mm=(4.0, 2.5) if placed else None)


def tactile() -> Reading:
    edges = EdgeMap(
        np.zeros((2, 50, 80), np.float32), tuple(TraceDirection)[:2], np.ones((50, 80), np.bool_), 0.1
    )
    surface = HeightMap(np.zeros((50, 80), np.float32), 0.1)
    return traced(reading("tactile"), edge_map=edges, height_map=surface)


def axes_of(figure: Figure, title: str) -> Any:
    (axes,) = [a for a in figure.axes if a.get_title(loc="left").startswith(title)]
    return axes


def words(axes: Any) -> str:
    return " | ".join(t.get_text() for t in axes.texts)


def test_both_senses_stand_side_by_side() -> None:
    figure = reading_figure(
        traced(reading("fused"), touch=tactile(), vision=reading("vision"), photo=photo()), title="both"
    )
    picture = axes_of(figure, "photograph")
    assert len(picture.patches) == 1
    assert picture.get_xlabel() == "x, mm"
    assert axes_of(figure, "height map").images
    assert sum(a.get_title(loc="left").startswith("edge map, traced") for a in figure.axes) == 2
    bottom, top = picture.get_ylim()
    assert bottom > top


def test_state_and_grade_stand_below_the_candidates() -> None:
    figure = reading_figure(tactile(), title="touch")
    panel = axes_of(figure, "candidates of each place and the belief in them, its state and its mark's grade")
    assert "confused 8/B\ngrade C, contrast" in words(panel)
    assert not any(a.get_title(loc="left").startswith("photograph") for a in figure.axes)


def test_a_photograph_alone(tmp_path: Path) -> None:
    figure = reading_figure(traced(reading("vision"), photo=photo()), title="vision")
    assert "height map, levelled" not in [a.get_title(loc="left") for a in figure.axes]
    figure.savefig(tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.parametrize("placed", [True, False])
def test_a_photograph_that_was_not_read_is_shown(placed: bool) -> None:
    figure = reading_figure(traced(tactile(), photo=photo(placed=placed)), title="touch")
    # boxes felt are drawn where the stage says how picture and plate lie
    assert len(axes_of(figure, "photograph").patches) == int(placed)


def test_without_a_pitch_a_photograph_is_shown_in_pixels() -> None:
    figure = reading_figure(traced(tactile(), photo=photo(None)), title="touch")
    assert axes_of(figure, "photograph, pixels").get_xlabel() == "x, pixels"
