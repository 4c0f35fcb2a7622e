"""Designs of an exam, and the parts of its second generator."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError, MarksError
from glyphs.fonts.glyph import FontError
from glyphs.sketch import ROWS, ROWS_PER_HEIGHT
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.errors import StampError
from pipeline.benchmark.exam.condition import Condition, given_levels, parse_given
from pipeline.benchmark.exam.design import Design, design_named, editions
from pipeline.benchmark.exam.designed_parts import DesignedParts, sketch_part
from pipeline.common.settings import SettingsError
from recognition.learning.training_fonts import kept_out

PART = {"font": "gothic", "format": "A9", "severity": [0.3, 0.6]}
TOML = """
seed = 4
parts = 12
cross = ["soil", "severity"]
given = ["format", "font,format"]
[part]
font = ["gothic", "futuram"]
format = "A9"
soil = ["workshop", "glyphs.soiling.workshop.mixture:workshop"]
severity = [0, 0.5, 1]
"""


def design(**more: Any) -> Design:
    part = {**PART, **more.pop("part", {})}
    return Design.of(**{"parts": 12, **more, "part": part})


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 4), st.integers(1, 5), st.integers(1, 4), st.integers(0, 3))
def test_every_cell_has_every_level_equally_often(cells: int, first: int, second: int, seed: int) -> None:
    whole = cells * first * second
    exam = design(
        parts=whole, seed=seed, cross=("severity",),
        part={
            "severity": [k / 10 for k in range(cells)], "height_mm": [3.0 + k for k in range(first)],
            "depth_mm": [0.1 * (k + 1) for k in range(second)],
        },
    )  # fmt: skip
    plan_parts = [condition for *_, condition in exam.plan_parts()]
    for factor, levels in (("height_mm", first), ("depth_mm", second)):
        pairs = Counter((c["severity"], c[factor]) for c in plan_parts)
        assert set(pairs.values()) == {whole // cells // levels}
        # and over all cells at once from the first round on, as equally as can be
        for_round = Counter(c[factor] for c in plan_parts[:cells])
        assert max(for_round.values()) <= -(-cells // levels)


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 4), st.integers(1, 5), st.integers(1, 9), st.integers(1, 12), st.integers(0, 3))
def test_every_severity_has_all_levels_equally_often_after_any_round(
    severities: int, formats: int, levels: int, rounds: int, seed: int
) -> None:
    cells = severities * formats
    exam = design(
        parts=cells * rounds, seed=seed, cross=("severity", "format"),
        part={
            "severity": [k / 10 for k in range(severities)], "format": ["A", "9", "A9", "9A", "AA"][:formats],
            "height_mm": [3.0 + k for k in range(levels)],
        },
    )  # fmt: skip
    plan_parts = [condition for *_, condition in exam.plan_parts()]
    for parts in range(cells, len(plan_parts) + 1, cells):
        counts = Counter((c["severity"], c["height_mm"]) for c in plan_parts[:parts])
        for severity in exam.part["severity"]:
            each = [counts[severity, height] for height in exam.part["height_mm"]]
            assert max(each) - min(each) <= 1


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({"parts": 9, "cross": ("severity", "height_mm")}, "parts by severity: 6 of 0.3, 3 of 0.6"),
        (
            {"parts": 12, "cross": ("height_mm",), "part": {"depth_mm": [0.1, 0.2]}},
            "parts by depth_mm at severity 0.3: 4 of 0.1, 2 of 0.2",
        ),
        (
            {"parts": 0, "cross": ("severity", "height_mm"), "section": [{"name": "dotted", "parts": 3}]},
            "section dotted: parts by severity: 3 of 0.3, 0 of 0.6",
        ),
    ],
)
def test_an_unbalanced_design_is_refused_with_its_counts(change: dict[str, Any], counts: str) -> None:
    part = {"height_mm": [3.0, 4.0, 5.0], **change.pop("part", {})}
    with pytest.raises(SettingsError, match=f"not balanced, {counts}"):
        design(**change, part=part)


def test_a_longer_design_begins_as_a_shorter_one() -> None:
    long = list(design(parts=40, part={"height_mm": [3, 5, 7]}).plan_parts())
    assert [p[2:] for p in design(parts=13, part={"height_mm": [3, 5, 7]}).plan_parts()] == [
        p[2:] for p in long[:13]
    ]


def test_a_file_gives_the_parts_it_declares(tmp_path: Path) -> None:
    path = tmp_path / "two-soils.toml"
    path.write_text(TOML)
    exam = Design.load(path)
    assert (exam.name, exam.n_parts, len(exam.cells(exam.all_sections()[0]))) == ("two-soils", 12, 6)
    items = DesignedParts(exam).items()
    assert items[4].part == "glyphs.soiling.workshop.mixture_workshop-0.5-0000"
    assert items[0].given == ("format", "font,format")
    assert len({item.part for item in items}) == 12
    assert Counter(item.condition["font"] for item in items) == {"gothic": 6, "futuram": 6}
    specimens = [DesignedParts(exam).make(item).truth for item in items]
    assert len(set(specimens)) > 6  # serials of their own, where cells are not alike


def test_sections_have_levels_of_their_own() -> None:
    exam = design(
        parts=0,
        section=[
            {"name": "a", "parts": 4},
            {"name": "b", "parts": 6, "kept_out": True, "part": {"font": "futuram"}},
        ],
    )
    fonts = [(section.name, condition.font) for section, _, _, condition in exam.plan_parts()]
    assert fonts == [("a", "gothic")] * 4 + [("b", "futuram")] * 6
    numbers = [item.number for item in DesignedParts(exam).items()]
    assert len(set(numbers)) == 10


def test_parts_of_a_design_without_sections_are_numbered_from_nought() -> None:
    """Several designs at once: a number must not hang on where in memory a section lies."""
    item_lists = [DesignedParts(design(parts=parts)).items() for parts in (3, 12, 40)]
    assert [[item.number for item in items] for items in item_lists] == [list(range(n)) for n in (3, 12, 40)]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"parts": 0}, "give parts, parts_a_cell or sections"),
        ({"cross": ("soil",)}, "cross names soil"),
        ({"part": {"severity": [0.3, 1.5]}}, "lies between 0 and 1"),
        ({"part": {"height_mm": []}}, "at least one level"),
        ({"part": {"height_mm": [5, 5]}}, "each once"),
        ({"severities": [0.3]}, "has the unknown key severities"),
        ({"given": ()}, "name at least one"),
    ],
)
def test_what_cannot_be_is_named(change: dict[str, Any], problem: str) -> None:
    with pytest.raises(SettingsError, match=problem):
        design(**change)


@pytest.mark.parametrize(
    ("part", "error", "problem"),
    [
        ({"colour": "red"}, SettingsError, "no factor 'colour'.*height_mm"),
        ({"soil": "mould"}, StampError, "no soil 'mould'"),
        ({"font": "Comic"}, FontError, "Comic"),
        ({"format": 9}, SettingsError, "a format is 9.0; it is a word in quotes"),
        ({"height_mm": "tall"}, SettingsError, "a height_mm is 'tall'; it is a number"),
        ({"generator": "cast"}, SettingsError, "no generator 'cast'; use stamped or sketched"),
        ({"generator": "sketched", "die": "sharp"}, SettingsError, "a sketched part has no die"),
    ],
)
def test_parts_that_cannot_be_made_are_named(
    part: dict[str, Any], error: type[Exception], problem: str
) -> None:
    with pytest.raises(error, match=problem):
        DesignedParts(design(part=part))


def test_a_file_that_is_no_design_is_named_with_its_setting(tmp_path: Path) -> None:
    path = tmp_path / "d.toml"
    for text, problem in (
        ("parts = 'x'\n[part]\n", "says parts = 'x'"),
        ("parts = [", "is not TOML"),
        (TOML.replace("font,format", "serial"), "cannot be given 'serial'"),
    ):
        path.write_text(text)
        with pytest.raises(FileError, match=f"d.toml.*{problem}"):
            Design.load(path)


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("nothing", (False, False, False)),
        ("format", (False, False, True)),
        ("font, height", (True, True, False)),
    ],
)
def test_what_a_reader_is_given(text: str, levels: tuple[bool, ...]) -> None:
    facts = parse_given(text)
    assert tuple(given_levels(facts).values()) == levels
    assert parse_given(facts) == facts


def test_a_designs_parts_may_be_read_by_others() -> None:
    exam = design(given=("format",))
    assert exam.with_given(()) is exam
    other = exam.with_given(("height,font", "nothing"))
    assert other.given == ("font,height", "nothing")
    assert list(other.plan_parts()) == list(exam.plan_parts())
    with pytest.raises(SettingsError, match="cannot be given"):
        exam.with_given(("serial",))


def test_a_condition_knows_what_it_was_not_given() -> None:
    known, unknown = Condition(severity=0.5, font="a/b/Bold.ttf"), Condition()
    assert (known.severity, known.levels["font"]) == (0.5, "Bold")
    assert (unknown.severity, unknown.font, unknown.format, unknown.height_mm) == (None, "", "", None)


def test_the_first_parts_of_an_edition_hold_all_severities() -> None:
    parts = DesignedParts(design_named("marks-exam-1-40"), first=8)
    severities = [item.condition.severity for item in parts.items()]
    assert {severities.count(severity) for severity in (0.0, 0.3, 0.6, 0.9)} <= {1, 2, 3}
    every = [item.part for item in DesignedParts(design_named("marks-exam-1-40")).items()]
    assert {item.part for item in replace(parts, first=40).items()} == set(every)


def in_one_font(edition: str) -> DesignedParts:
    """The parts of an edition without the font packages that it needs; their serials do not depend on fonts."""
    exam = design_named(edition)
    gothic = {"font": ("gothic",)}
    sections = tuple(s.model_copy(update={"part": {**s.part, **gothic}}) for s in exam.all_sections())
    return DesignedParts(exam.model_copy(update={"part": {**exam.part, **gothic}, "sections": sections}))


def test_names_of_the_training_edition_say_nothing_and_none_of_its_serials_is_in_the_exam() -> None:
    parts = in_one_font("marks-training-1")
    items = parts.items()
    assert {item.part for item in items} == {f"part-{n:04d}" for n in range(len(items))}
    # the first parts are those of the whole edition, and names are no order of severities
    assert {item.part for item in replace(parts, first=50).items()} < {item.part for item in items}
    by_name = [item.condition.severity for item in sorted(items, key=lambda item: item.part)]
    assert abs(float(np.corrcoef(by_name, np.arange(len(by_name)))[0, 1])) < 0.1
    for neighbour in range(1, 5):
        assert abs(float(np.corrcoef(by_name[:-neighbour], by_name[neighbour:])[0, 1])) < 0.1
    for edition in editions():
        if edition == parts.design.name:
            continue
        exam = in_one_font(edition)
        assert not {exam.truth_of(item) for item in exam.items()} & {parts.truth_of(item) for item in items}
        assert not set(parts.design.part["soil"]) & set(exam.design.kept_out_soils)


def test_a_design_crosses_both_generators() -> None:
    exam = design(cross=["generator", "severity"], parts=4, part={"generator": ["stamped", "sketched"]})
    parts = DesignedParts(exam)
    for item in parts.items():
        specimen = parts.make(item)
        assert specimen.truth == parts.truth_of(item)
        assert len(specimen.boxes_mm) == len(specimen.truth) == 2
        assert specimen.line_mm is not None
        assert specimen.soil is not None
        # 100 samples to a character's height where it is stamped, 56 where it is sketched
        assert (specimen.height_map.pitch_mm < 0.06) == (item.condition["generator"] == "stamped")


@pytest.mark.parametrize("edition", ["marks-exam-2-1000", "marks-exam-2-96"])
def test_the_second_exam_has_nothing_that_anything_was_fitted_to(edition: str) -> None:
    exam = design_named(edition)
    assert all(section.kept_out for section in exam.all_sections())
    assert set(exam.part["soil"]) == set(exam.kept_out_soils)
    assert set(exam.fonts) == set(exam.font_names)
    for font in exam.font_names:
        assert kept_out(Path(exam.fonts[font].file))


CLEAN = Soiling()


def test_a_part_is_that_of_its_seed_and_its_text_stands_in_its_boxes() -> None:
    part, same, other = (
        sketch_part("AA99", font="gothic", height_mm=5.0, soiling=CLEAN, seed=(7, k)) for k in (0, 0, 1)
    )
    np.testing.assert_array_equal(part.height_map.z_mm, same.height_map.z_mm)
    assert part.text == same.text != other.text
    rows = part.height_map.shape[0]
    assert rows == ROWS + ROWS_PER_HEIGHT
    middle_mm = 0.5 * rows * part.height_map.pitch_mm
    assert [char.isalpha() for char in part.text] == [True, True, False, False]
    for x0, y0, x1, y1 in part.stamped.boxes_mm:
        assert 0.0 < x0 < x1 < part.height_map.size_mm[0]
        assert y0 < middle_mm < y1
        assert 3.0 < y1 - y0 < 7.0


def test_marks_stand_out_of_the_land_as_deep_as_is_usual() -> None:
    for number in range(8):
        part = sketch_part("9999", font="futuram", height_mm=4.0, soiling=CLEAN, seed=(1, number))
        z_mm = part.height_map.z_mm
        x0, y0, x1, y1 = (round(v / part.height_map.pitch_mm) for v in part.stamped.boxes_mm[0])
        assert 0.04 < np.ptp(z_mm[y0:y1, x0:x1]) < 2.0


def test_dirt_and_photograph_are_those_of_stamped_parts() -> None:
    clean, muddy = (
        sketch_part("AA99", font="gothic", height_mm=5.0, soiling=soiling, seed=(7, 0))
        for soiling in (CLEAN, Soiling(("mud",), 0.6))
    )
    assert clean.soil is None
    assert muddy.soil is not None
    assert muddy.text == clean.text
    assert np.mean(muddy.height_map.z_mm - clean.height_map.z_mm) > 0.005
    assert muddy.photograph().pixels.std() > 1.0


def test_a_font_without_the_characters_is_named() -> None:
    with pytest.raises(MarksError):
        sketch_part("AA99", font="nothing.ttf", height_mm=5.0, soiling=CLEAN, seed=(0,))
