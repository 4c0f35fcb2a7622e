"""Grades of marks that were read: clean ones are good, wiped and littered ones are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import EdgeMap
from recognition.decision.grade import Action, MarkGrade
from recognition.decision.grading import graded
from recognition.decision.reading import Candidate, CharacterReading, Decision, MarkDepth, Reading
from recognition.experts.templates.frames import LineImage, is_edge_channel
from recognition.experts.templates.judge import JudgedLine
from recognition.experts.templates.placed_line import PlacedLine
from recognition.experts.templates.refine import refine_line
from recognition.language.box import Box
from whisker_array.whisker.array import ALL_DIRECTIONS

TEXT = "K71B"
SPOILT = 1
Line = tuple[StampedPart, Reading, JudgedLine, LineImage]


@pytest.fixture(scope="module")
def line(calm_part: StampedPart, calm_edges: EdgeMap, place_line: Callable[..., PlacedLine]) -> Line:
    """A faultless line as the templates have it."""
    settled, cells = refine_line(place_line(calm_part, calm_edges), ALL_DIRECTIONS)
    box = Box(0.0, 0.0, 1.0, 1.0)
    reading = Reading(
        tuple(CharacterReading((Candidate(c, 1.0, 1.0),), box) for c in TEXT), Decision.ACCEPT, 1.0
    )
    return calm_part, reading, JudgedLine(settled, cells, 1.0, None), settled.image


def seen_as(judged: JudgedLine, image: LineImage) -> JudgedLine:
    return replace(judged, line=replace(judged.line, image=image))


def grades(line: Line, image: LineImage | None = None, reading: Reading | None = None) -> list[MarkGrade]:
    _, plain, judged, clean = line
    made = graded(
        reading if reading is not None else plain,
        seen_as(judged, image if image is not None else clean),
        ALL_DIRECTIONS,
    )
    found = [c.grade for c in made.characters]
    assert all(g is not None for g in found)
    return [g for g in found if g is not None]


def window(line: Line, which: int, *, share: tuple[float, float] = (0.0, 1.0)) -> tuple[slice, slice]:
    """Rows, and this share of the columns, of a character's box."""
    part, _, _, image = line
    x0, y0, x1, y1 = part.boxes_mm[which]
    x0, x1 = x0 - 0.3, x1 + 0.3
    x0, x1 = x0 + share[0] * (x1 - x0), x0 + share[1] * (x1 - x0)
    (cx, cy), (u0, v0), pitch = image.centre_mm, image.origin_mm, image.pitch_u_mm
    return (
        slice(round((y0 - 0.3 - cy - v0) / pitch), round((y1 + 0.3 - cy - v0) / pitch)),
        slice(round((x0 - cx - u0) / pitch), round((x1 - cx - u0) / pitch)),
    )


def with_channels(image: LineImage, channels: np.ndarray) -> LineImage:
    return replace(image, channels=np.ascontiguousarray(channels, dtype=np.float32))


def wiped(line: Line, share: tuple[float, float]) -> LineImage:
    channels = line[3].channels.copy()
    rows, cols = window(line, SPOILT, share=share)
    channels[:, rows, cols] = 0.0
    return with_channels(line[3], channels)


