"""Characters of a font in the recogniser's features: what physics predicts is read back, under dirt and lamps too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs import Part, stamp
from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from recognition.glyph_match.predicted import (
    CANONICAL_HEIGHT_MM,
    TemplateSet,
    ideal_plate,
    line_of,
    lit_views,
    predict_templates,
    template_key,
)
from recognition.glyph_match.prototypes import (
    LIGHTS,
    Prototypes,
    cosines,
    felt_prototypes,
    lattice_of,
    lit_prototypes,
    match_fonts,
)
from recognition.language.lattice import Lattice
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.recogniser import FEATURE_COLUMNS, Features, features_of
from recognition.see.text_line import HEIGHT_ROWS, MARGIN
from recognition.see.view import View, felt_view, photo_view, relief_of
from tests.support.felt import felt, stamped_line
from whisker_array.estimation.edges import edge_map
from whisker_array.whisker.touch import Touch

TEXT = "HM50R3X8"
LEAST_LEAD = 0.1
"""Of a font's own character over all its others: O over 0 of timesr, the least, has 0.16."""
Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def sets(touch: Touch) -> Callable[[str], TemplateSet]:
    fonts = (load_font("gothic"), load_font("timesr"))
    made = {
        one.name: predict_templates(one, ALPHANUMERIC, template_key(one, touch, height_mm=5.0))
        for one in fonts
    }
    return made.__getitem__


@pytest.fixture(scope="module")
def lamps(gothic: Font) -> tuple[Prototypes, ...]:
    return lit_prototypes(gothic, ALPHANUMERIC)


def of_plate(view: View, middles_mm: Floats) -> tuple[Features, Floats]:
    """Features of a predicted plate, and the columns at which its characters stand."""
    line = line_of(middles_mm)
    along = np.linalg.norm(middles_mm - line.centre_mm[0], axis=1) / line.height_mm
    return features_of(view.strip(line)), (along + MARGIN) * HEIGHT_ROWS - 0.5


def leads(cosine: Floats) -> Floats:
    """By which every character's own prototype leads all others, on a plate of them all in order."""
    others = np.where(np.eye(len(cosine), dtype=np.bool_), -np.inf, cosine)
    return np.asarray(np.diag(cosine) - others.max(axis=1))


def even(text: str) -> Lattice:
    """All characters alike at every place."""
    n = len(ALPHANUMERIC)
    return Lattice(tuple(ALPHANUMERIC), np.full((len(text), n), -np.log(n)))


def surest_at_least(lattice: Lattice) -> float:
    """Belief in the best character of the place that is least sure."""
    return float(np.exp(lattice.log_belief.max(axis=1)).min())


# -------------------------------------------------------------------------------------------------- predicted


@pytest.mark.parametrize("font", ["gothic", "timesr"])
def test_what_is_felt_of_a_fonts_own_plate_is_read_back(
    font: str, sets: Callable[[str], TemplateSet]
) -> None:
    one = sets(font)
    made = felt_prototypes(one)
    assert made is felt_prototypes(one)
    assert "".join(made.chars) == ALPHANUMERIC
    cosine = cosines(*of_plate(one.view, one.middles_mm), made)
    np.testing.assert_allclose(np.diag(cosine), 1.0, atol=1e-5)
    assert cosine.max() <= 1.0 + 1e-5
    assert leads(cosine).min() > LEAST_LEAD


def test_what_is_seen_of_a_fonts_own_plate_is_read_back_under_each_light(
    gothic: Font, lamps: tuple[Prototypes, ...]
) -> None:
    plate = ideal_plate(gothic, ALPHANUMERIC, default_die(CANONICAL_HEIGHT_MM, font=gothic))
    for made, view in zip(lamps, lit_views(plate, LIGHTS), strict=True):
        cosine = cosines(*of_plate(view, plate.middles_mm), made)
        np.testing.assert_allclose(np.diag(cosine), 1.0, atol=1e-5)
        assert leads(cosine).min() > LEAST_LEAD


def test_a_place_may_lie_off_by_some_steps(sets: Callable[[str], TemplateSet]) -> None:
    one = sets("gothic")
    features, columns = of_plate(one.view, one.middles_mm)
    for steps in range(-3, 4):
        cosine = cosines(features, columns + steps * FEATURE_COLUMNS, felt_prototypes(one))
        np.testing.assert_allclose(np.diag(cosine), 1.0 - 0.007 * abs(steps), atol=1e-5)


