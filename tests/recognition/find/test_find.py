"""Lines of whole views: the format picks the one that is meant; they are laid on their ink, bent and sized."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from glyphs import stamp
from glyphs.fonts.glyph import transform_glyph
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from glyphs.stamping.layouts import Layout
from glyphs.stamping.stamp import StampedPart, stamp_line
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.maps import HeightMap
from recognition.find.deadline import Deadline
from recognition.find.find import apart, find, read_lines, search_of
from recognition.find.ink import on_ink
from recognition.find.line_variants import bend, move_line
from recognition.find.part_lines import PartLines
from recognition.find.promise import promise_of
from recognition.find.region import stands_in
from recognition.find.request import LineFormat, LineRequest, SearchLimits
from recognition.find.search import Search
from recognition.language.grammar import Grammar
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.recogniser import WIDER, wider_for, wider_of
from recognition.see.levelling import level
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import View, ViewKind, heights_view

# -------------------------------------------------------------------------------------------------------------- find

PART = stamp(
    "KXB4071", fonts="gothic", height_mm=5.0, pitch_mm=5.0 / 60, seed=1,
    layout=Layout(other_text="2938174", gap=0.8),
)  # fmt: skip
VIEW = heights_view(level(PART.height_map))


def request_of(format: str, **more: Any) -> LineRequest:
    return LineRequest(Grammar(format=format), ALPHANUMERIC, **more)


def search_in(view: View, format: str = "AAA9999", **limits: Any) -> Search:
    return search_of(view, request_of(format, limits=SearchLimits(**limits)))


def find_in(view: View, format: str, **more: Any) -> PartLines:
    return find([view], request_of(format, **more))


@pytest.mark.parametrize(
    ("format", "meant", "other"), [("AAA9999", "KXB4071", "2938174"), ("9999999", "2938174", "KXB4071")]
)
def test_the_format_picks_the_line_and_the_other_is_reported(format: str, meant: str, other: str) -> None:
    part = find_in(VIEW, format)
    assert part.main.lattice.text == meant
    assert [one.open_places[0].text for one in part.others] == [other]


@pytest.mark.parametrize("size", [0.5, 1.8])
def test_a_doubtful_line_is_laid_at_another_height(size: float) -> None:
    view = replace(VIEW, kind=ViewKind.PHOTO)
    best = find_in(view, "AAA9999").main
    main = find([view], request_of("AAA9999"), about=(move_line(best.line, 0.0, size),)).main
    assert main.lattice.text == "KXB4071"


def test_a_straight_line_over_an_arc_is_bent() -> None:
    text, height_mm = "KXB4071", 5.0
    part = stamp(
        text, fonts="gothic", height_mm=height_mm, pitch_mm=height_mm / 60, seed=1,
        layout=Layout(radius_mm=3.0 * height_mm),
    )  # fmt: skip
    view = heights_view(level(part.height_map))
    boxes = np.array(part.stamped.boxes_mm)
    middle_mm = (boxes[:, 1] + boxes[:, 3]).mean() / 2
    straight = TextLine(np.array([(boxes[0, 0], middle_mm), (boxes[-1, 2], middle_mm)]), height_mm)
    assert search_in(view).read([straight])[0].lattice.text != text
    main = find([view], request_of("AAA9999"), about=(straight,)).main
    assert main.lattice.text == text


@pytest.mark.parametrize("x_scale", [0.5, 3.0])
def test_a_line_of_narrow_or_wide_characters_is_read_at_their_width(x_scale: float) -> None:
    text, height_mm = "KXB4071", 5.0
    font = load_font("gothic")
    glyphs = {char: transform_glyph(font.glyph(char), x_scale=x_scale) for char in text}
    part = stamp(
        text, fonts=replace(font, glyphs={**font.glyphs, **glyphs}), height_mm=height_mm,
        pitch_mm=height_mm / 60, dirt=0.7, seed=1,
    )  # fmt: skip
    view = heights_view(level(part.height_map))
    boxes = np.array(part.stamped.boxes_mm)
    line = TextLine(
        np.array([(boxes[0, 0], boxes[0, 1::2].mean()), (boxes[-1, 2], boxes[-1, 1::2].mean())]), height_mm
    )
    fitted, as_usual = (
        search_in(view, rewidened=ratio).read([line])[0] for ratio in (SearchLimits().rewidened, math.inf)
    )
    assert fitted.lattice.text == text
    assert promise_of(fitted) > promise_of(as_usual)
    assert wider_of(fitted.looks[0]) == pytest.approx(wider_for(as_usual.advance))
    assert wider_of(as_usual.looks[0]) == pytest.approx(WIDER)


UPPER, LOWER = (0.0, 0.0, 1.0, 0.5), (0.0, 0.5, 1.0, 1.0)


@pytest.mark.parametrize(
    ("asked", "region", "named"),
    [
        ("9999999", None, "2938174"),
        ("9999999", LOWER, "2938174"),
        ("9999999", UPPER, ""),
        ("999", None, ""),  # of another line's seven no three are taken for it
        ("AAAAAAA", None, ""),
    ],
)
def test_another_line_is_named_where_it_reads_and_stands_as_asked(
    asked: str, region: tuple[float, float, float, float] | None, named: str
) -> None:
    lines = {"lot": LineFormat(Grammar(format=asked), region)}
    part = find_in(VIEW, "AAA9999", lines=lines)
    assert [one.lattice.text for one in part.named.values()] == ([named] if named else [])
    assert [one.open_places[0].text for one in part.others] == ([] if named else ["2938174"])


@pytest.mark.parametrize(("region", "meant"), [(UPPER, "KXB4071"), (LOWER, "2938174")])
def test_the_serial_stands_in_its_region(
    region: tuple[float, float, float, float] | None, meant: str
) -> None:
    either = Grammar(sets=("K2", "X9", "B3", "48", "01", "77", "14"))
    part = find([VIEW], LineRequest(either, ALPHANUMERIC, region=region))
    assert part.main.lattice.text == meant
    assert len(part.others) == 1


@pytest.mark.parametrize(("region", "format"), [(LOWER, "AAA9999"), (UPPER, "9999999")])
def test_a_line_is_not_moved_out_of_its_region(
    region: tuple[float, float, float, float], format: str
) -> None:
    """The other line fits the format, and lies within reach of a line about the middle of the view."""
    main = find_in(VIEW, format, region=region).main
    assert main is None or stands_in(region, main.line, VIEW)


def test_what_lies_upside_down_is_read() -> None:
    over = HeightMap(np.rot90(stamp("KXB4071", fonts="gothic", seed=1).height_map.z_mm, 2).copy(), 5.0 / 60)
    part = find_in(heights_view(level(over)), "AAA9999")
    assert part.main.lattice.text == "KXB4071"
    assert abs(part.main.line.turned_deg) == pytest.approx(180.0, abs=5.0)


def test_two_lines_are_different_ink_where_their_characters_have_room() -> None:
    main = find_in(VIEW, "AAA9999").main
    assert main is not None
    for down_mm, lower_mm, different in ((3.2, 5.0, False), (5.0, 5.0, True), (3.2, 2.0, True)):
        upper, lower = (
            replace(main, line=TextLine.straight(0.0, y_mm, length_mm=30.0, height_mm=height_mm))
            for y_mm, height_mm in ((0.0, 5.0), (down_mm, lower_mm))
        )
        assert apart(upper, lower) == apart(lower, upper) == different


@pytest.mark.parametrize("too_high", [1.6, 2.0])
def test_a_line_that_is_text_without_the_format_grows_to_the_serial_of_the_format(too_high: float) -> None:
    """The finder saw the end of the serial, too high: the format fits that nowhere."""
    boxes = np.array(PART.stamped.boxes_mm)[4:7]
    middle_mm = boxes[:, 1::2].mean()
    half = TextLine(np.array([(boxes[0, 0], middle_mm), (boxes[-1, 2], middle_mm)]), too_high * 5.0)
    (forced,) = search_in(VIEW).read([half])
    assert forced.lattice.text != "KXB4071"
    assert promise_of(forced) < 0.0
    main = find([VIEW], request_of("AAA9999"), about=(half,)).main
    assert main.lattice.text == "KXB4071"


@pytest.mark.parametrize("first", [0, 1])
def test_without_a_format_a_photographs_line_is_read_longer_at_its_ends(first: int) -> None:
    boxes = np.array(PART.stamped.boxes_mm)[first:7]
    middle_mm = boxes[:, 1::2].mean()
    piece = TextLine(np.array([(boxes[0, 0], middle_mm), (boxes[-1, 2], middle_mm)]), 5.0)
    request = LineRequest(None, ALPHANUMERIC, limits=SearchLimits(least_gain_per_ms=math.inf))
    texts = {}
    for kind in (ViewKind.PHOTO, VIEW.kind):
        part = find([replace(VIEW, kind=kind)], request, about=(piece,))
        assert part.longer is None
        texts[kind] = part.main.open_places[0].text
    assert texts == {ViewKind.PHOTO: "KXB4071", VIEW.kind: "KXB4071"[first:]}


def test_another_layout_is_looked_for_only_where_the_lines_count() -> None:
    found = read_lines([VIEW], request_of("99AA99"))
    whole, together = found.with_layout(), find_in(VIEW, "99AA99")
    assert 5 < found.lines.looks < whole.looks == together.looks
    assert whole.layout == together.layout


def test_looks_are_counted_and_end_at_a_limit() -> None:
    whole = find_in(VIEW, "99AA99")
    assert 5 < whole.looks <= 34
    assert whole.stopped == ""
    cut = find_in(VIEW, "99AA99", limits=SearchLimits(most_looks=4, layout_looks=0))
    assert cut.looks == 4
    assert cut.main is not None
    late = find([VIEW], request_of("99AA99", deadline=Deadline(0.0)))
    assert (late.main, late.looks, late.stopped) == (None, 0, "stopped after 0 s")
    # without a price it looks more often
    limits = SearchLimits(most_looks=whole.looks + 5, least_gain_per_ms=-1.0)
    assert find_in(VIEW, "99AA99", limits=limits).looks > whole.looks


def test_a_look_at_the_same_place_is_taken_once() -> None:
    search = search_in(VIEW)
    first = search.lines()
    looks = search.looks.count
    assert [read.lattice.text for read in search.lines()] == [read.lattice.text for read in first]
    assert search.looks.count == looks > 0


# --------------------------------------------------------------------------------------------------------------- ink

INK_MM = 5.0


def stamped(radius_mm: float | None = None) -> StampedPart:
    font = load_font("gothic")
    return stamp_line(
        "KB407251",
        font,
        default_die(INK_MM, font=font),
        height_mm=INK_MM,
        pitch_mm=INK_MM / 30,
        layout=None if radius_mm is None else Layout(radius_mm=radius_mm),
        variation=StampingVariation.none(),
        rng=np.random.default_rng(0),
    )


def middles_of(part: StampedPart) -> NDArray[np.float64]:
    return np.array([((x0 + x1) / 2, (y0 + y1) / 2) for x0, y0, x1, y1 in part.boxes_mm])


def columns_of(line: TextLine, middles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of middles, on a level line's strip."""
    along = (middles[:, 0] - line.centre_mm[0, 0]) / line.height_mm
    return np.asarray((along + MARGIN) * HEIGHT_ROWS - 0.5)


