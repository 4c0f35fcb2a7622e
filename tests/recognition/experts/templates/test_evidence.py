"""What is left of a line: stamped without fault, then spoilt by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.stamping.die import default_die
from glyphs.stamping.stamp import StampedPart, StampingVariation, stamp_line
from glyphs.surface.maps import EdgeMap
from recognition.experts.templates.decode import Placed, Spacing
from recognition.experts.templates.evidence import (
    LEAST_NOISE,
    amplitude_of,
    line_evidence,
    resampled_to,
)
from recognition.experts.templates.frames import LineImage, is_edge_channel, padded
from recognition.experts.templates.occlusion import covered, robust_spread
from recognition.experts.templates.pixel_model import pixel_model
from recognition.experts.templates.place_evidence import PlaceEvidence
from recognition.experts.templates.placed_line import PlacedLine
from recognition.experts.templates.predicted import TemplateSet
from recognition.experts.templates.refine import Cell, refine_line
from recognition.experts.templates.segmentation import MARGIN_PIXELS, STANDS_OUT, usual_spacing
from recognition.experts.templates.sparse_templates import (
    EVIDENCE_PIXELS,
    dense_evidence,
    ideal_evidence,
    predicted_columns,
    reach_of,
    turned_templates,
)
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.whisker.array import ALL_DIRECTIONS, default_plan
from whisker_array.whisker.touch import Touch

HEIGHT_MM = 5.0
CHARS = "K7B1834RP"
TEXT = "K7B183"
SENSOR = 0.01
"""Standard deviation of the noise put on every channel, of the largest prediction of about 1."""
PIXEL_MM = HEIGHT_MM / EVIDENCE_PIXELS
NEAR_ONE = 0.3
"""By how much a clean character's share of its ideal may differ from 1: it lies between pixels, which are 0.2 mm wide
and a fifth of a stroke (0.72 to 1.04 over all phases of the grid)."""
AMPLITUDE = 0.15
"""Relative error of depths felt, against those felt at the die's own depth: walls of a deep mark crowd its floor."""
Feel = Callable[..., tuple[StampedPart, PlacedLine]]
Line = tuple[StampedPart, LineImage, PlacedLine, tuple[Cell, ...], TemplateSet]


@pytest.fixture(scope="module")
def feel(gothic: Font, touch: Touch, place_line: Callable[..., PlacedLine]) -> Feel:
    """Parts by text and depth of the die, felt, and their lines placed."""

    def felt(text: str = TEXT, *, depth: float = 1.0) -> tuple[StampedPart, PlacedLine]:
        die = default_die(HEIGHT_MM, font=gothic)
        part = stamp_line(
            text,
            gothic,
            replace(die, depth_mm=die.depth_mm * depth),
            height_mm=HEIGHT_MM,
            pitch_mm=HEIGHT_MM / 60,
            variation=StampingVariation.none(),
            rng=np.random.default_rng(1),
        )
        plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=HEIGHT_MM)
        edges: EdgeMap = edge_map(trace_scan(part.height_map, touch=touch, plan=plan))
        return part, place_line(part, edges, chars=CHARS)

    return felt


def noisy(part: StampedPart, placed: PlacedLine) -> Line:
    """With the noise of a sensor."""
    noise = np.random.default_rng(2).standard_normal(placed.image.channels.shape) * SENSOR
    image = with_channels(placed.image, placed.image.channels + noise)
    own = replace(placed, image=image)
    return part, image, own, refine_line(own, ALL_DIRECTIONS)[1], placed.templates


@pytest.fixture(scope="module")
def line(feel: Feel) -> Line:
    """A clean line, with the noise of a sensor."""
    return noisy(*feel())


def with_channels(image: LineImage, channels: np.ndarray) -> LineImage:
    return replace(image, channels=np.ascontiguousarray(channels, dtype=np.float32))