# ------------------------------------------------------------------------------------------------------ parts


def part_of(dirt: float) -> Part:
    return stamp(TEXT, fonts="gothic", height_mm=5.0, pitch_mm=5.0 / 60, seed=0, dirt=dirt)


def touched(part: Part, touch: Touch) -> View:
    scan = felt(part.height_map, touch=touch, soil=part.soil)
    edges = edge_map(scan)
    return felt_view(edges, relief_of(scan, edges), touch)


@pytest.mark.parametrize("dirt", [0.0, 0.3, 0.6])
def test_a_dirty_line_is_read_in_the_font_that_is_named(
    dirt: float, touch: Touch, sets: Callable[[str], TemplateSet]
) -> None:
    part = part_of(dirt)
    view, where = touched(part, touch), stamped_line(part.stamped)
    gothic, timesr = (felt_prototypes(sets(name)) for name in ("gothic", "timesr"))
    found, _ = match_fonts([view], *where, [[gothic]], even(TEXT))
    assert found.text == TEXT
    assert surest_at_least(found) > 0.8
    # of several fonts the one that suits
    for which, fonts in enumerate(([[gothic], [timesr]], [[timesr], [gothic]])):
        chosen, best = match_fonts([view], *where, fonts, even(TEXT))
        np.testing.assert_array_equal(chosen.log_belief, found.log_belief)
        assert best == which
    assert surest_at_least(match_fonts([view], *where, [[timesr]], even(TEXT))[0]) < surest_at_least(found)
    # two views that show the same say what one says, and without fonts nothing is said
    twice, _ = match_fonts([view, view], *where, [[gothic]], even(TEXT))
    np.testing.assert_allclose(twice.log_belief, found.log_belief, atol=1e-9)


@pytest.mark.parametrize("azimuth_deg", [0.0, 100.0, 225.0])
def test_a_photograph_is_read_wherever_the_lamp_stands(
    azimuth_deg: float, lamps: tuple[Prototypes, ...]
) -> None:
    part = part_of(0.0)
    width, high = part.height_map.size_mm
    taken = part.photograph(light_azimuth_deg=azimuth_deg, light_elevation_deg=35.0, pixel_mm=0.1)
    view = photo_view(replace(taken, centre_mm=(0.5 * width, 0.5 * high)))
    found, _ = match_fonts([view], *stamped_line(part.stamped), [lamps], even(TEXT))
    assert found.text == TEXT
    assert surest_at_least(found) > 0.5


# ---------------------------------------------------------------------------------------------------- lattices


def test_a_lattice_has_what_cosines_make_of_what_is_allowed() -> None:
    with np.errstate(divide="ignore"):
        before = Lattice(tuple("ABC8"), np.log(np.array([[0.4, 0.3, 0.3, 0.0], [0.1, 0.2, 0.6, 0.1]])))
    # the font has no C, and a Z that nobody looks for
    cosine = np.array([[0.9, 0.8, 0.95, 1.0], [0.5, 0.6, 0.4, 0.9]])
    made = lattice_of(cosine, "AB8Z", before, sharpness=20.0)
    assert made.chars == before.chars
    belief = np.exp(made.log_belief)
    np.testing.assert_allclose(belief.sum(axis=1), 1.0)
    assert (made.log_belief <= 0.0).all()
    # what is not allowed stays impossible, and what is allowed does not become so
    np.testing.assert_array_equal(np.isfinite(made.log_belief), np.isfinite(before.log_belief))
    # of C nothing is known: as likely as the least likely of what may stand there
    assert belief[0, 2] == pytest.approx(belief[0, :2].min())
    assert belief[1, 2] == pytest.approx(belief[1, [0, 1, 3]].min())
    # what others believed of a place does not count, the difference of cosines does
    log = made.log_belief
    assert log[0, 0] - log[0, 1] == pytest.approx(20.0 * 0.1)
    assert log[1, 1] - log[1, 3] == pytest.approx(20.0 * 0.2)


def test_a_font_that_has_nothing_of_what_is_allowed_says_nothing() -> None:
    with np.errstate(divide="ignore"):
        before = Lattice(tuple("AB8"), np.log(np.array([[0.7, 0.3, 0.0]])))
    made = lattice_of(np.array([[0.9]]), "8", before)
    np.testing.assert_allclose(np.exp(made.log_belief), [[0.5, 0.5, 0.0]])