def level_line(middles: NDArray[np.float64], y_mm: float, height_mm: float = INK_MM) -> TextLine:
    x0, x1 = middles[0, 0] - 0.4 * INK_MM, middles[-1, 0] + 0.4 * INK_MM
    return TextLine(np.array([(x0, y_mm), (x1, y_mm)]), height_mm)


def farthest_heights(line: TextLine, middles: NDArray[np.float64]) -> float:
    """From a line to the middles of characters, at most."""
    lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line.centre_mm, axis=0), axis=1))]
    at = np.linspace(0.0, lengths[-1], 400)
    curve = np.stack([np.interp(at, lengths, line.centre_mm[:, k]) for k in (0, 1)], axis=1)
    return float(np.linalg.norm(middles[:, None] - curve, axis=2).min(axis=1).max()) / INK_MM


@pytest.mark.parametrize("radius_mm", [30.0, -40.0])
def test_a_straight_line_across_an_arc_is_bent_onto_it(radius_mm: float) -> None:
    part = stamped(radius_mm)
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(middles[:, 1].mean()))
    assert farthest_heights(line, middles) > 0.3
    laid, *_ = on_ink(view, line, columns_of(line, middles))
    assert farthest_heights(laid, middles) < 0.2


def test_a_line_beside_its_characters_is_moved_onto_them_and_stays_straight() -> None:
    part = stamped()
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(np.median(middles[:, 1])) + 0.3 * INK_MM)
    laid, *_ = on_ink(view, line, columns_of(line, middles), height_known=True)
    assert len(laid.centre_mm) == 2
    assert farthest_heights(laid, middles) < 0.12