def look(
    line: Line,
    image: LineImage | None = None,
    *,
    places: tuple[str, ...] = (CHARS,) * len(TEXT),
    gaps: frozenset[int] = frozenset(),
) -> tuple[PlaceEvidence, ...]:
    _, clean, placed, cells, _ = line
    own = replace(placed, image=image if image is not None else clean)
    made = line_evidence(own, cells, ALL_DIRECTIONS, places=places, gaps=gaps)
    assert made
    return made


def text_of(places: tuple[PlaceEvidence, ...], templates: TemplateSet) -> str:
    return "".join(templates.chars[int(np.argmax(p.evidence))] for p in places)


def window(part: StampedPart, image: LineImage, which: int, *, side_mm: float = 0.4) -> tuple[slice, slice]:
    """Rows and columns of the image about one character."""
    x0, y0, x1, y1 = part.boxes_mm[which]
    cx, cy = image.centre_mm

    def at(mm: float, centre: float, origin: float, pitch: float) -> int:
        return max(0, round((mm - centre - origin) / pitch))

    (u0, v0), p, q = image.origin_mm, image.pitch_u_mm, image.pitch_v_mm
    return (
        slice(at(y0 - side_mm, cy, v0, q), at(y1 + side_mm, cy, v0, q)),
        slice(at(x0 - side_mm, cx, u0, p), at(x1 + side_mm, cx, u0, p)),
    )


def wiped(line: Line, *which: int, half: str = "") -> LineImage:
    """The line with characters, or the top, bottom, left or right half of them, felt as bare land."""
    part, image, _, _, _ = line
    channels = image.channels.copy()
    for k in which:
        rows, cols = window(part, image, k)
        row, col = (rows.start + rows.stop) // 2, (cols.start + cols.stop) // 2
        rows = {"top": slice(rows.start, row), "bottom": slice(row, rows.stop)}.get(half, rows)
        cols = {"left": slice(cols.start, col), "right": slice(col, cols.stop)}.get(half, cols)
        noise = np.random.default_rng(k).standard_normal(channels[:, rows, cols].shape)
        channels[:, rows, cols] = SENSOR * noise
    return with_channels(image, channels)


# ------------------------------------------------------------------------------------------------------- clean


def test_a_clean_line_is_what_was_stamped(line: Line) -> None:
    part, image, _, _, templates = line
    found = look(line)
    assert text_of(found, templates) == TEXT
    for k, (place, (x0, _, x1, _)) in enumerate(zip(found, part.boxes_mm, strict=True)):
        own = templates.chars.index(TEXT[k])
        assert place.evidence[own] / place.ideal[own] == pytest.approx(1.0, abs=NEAR_ONE)
        x, _ = image.plate_from_line(place.u_mm, place.v_mm)
        # a pixel of the evidence, and a half for the search's
        assert x == pytest.approx(0.5 * (x0 + x1), abs=1.5 * PIXEL_MM)
        assert place.half_width_mm == pytest.approx(0.5 * (x1 - x0), abs=0.2)
    assert [p.u_mm for p in found] == sorted(p.u_mm for p in found)


def test_the_same_line_gives_the_same_evidence(line: Line) -> None:
    for a, b in zip(look(line), look(line), strict=True):
        np.testing.assert_array_equal(a.evidence, b.evidence)


