"""Pictures of a named font: the sum over all settings is exact, and a line is placed and judged whatever the light."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.fonts.glyph import Font
from glyphs.stamping.stamp import StampedPart
from recognition.experts.templates.photo_chain import gap_of, settled
from recognition.experts.templates.photo_judge import SCALES, allowed_of, judged_photo, placed
from recognition.experts.templates.photo_shapes import PhotoShapes, photo_edges, photo_shapes
from recognition.language.lattice import Lattice
from recognition.lines.moves import moved
from recognition.views.text_line import TextLine
from recognition.views.view import View, photo_view

TEXT, CHARS = "K7B29", "0123456789ABKR"
EVERY = frozenset[int]()


def shapes_of(*, middle: tuple[float, ...], advance: tuple[float, ...]) -> PhotoShapes:
    """A font of which nothing but the setting is known, ten pixels high."""
    n = len(middle)
    return PhotoShapes(
        10,
        "AB1"[:n],
        np.zeros((n, 3, 2, 3, 3), np.float32),
        np.zeros((n, 3, 3)),
        np.array(middle),
        np.array(advance),
    )


def test_the_sum_over_settings_is_that_of_all_of_them_one_by_one() -> None:
    shapes = shapes_of(middle=(3.0, 2.0), advance=(7.0, 5.0))
    rng = np.random.default_rng(3)
    evidence = rng.normal(0.0, 2.0, (2, 12))
    allowed = np.array([[True, True], [True, False]])
    found = settled(evidence, shapes, allowed, gap=1.0, word_gaps=EVERY)
    assert found is not None
    spacing = np.arange(-3, 13) / 10
    prior = -np.minimum(0.5 * ((spacing - 0.1) / 0.05) ** 2, 6.0)
    prior -= np.logaddexp.reduce(prior)
    terms: dict[tuple[int, int], list[float]] = {}
    for c, d, x, y in itertools.product(range(2), range(2), range(12), range(12)):
        gap = (y - shapes.middle[d]) - (x - shapes.middle[c] + shapes.advance[c])
        if allowed[1, d] and -3 <= gap <= 12:
            start = -math.log(12) - math.log(2)
            terms.setdefault((c, d), []).append(start + evidence[c, x] + evidence[d, y] + prior[int(gap) + 3])
    sums = {pair: float(np.logaddexp.reduce(logs)) for pair, logs in terms.items()}
    whole = float(np.logaddexp.reduce(list(sums.values())))
    assert found.log_evidence == pytest.approx(whole, abs=1e-9)  # sums of the same numbers
    for c in range(2):
        assert found.log_belief[0, c] == pytest.approx(sums[c, 0] - whole, abs=1e-9)
    assert found.log_belief[1].tolist() == pytest.approx([0.0, -np.inf])


def test_a_line_without_room_is_none() -> None:
    shapes = shapes_of(middle=(3.0,), advance=(7.0,))
    allowed = np.ones((9, 1), dtype=np.bool_)
    assert settled(np.zeros((1, 12)), shapes, allowed, gap=1.0, word_gaps=EVERY) is None


def test_the_gap_of_a_line_is_what_its_characters_stand_apart() -> None:
    shapes = shapes_of(middle=(3.0, 2.0), advance=(7.0, 5.0))
    # origins 0, 9, 18, 25: advances 7, 7, 5 and gaps of 2
    assert gap_of(shapes, [0, 0, 1, 0], [3, 12, 20, 28], EVERY) == pytest.approx(2.0)
    assert gap_of(shapes, [0, 0], [3, 12], EVERY) is None


def test_edges_do_not_know_how_bright_the_picture_is() -> None:
    grey = np.random.default_rng(0).uniform(0.2, 0.4, (40, 60)).astype(np.float32)
    known = np.ones(grey.shape, dtype=np.bool_)
    bright = photo_edges(grey * 2.0 + 0.03, known, pixels=20)  # the logarithm's shift, doubled with the rest
    assert np.abs(bright - photo_edges(grey, known, pixels=20)).max() < 1e-3  # rounding of single precision


@pytest.fixture(scope="module")
def pictures(gothic: Font) -> tuple[PhotoShapes, ...]:
    return tuple(photo_shapes(gothic, CHARS, pixels=n) for n in SCALES)


def photographed(part: StampedPart, azimuth_deg: float) -> View:
    """A matt part with patches of paint, lit from one side."""
    gy, gx = np.gradient(part.height_map.z_mm.astype(np.float64), part.height_map.pitch_mm)
    rng, a = np.random.default_rng(1), math.radians(azimuth_deg)
    grey = 110.0 * (1.0 - 0.5 * (math.cos(a) * gx + math.sin(a) * gy))
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
    for _ in range(40):
        r, c, size = rng.uniform(0, grey.shape[0]), rng.uniform(0, grey.shape[1]), rng.uniform(4, 12)
        grey = np.where((x - c) ** 2 + (y - r) ** 2 < size**2, 0.6 * grey, grey)
    pixels = np.clip(np.rint(grey + rng.normal(0.0, 3.0, grey.shape)), 0, 255).astype(np.uint8)
    return photo_view(Photo(pixels, pitch_mm=part.height_map.pitch_mm))


def line_of(part: StampedPart) -> TextLine:
    boxes = np.array(part.boxes_mm)
    y = float((boxes[:, 1] + boxes[:, 3]).mean() / 2)
    return TextLine(np.array([(boxes[0, 0], y), (boxes[-1, 2], y)]), part.height_mm)


def open_lattice(places: int) -> Lattice:
    return Lattice(tuple(CHARS), np.full((places, len(CHARS)), -math.log(len(CHARS))))


@pytest.mark.parametrize("azimuth_deg", [0.0, 100.0, 230.0])
def test_a_line_is_read_whatever_the_light(
    azimuth_deg: float, pictures: tuple[PhotoShapes, ...], make_part: Callable[..., StampedPart]
) -> None:
    part = make_part(TEXT)
    view = photographed(part, azimuth_deg)
    found = judged_photo(view, pictures, line_of(part), open_lattice(len(TEXT)), EVERY)
    assert found is not None
    value, lattice = found
    assert value > 0.0
    assert "".join(lattice.chars[k] for k in lattice.log_belief.argmax(axis=1)) == TEXT


def test_a_line_found_badly_is_placed(
    pictures: tuple[PhotoShapes, ...], make_part: Callable[..., StampedPart]
) -> None:
    part = make_part(TEXT)
    line = line_of(part)
    allowed = np.ones((len(TEXT), len(CHARS)), dtype=np.bool_)
    bad = moved(line, 0.15, 1.08, 2.5)
    fit = placed(photographed(part, 60.0), pictures[0], [bad], allowed, EVERY)
    assert fit is not None
    # a pixel of twenty over the line's length; the steps in which heights are tried
    assert abs(fit.placed.turned_deg - line.turned_deg) < 1.0
    assert fit.placed.height_mm == pytest.approx(line.height_mm, rel=0.04)
    assert (
        np.abs(fit.placed.centre_mm.mean(axis=0) - line.centre_mm.mean(axis=0)).max() < 0.15 * line.height_mm
    )


def test_a_font_without_the_characters_of_a_place_has_no_say(pictures: tuple[PhotoShapes, ...]) -> None:
    chars = (*CHARS, "Z")
    log = np.full((1, len(chars)), -np.inf)
    log[0, -1] = 0.0
    assert allowed_of(pictures[0], Lattice(chars, log)) is None


def land(shape: tuple[int, int]) -> NDArray[np.uint8]:
    return np.full(shape, 120, dtype=np.uint8)


def test_land_makes_no_line_likely(pictures: tuple[PhotoShapes, ...]) -> None:
    view = photo_view(Photo(land((80, 300))))
    line = TextLine.straight(40.0, 40.0, length_mm=200.0, height_mm=30.0)
    found = judged_photo(view, pictures, line, open_lattice(5), EVERY)
    assert found is not None
    assert found[0] <= 0.0