def test_a_line_that_was_found_too_high_is_offered_at_the_height_of_its_ink() -> None:
    part = stamped()
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(np.median(middles[:, 1])), 1.3 * INK_MM)
    as_high, lower = on_ink(view, line, columns_of(line, middles))
    assert as_high.height_mm == line.height_mm
    assert lower.height_mm == pytest.approx(INK_MM, rel=0.12)
    assert on_ink(view, line, columns_of(line, middles), height_known=True) == ()


def test_a_line_that_lies_on_its_ink_is_left_alone() -> None:
    part = stamped()
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(np.median(middles[:, 1])))
    assert on_ink(view, line, columns_of(line, middles), height_known=True) == ()


def test_land_has_no_ink() -> None:
    bare = HeightMap(np.zeros((80, 400)), pitch_mm=0.1)
    line = TextLine(np.array([(2.0, 4.0), (38.0, 4.0)]), INK_MM)
    assert on_ink(heights_view(bare), line, np.array([30.0, 60.0, 90.0])) == ()


# ----------------------------------------------------------------------------------------------------- line variants


@given(turn_deg=st.floats(-180.0, 180.0), sag=st.floats(-1.0, 1.0), height_mm=st.floats(1.0, 12.0))
def test_the_ends_of_a_bent_line_lie_lower_than_its_middle_by_the_sag(
    turn_deg: float, sag: float, height_mm: float
) -> None:
    line = TextLine.straight(3.0, -2.0, length_mm=8.0 * height_mm, height_mm=height_mm, turned_deg=turn_deg)
    bent = bend(line, sag)
    turn = math.radians(turn_deg)
    down = bent.centre_mm @ (-math.sin(turn), math.cos(turn))
    middle = down[len(down) // 2]
    assert (down[[0, -1]] - middle) / height_mm == pytest.approx([sag, sag], abs=1e-9)
    assert bent.centre_mm.mean(axis=0) == pytest.approx(line.centre_mm.mean(axis=0), abs=0.05 * height_mm)
    assert np.ptp(bent.centre_mm @ (math.cos(turn), math.sin(turn))) == pytest.approx(line.length_mm)
    assert bent.height_mm == height_mm