def test_the_dense_sum_is_the_sum(line: Line) -> None:
    _, _, placed, _, templates = line
    reach = reach_of(templates, ALL_DIRECTIONS)
    felt = padded(resampled_to(placed), MARGIN_PIXELS).channels
    profile = ~is_edge_channel(ALL_DIRECTIONS)
    model = pixel_model(
        noise=np.maximum(robust_spread(felt), LEAST_NOISE * reach), reach=reach, profile=profile, raised=False
    )
    cover = covered(felt, profile=profile, reach=reach, raised=False, pixels_per_height=EVIDENCE_PIXELS)
    index, sparse = model.felt_index(felt, cover), turned_templates(templates, ALL_DIRECTIONS, 0.0, reach)
    rng = np.random.default_rng(8)
    _, height, width = felt.shape
    # some rows of the ink lie off the map
    rows = np.array([2, height // 2, height - 3])
    cols = np.sort(rng.choice(width, 5, replace=False))
    dense = dense_evidence(model, index, sparse, reach, rows, cols)
    table, columns = model.table.ravel(), predicted_columns(model, sparse)
    for t in range(len(templates.chars)):
        for i, row in enumerate(rows):
            for j, col in enumerate(cols):
                total, size = 0.0, 0.0
                for n in range(int(sparse.start[t]), int(sparse.start[t + 1])):
                    r, c, k = int(row + sparse.row[n]), int(col + sparse.column[n]), int(sparse.channel[n])
                    if 0 <= r < height and 0 <= c < width:
                        said = float(table[index[k, r, c] + columns[n]])
                        total, size = total + said, size + abs(said)
                # single precision, some thousand terms
                assert dense[t, i, j] == pytest.approx(total, abs=1e-4 * size + 1e-3)


def test_ideal_is_what_a_template_has_on_its_own_prediction(line: Line) -> None:
    *_, templates = line
    reach = reach_of(templates, ALL_DIRECTIONS)
    model = pixel_model(
        noise=LEAST_NOISE * reach, reach=reach, profile=~is_edge_channel(ALL_DIRECTIONS), raised=False
    )
    sparse = turned_templates(templates, ALL_DIRECTIONS, 0.0, reach)
    ideal = ideal_evidence(model, sparse, reach)
    assert (ideal > 0.0).all()
    tall = int(np.abs(sparse.row).max()) + 1
    wide = int(np.abs(sparse.column).max()) + 1
    for t in range(len(templates.chars)):
        own = np.zeros((reach.size, 2 * tall + 1, 2 * wide + 1), np.float32)
        part = slice(int(sparse.start[t]), int(sparse.start[t + 1]))
        own[sparse.channel[part], tall + sparse.row[part], wide + sparse.column[part]] = sparse.value[part]
        index = model.felt_index(own, np.zeros(own.shape[1:], np.float32))
        there = dense_evidence(model, index, sparse, reach, np.array([tall]), np.array([wide]))[:, 0, 0]
        # single precision
        assert there[t] == pytest.approx(ideal[t], rel=1e-4)
        # nobody explains it better than itself
        assert int(np.argmax(there)) == t


def test_depth_needs_no_reference(feel: Feel) -> None:
    for depth in (0.5, 1.0, 1.5):
        _, placed = feel(depth=depth)
        found = amplitude_of(placed, refine_line(placed, ALL_DIRECTIONS)[1], ALL_DIRECTIONS)
        assert found == pytest.approx(depth, rel=0.1)


# -------------------------------------------------------------------------------------------------------- dirt


@pytest.mark.parametrize(("half", "least"), [("top", 6), ("bottom", 5), ("left", 4), ("right", 4)])
def test_half_a_character_is_enough_for_most(half: str, least: int, line: Line) -> None:
    # without its lower half B is P, without its left one 8 and B are 3: those nobody could read
    right = 0
    for k, char in enumerate(TEXT):
        found = look(line, wiped(line, k, half=half))
        read = text_of(found, line[4])
        assert len(read) == len(TEXT)
        assert read[:k] + read[k + 1 :] == TEXT[:k] + TEXT[k + 1 :]
        right += read[k] == char
    assert right >= least


def test_half_the_strokes_are_half_the_share(line: Line) -> None:
    whole, half, none = (look(line, image) for image in (line[1], wiped(line, 2, half="top"), wiped(line, 2)))
    own = line[4].chars.index("B")
    shares = [float(e[2].evidence[own] / e[2].ideal[own]) for e in (whole, half, none)]
    assert shares[0] > shares[1] + 0.2
    # missing ink speaks against, but mildly: dirt fills
    assert shares[1] > shares[2] > -0.8
    assert shares[2] < 0.1


def test_a_chip_on_the_land_changes_little(line: Line) -> None:
    part, image, _, _, templates = line
    clean = look(line)
    rows, cols = window(part, image, 3, side_mm=0.0)
    chipped = image.channels.copy()
    # between two characters, as high as marks are deep, steep on all sides
    at = (slice(rows.start + 8, rows.start + 14), slice(cols.start - 10, cols.start - 5))
    chipped[(0, *at)] = -np.sign(image.channels[0].sum()) * np.abs(image.channels[0]).max()
    chipped[(slice(1, 3), *at)] = np.abs(image.channels[1:]).max()
    found = look(line, with_channels(image, chipped))
    assert text_of(found, templates) == TEXT
    for k, (one, other) in enumerate(zip(clean, found, strict=True)):
        own = templates.chars.index(TEXT[k])
        # it touches a neighbour's rim at most
        assert other.evidence[own] == pytest.approx(one.evidence[own], abs=0.15 * one.ideal[own])
        assert other.u_mm == pytest.approx(one.u_mm, abs=1.5 * PIXEL_MM)


def test_a_wiped_character_keeps_its_place(line: Line) -> None:
    clean = look(line)
    for k in range(1, len(TEXT) - 1):
        found = look(line, wiped(line, k))
        assert len(found) == len(TEXT)
        for i, (one, other) in enumerate(zip(clean, found, strict=True)):
            if i != k:
                assert other.u_mm == pytest.approx(one.u_mm, abs=1.5 * PIXEL_MM)
        # somewhere in the hole, and hardly anything is found there
        assert found[k].u_mm == pytest.approx(clean[k].u_mm, abs=0.35 * HEIGHT_MM)
        assert (found[k].evidence / found[k].ideal).max() < 0.15


def test_characters_that_the_format_bars_are_not_placed(line: Line) -> None:
    *_, templates = line
    found = look(line, places=("K", "7", "8", "1", "8", "3"))
    assert len(found) == len(TEXT)
    # every template is asked all the same: the format has its say later
    assert text_of(found, templates) == TEXT


def test_a_line_without_room_for_its_format_has_no_places(line: Line) -> None:
    _, _, placed, cells, _ = line
    assert line_evidence(placed, cells, ALL_DIRECTIONS, places=(CHARS,) * 40) == ()


# ------------------------------------------------------------------------------------------ place, depth, gaps


def test_a_map_with_more_land_is_read_alike(line: Line) -> None:
    image = line[1]
    # whole pixels of land on the left, of the evidence and of the map at once
    step = round(10 * PIXEL_MM / image.pitch_u_mm)
    assert step * image.pitch_u_mm == pytest.approx(10 * PIXEL_MM, rel=0.25)
    wider = padded(image, step)
    here, there = look(line), look(line, wider)
    for one, other in zip(here, there, strict=True):
        # the grid of the evidence begins elsewhere
        assert other.u_mm == pytest.approx(one.u_mm, abs=PIXEL_MM)
        assert int(np.argmax(other.evidence)) == int(np.argmax(one.evidence))
        assert other.evidence.max() == pytest.approx(one.evidence.max(), rel=NEAR_ONE)


def test_a_louder_map_has_louder_marks(line: Line) -> None:
    _, image, placed, cells, _ = line
    plain = amplitude_of(placed, cells, ALL_DIRECTIONS)
    for times in (0.5, 1.5):
        louder = replace(placed, image=with_channels(image, image.channels * times))
        assert amplitude_of(louder, cells, ALL_DIRECTIONS) == pytest.approx(times * plain, rel=1e-4)


def test_depth_is_read_off_floors(feel: Feel) -> None:
    def amplitude(depth: float) -> float:
        _, placed = feel(depth=depth)
        return amplitude_of(placed, refine_line(placed, ALL_DIRECTIONS)[1], ALL_DIRECTIONS)

    plain = amplitude(1.0)
    assert plain == pytest.approx(1.0, abs=AMPLITUDE)
    for depth in (0.5, 0.75, 1.25, 1.5):
        assert amplitude(depth) / plain == pytest.approx(depth, rel=AMPLITUDE)


def test_nothing_that_fits_says_no_depth(line: Line) -> None:
    _, _, placed, cells, _ = line
    poor = [replace(c, scores=np.full_like(c.scores, 0.1)) for c in cells]
    assert amplitude_of(placed, poor, ALL_DIRECTIONS) == 1.0


def test_a_word_gap_costs_no_place(feel: Feel) -> None:
    gapped = noisy(*feel("K7 183"))
    part = gapped[0]
    boxes = [b for b, c in zip(part.boxes_mm, part.text, strict=True) if c != " "]
    for image in (gapped[1], wiped((replace(part, text="K7183", boxes_mm=tuple(boxes)), *gapped[1:]), 3)):
        found = look(gapped, image, places=(CHARS,) * 5, gaps=frozenset({1}))
        for k, (place, (x0, _, x1, _)) in enumerate(zip(found, boxes, strict=True)):
            x, _ = image.plate_from_line(place.u_mm, place.v_mm)
            wide = 0.35 * HEIGHT_MM if k == 3 else 1.5 * PIXEL_MM
            assert x == pytest.approx(0.5 * (x0 + x1), abs=wide)


# ----------------------------------------------------------------------------------------------------- spacing


def chain(columns: list[float], which: list[int], template_scores: list[float] | None = None) -> list[Placed]:
    given = template_scores if template_scores is not None else [1.0] * len(columns)
    return [Placed(t, round(c), r) for t, c, r in zip(which, columns, given, strict=True)]


def by_font(font: Font, chars: str, text: str, extra: float) -> list[float]:
    """Middles of ink as the font sets them, letter-spaced, pixels of the evidence."""
    pen, out = 0.0, []
    for c in text:
        glyph = font.glyph(c)
        out.append((pen + 0.5 * (glyph.ink_box[0] + glyph.ink_box[2])) * EVIDENCE_PIXELS)
        pen += glyph.advance + extra
    return out


def apart(spacing: Spacing, one: int, other: int) -> float:
    return float(spacing.after[one] + spacing.before[other])


def full(templates: TemplateSet) -> np.ndarray:
    """Every template earns 1 where it stands clean."""
    return np.ones(len(templates.chars))


@pytest.mark.parametrize("extra", [0.0, 0.3])
def test_spacing_as_the_font_has_it(extra: float, line: Line, gothic: Font) -> None:
    templates, text = line[4], "K1B17K8"
    which = [templates.chars.index(c) for c in text]
    columns = by_font(gothic, CHARS, text, extra)
    spacing = usual_spacing(chain(columns, which), templates.chars, gothic, full=full(templates))
    assert spacing is not None
    for a, b, left, right in zip(which, which[1:], columns, columns[1:], strict=False):
        # columns are whole
        assert apart(spacing, a, b) == pytest.approx(right - left, abs=1.0)


def test_spacing_that_is_even(line: Line, gothic: Font) -> None:
    templates, text = line[4], "K1B17K8"
    which = [templates.chars.index(c) for c in text]
    spacing = usual_spacing(
        chain([20.0 * k for k in range(7)], which), templates.chars, gothic, full=full(templates)
    )
    assert spacing is not None
    assert {apart(spacing, a, b) for a in which for b in which} == {20.0}


def test_spacing_leaves_out_gaps_and_what_does_not_stand_out(line: Line, gothic: Font) -> None:
    templates, text = line[4], "KKKKKK"
    which = [templates.chars.index(c) for c in text]
    columns = [0.0, 20.0, 70.0, 90.0, 110.0, 141.0]
    template_scores = [1.0, 1.0, 1.0, 1.0, 1.0, 0.5 * STANDS_OUT]
    spacing = usual_spacing(
        chain(columns, which, template_scores),
        templates.chars,
        gothic,
        full=full(templates),
        gaps=frozenset({1}),
    )
    assert spacing is not None
    assert apart(spacing, which[0], which[0]) == pytest.approx(20.0)
    assert spacing.free_after == {1}
    # one pair tells it too; of none nothing is known
    one = usual_spacing(chain(columns[:2], which[:2]), templates.chars, gothic, full=full(templates))
    assert one is not None
    assert apart(one, which[0], which[0]) == pytest.approx(20.0)
    assert usual_spacing(chain(columns[:1], which[:1]), templates.chars, gothic, full=full(templates)) is None
