"""The value types of a reading: what they compute, when, and how they are drawn."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from glyphs.camera.photo import Photo
from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from recognition.decide.decision import ReadingFlag
from recognition.decide.deferred import deferrable, deferred
from recognition.decide.judges.strokes import cut_characters, missing_strokes, named_font, undecided_strokes
from recognition.decide.picture import reading_figure
from recognition.decide.reading import Candidate, CharacterReading, Reading
from recognition.language.box import Box
from recognition.language.confusions import CharacterState, PlaceState
from recognition.marks.depth import MarkDepth
from recognition.marks.grade import Action, MarkGrade, Parameter
from tests.support.evidence import judged, text_of, traced

# ----------------------------------------------------------------------------------------------------------- reading

BOX = Box(0.0, 0.0, 1.0, 2.0)


def character(*beliefs: tuple[str, float]) -> CharacterReading:
    return CharacterReading(tuple(Candidate(c, 0.9, p) for c, p in beliefs), BOX)


@pytest.mark.parametrize("corners", [(1.0, 0.0, 0.5, 1.0), (0.0, 1.0, 1.0, 0.5)])
def test_a_box_does_not_end_before_it_begins(corners: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="ends before it begins"):
        Box(*corners)


def test_a_character_has_a_candidate() -> None:
    with pytest.raises(ValueError, match="at least one"):
        CharacterReading((), BOX)


def test_confidence_and_margin_are_those_of_the_leaders() -> None:
    both = character(("A", 0.7), ("4", 0.2), ("H", 0.1))
    assert both.char == "A"
    assert both.confidence == 0.7
    assert both.margin == pytest.approx(0.5)
    # without a rival the lead is the whole belief
    alone = character(("A", 0.7))
    assert alone.margin == alone.confidence == 0.7


def test_seven_characters_one_in_doubt_say_more_than_a_sure_one() -> None:
    def reading(*beliefs: float) -> Reading:
        characters = tuple(character(("A", belief)) for belief in beliefs)
        return Reading(characters=characters, confidence=min(beliefs), threshold=1.0)

    assert reading(0.5, *[0.99] * 6).nats_read > reading(0.85).nats_read
    assert reading(0.9, 0.9).nats_read > reading(0.9, 0.7).nats_read
    # noise read as eight characters is worth less than nothing, however unlikely each is
    assert reading(*[0.1] * 8).nats_read < 0.0 < reading(0.85).nats_read
    assert reading(0.0).nats_read == -2.0


def test_every_flag_has_words_of_its_own() -> None:
    assert all(flag.text for flag in ReadingFlag)
    assert len({flag.text for flag in ReadingFlag}) == len(ReadingFlag)


def test_the_depth_of_a_reading_is_that_of_the_characters_felt() -> None:
    depths = (MarkDepth(0.2, 0.15, 0.22), None, MarkDepth(0.1, 0.05, 0.12))
    characters = tuple(CharacterReading((Candidate("A", 0.9, 1.0),), BOX, depth) for depth in depths)
    reading = Reading(characters, 1.0)
    assert reading.depth_min_mm == 0.05
    assert reading.depth_mean_mm == pytest.approx(0.15)
    unknown = Reading(characters[1:2], 1.0)
    assert unknown.depth_min_mm is None
    assert unknown.depth_mean_mm is None


# ---------------------------------------------------------------------------------------------------------- deferred


@deferrable("depth")
@dataclass(frozen=True)
class Mark:
    name: str
    depth: float = 0.0


def test_a_value_is_computed_once_and_not_before_it_is_read() -> None:
    computed = []
    mark = Mark("K", deferred(lambda: computed.append(1) or 0.2))
    assert computed == []
    assert (mark.depth, mark.depth, computed) == (0.2, 0.2, [1])


def test_a_deferred_value_compares_copies_and_travels_as_the_value() -> None:
    mark = Mark("K", deferred(lambda: 0.2))
    assert pickle.loads(pickle.dumps(mark)) == mark == Mark("K", 0.2)
    assert replace(mark, name="7") == Mark("7", 0.2)
    assert Mark("K").depth == 0.0


def test_a_sure_text_is_judged_without_its_strokes() -> None:
    def unwanted(*_: object, **__: object) -> None:
        pytest.fail("the strokes were compared")

    sure = text_of("K7", score=0.99)
    sure.marks.strokes = unwanted  # type: ignore[union-attr, method-assign]
    assert judged(sure, cut_characters, missing_strokes, undecided_strokes, named_font) == ()


# ----------------------------------------------------------------------------------------------------------- picture


def drawn_reading(source: str) -> Reading:
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
    return traced(drawn_reading("tactile"), edge_map=edges, height_map=surface)


def axes_of(figure: Figure, title: str) -> Any:
    (axes,) = [a for a in figure.axes if a.get_title(loc="left").startswith(title)]
    return axes


def words(axes: Any) -> str:
    return " | ".join(t.get_text() for t in axes.texts)


def test_state_and_grade_stand_below_the_candidates(tmp_path: Path) -> None:
    figure = reading_figure(tactile(), title="touch")
    assert any("confused 8/B\ngrade C, contrast" in words(panel) for panel in figure.axes)
    figure.savefig(tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("shown", "boxes"),
    [
        (lambda: traced(drawn_reading("vision"), photo=photo()), 1),
        (
            lambda: traced(
                drawn_reading("fused"), touch=tactile(), vision=drawn_reading("vision"), photo=photo()
            ),
            1,
        ),
        # boxes felt are drawn where the stage says how picture and plate lie
        (lambda: traced(tactile(), photo=photo(placed=True)), 1),
        (lambda: traced(tactile(), photo=photo()), 0),
        (lambda: traced(tactile(), photo=photo(None)), 0),
    ],
)
def test_boxes_are_drawn_on_the_photograph(shown: Callable[[], Reading], boxes: int) -> None:
    figure = reading_figure(shown(), title="part")
    assert len(axes_of(figure, "photograph").patches) == boxes