def littered(line: Line, count: int) -> LineImage:
    """Grains with steep sides where the character has no stroke: left and below of a 7's."""
    channels = line[3].channels.copy()
    rows, cols = window(line, SPOILT, share=(0.0, 0.4))
    strongest = float(np.abs(channels[1:]).max())
    rng = np.random.default_rng(3)
    for _ in range(count):
        r = int(rng.integers((rows.start + rows.stop) // 2, rows.stop - 4))
        c = int(rng.integers(cols.start, cols.stop - 3))
        channels[1:, r : r + 3, c : c + 3] = strongest
    return with_channels(line[3], channels)


def test_clean_marks_have_the_best_grade(line: Line) -> None:
    for grade in grades(line):
        assert grade.letter == "A"
        assert grade.action is Action.NONE
        # how deep a mark should be nobody has said
        assert grade.value("depth") is None
        completeness, contamination = grade.value("completeness"), grade.value("contamination")
        assert completeness is not None
        assert contamination is not None
        assert completeness > 0.95
        assert contamination < 0.01


def test_grading_changes_nothing_else(line: Line) -> None:
    _, reading, judged, _ = line
    made = graded(reading, judged, ALL_DIRECTIONS)
    bare = replace(made, characters=tuple(replace(c, grade=None) for c in made.characters))
    assert bare == reading


def value(grade: MarkGrade, name: str) -> float:
    found = grade.value(name)
    assert found is not None
    return found


def test_the_more_is_wiped_the_less_complete(line: Line) -> None:
    found = [grades(line, wiped(line, (0.0, share))) for share in (0.0, 0.35, 0.6)]
    told = [value(g[SPOILT], "completeness") for g in found]
    assert (np.diff(told) < -0.05).all()
    assert found[-1][SPOILT].grade is not None
    assert found[-1][SPOILT].grade < 3
    assert found[-1][SPOILT].limiting == "completeness"
    # nobody else is the worse for it
    for k in set(range(len(TEXT))) - {SPOILT}:
        assert found[-1][k] == found[0][k]


def test_a_mark_that_is_gone_is_no_mark(line: Line) -> None:
    gone = grades(line, wiped(line, (0.0, 1.0)))[SPOILT]
    assert gone.letter == "F"
    assert gone.action is not Action.NONE


def test_litter_is_told_from_strokes(line: Line) -> None:
    found = [grades(line, littered(line, count))[SPOILT] for count in (0, 3, 30)]
    assert (np.diff([value(g, "contamination") for g in found]) > 0.0).all()
    assert found[-1].grade is not None
    assert found[-1].grade < 3
    assert found[-1].limiting == "contamination"
    # what is felt of the strokes stays
    assert value(found[-1], "completeness") == pytest.approx(value(found[0], "completeness"), abs=0.05)


def test_a_faint_line_has_less_contrast(line: Line) -> None:
    shares = (0.2, 0.4)
    low, high = (grades(line, with_channels(line[3], line[3].channels * np.float32(s))) for s in shares)
    for one, other in zip(low, high, strict=True):
        # in proportion, as long as it is not cut off at 1; single precision
        assert value(other, "contrast") == pytest.approx(2.0 * value(one, "contrast"), rel=1e-3)
        # the best of a neighbourhood counts, more than what is predicted: bars felt crosswise by up to a half
        assert 1.0 <= value(one, "contrast") / shares[0] < 1.7
        assert value(other, "completeness") > 0.95
        assert value(other, "contamination") < 0.01
        assert one.grade is not None
        assert other.grade is not None
        assert one.grade < other.grade < 4


def test_only_edges_are_graded(line: Line) -> None:
    edge = is_edge_channel(ALL_DIRECTIONS)
    waved = line[3].channels.copy()
    waved[~edge] += 0.5
    assert grades(line, with_channels(line[3], waved)) == grades(line)


def test_the_character_that_was_read_is_what_it_is_graded_against(line: Line) -> None:
    _, reading, _, _ = line
    as_b = replace(reading.characters[SPOILT], candidates=(Candidate("B", 0.5, 0.5),))
    wrong = replace(
        reading, characters=(*reading.characters[:SPOILT], as_b, *reading.characters[SPOILT + 1 :])
    )
    found = grades(line, reading=wrong)
    # a 7 is no complete B
    assert value(found[SPOILT], "completeness") < 0.8
    assert found[0] == grades(line)[0]


def test_a_character_without_a_template_is_not_graded(line: Line) -> None:
    _, reading, judged, _ = line
    unknown = replace(reading.characters[SPOILT], candidates=(Candidate("Z", 0.5, 0.5),))
    odd = replace(
        reading, characters=(*reading.characters[:SPOILT], unknown, *reading.characters[SPOILT + 1 :])
    )
    made = graded(odd, judged, ALL_DIRECTIONS)
    assert made.characters[SPOILT].grade is None
    assert made.characters[SPOILT] == unknown
    assert all(c.grade is not None for k, c in enumerate(made.characters) if k != SPOILT)


def test_cells_that_are_not_the_readings_grade_nothing(line: Line) -> None:
    _, reading, judged, _ = line
    assert graded(reading, replace(judged, cells=judged.cells[:-1]), ALL_DIRECTIONS) is reading


def test_a_cell_off_the_map_was_not_felt(line: Line) -> None:
    _, reading, judged, _ = line
    away = replace(judged.cells[0], u_mm=judged.cells[0].u_mm - 500.0)
    made = graded(reading, replace(judged, cells=(away, *judged.cells[1:])), ALL_DIRECTIONS)
    first = made.characters[0].grade
    assert first is not None
    assert first.letter == "?"
    assert first.action is Action.SCAN_AGAIN


def test_a_known_depth_without_a_nominal_one_grades_no_depth(line: Line) -> None:
    _, reading, _, _ = line
    deep = tuple(replace(c, depth=MarkDepth(0.2, 0.15, 0.25)) for c in reading.characters)
    assert grades(line, reading=replace(reading, characters=deep)) == grades(line)
