"""Characters of a font in the recogniser's features, under dirt and lamps; recogniser, faces and depths together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs import Part, stamp
from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from recognition.glyph_match.combine import (
    ExpertWeights,
    LineExperts,
    believe_faces,
    combine_experts,
    fitted_weights,
)
from recognition.glyph_match.face_library import Sense, face_library
from recognition.glyph_match.faces import FaceCosines, compare_faces, read_faces
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
    lit_prototypes,
    place_windows,
    plate_columns,
)
from recognition.language.lattice import Lattice
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.recogniser import FEATURE_COLUMNS, features_of
from recognition.see.text_line import TextLine
from recognition.see.view import View, felt_view, photo_view, relief_of
from tests.support.evidence import believed_line
from tests.support.felt import felt, stamped_line
from whisker_array.estimation.edges import edge_map
from whisker_array.whisker.touch import Touch

# -------------------------------------------------------------------------------------------------------- prototypes

TEXT = "HM50R3X8"
LEAST_LEAD = 0.02
"""Of a font's own character over all its others."""
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
def lamps(gothic: Font) -> Prototypes:
    return lit_prototypes(gothic, ALPHANUMERIC, face_library("vision").map)


def prototypes_of(templates: TemplateSet, name: str) -> Prototypes:
    return felt_prototypes(templates, face_library("tactile").map, name)


def on_plate(view: View, middles_mm: Floats, faces: Prototypes, sense: Sense, *, off: float = 0.0) -> Floats:
    """(lights, T, T) cosines of a face with its own plate, the places off by some steps."""
    columns = plate_columns(middles_mm) + off * FEATURE_COLUMNS
    windows = place_windows(features_of(view.strip(line_of(middles_mm))), columns, face_library(sense).map)
    return np.asarray(cosines(windows, faces)[0])


def leads(cosine: Floats) -> Floats:
    """By which every character's own prototype leads all others, on a plate of them all in order."""
    others = np.where(np.eye(len(cosine), dtype=np.bool_), -np.inf, cosine)
    return np.asarray(np.diag(cosine) - others.max(axis=1))


def even(text: str) -> Lattice:
    """All characters alike at every place."""
    n = len(ALPHANUMERIC)
    return Lattice(tuple(ALPHANUMERIC), np.full((len(text), n), -np.log(n)))


# -------------------------------------------------------------------------------------------------- predicted


@pytest.mark.parametrize("font", ["gothic", "timesr"])
def test_what_is_felt_of_a_fonts_own_plate_is_read_back(
    font: str, sets: Callable[[str], TemplateSet]
) -> None:
    templates = sets(font)
    faces = prototypes_of(templates, font)
    assert faces is prototypes_of(templates, font)
    assert "".join(faces.chars) == ALPHANUMERIC
    (cosine,) = on_plate(templates.view, templates.middles_mm, faces, "tactile")
    assert cosine.max() <= 1.0 + 1e-5
    assert leads(cosine).min() > LEAST_LEAD


def test_what_is_seen_of_a_fonts_own_plate_is_read_back_under_each_light(
    gothic: Font, lamps: Prototypes
) -> None:
    plate = ideal_plate(gothic, ALPHANUMERIC, default_die(CANONICAL_HEIGHT_MM, font=gothic))
    for light, view in enumerate(lit_views(plate, LIGHTS)):
        cosine = on_plate(view, plate.middles_mm, lamps, "vision")
        assert cosine.max(axis=2).mean(axis=1).argmax() == light
        assert leads(cosine[light]).min() > LEAST_LEAD


def test_a_place_may_lie_off_by_some_steps(sets: Callable[[str], TemplateSet]) -> None:
    templates = sets("gothic")
    faces = prototypes_of(templates, "gothic")
    (there,) = on_plate(templates.view, templates.middles_mm, faces, "tactile")
    for steps in range(-3, 4):
        (cosine,) = on_plate(templates.view, templates.middles_mm, faces, "tactile", off=steps)
        assert (np.diag(cosine) >= np.diag(there) - 0.007 * abs(steps) - 1e-5).all()


# ------------------------------------------------------------------------------------------------------ parts


def part_of(dirt: float) -> Part:
    return stamp(TEXT, fonts="gothic", height_mm=5.0, pitch_mm=5.0 / 60, seed=0, dirt=dirt)


def touched(part: Part, touch: Touch) -> View:
    scan = felt(part.height_map, touch=touch, soil=part.soil)
    edges = edge_map(scan)
    return felt_view(edges, relief_of(scan, edges), touch)


def compared(
    views: list[View], where: tuple[TextLine, Floats], named: list[Prototypes], sense: Sense = "tactile"
) -> FaceCosines:
    """A line compared with the named fonts and the library, its characters unknown."""
    line, columns = where
    library, looks = face_library(sense), [features_of(view.strip(line)) for view in views]
    return compare_faces(looks, columns, named, library.faces, library.map, even(TEXT))


def by_faces(cosines: FaceCosines, sense: Sense = "tactile") -> str:
    """The text by the faces alone."""
    log = believe_faces(cosines.experts(even(TEXT)), fitted_weights(sense)).log
    return "".join(ALPHANUMERIC[k] for k in log.argmax(axis=1))


@pytest.mark.parametrize("dirt", [0.0, 0.3, 0.6])
def test_a_dirty_line_is_read_in_the_font_that_is_named(
    dirt: float, touch: Touch, sets: Callable[[str], TemplateSet]
) -> None:
    part = part_of(dirt)
    view, where = touched(part, touch), stamped_line(part.stamped)
    fonts = {name: prototypes_of(sets(name), name) for name in ("gothic", "timesr")}
    for names in (["gothic"], ["gothic", "timesr"], ["timesr", "gothic"]):
        cosines = compared([view], where, [fonts[name] for name in names])
        assert by_faces(cosines) == TEXT
        assert cosines.names[cosines.best_named] == "gothic"
    # two views that show the same say what one says
    twice = compared([view, view], where, [fonts["timesr"], fonts["gothic"]])
    np.testing.assert_allclose(twice.values, cosines.values, atol=1e-6)


def test_the_library_reads_a_line_whose_font_is_not_named(touch: Touch) -> None:
    part = part_of(0.0)
    view, where = touched(part, touch), stamped_line(part.stamped)
    cosines = compared([view], where, [])
    line = read_faces(believed_line(even(TEXT)), cosines, "tactile")
    right = sum(read == char for read, char in zip(line.lattice.text, TEXT, strict=True))
    assert right >= len(TEXT) - 1
    assert sum(line.faces.values()) == pytest.approx(1.0)
    assert set(cosines.names) < set(line.faces)
    # on bare land no face fits
    bare = replace(
        view,
        layers=np.where(np.arange(len(view.layers))[:, None, None] < len(view.layers) - 1, 0, view.layers),
    )
    nowhere = read_faces(believed_line(even(TEXT)), compared([bare], where, []), "tactile")
    assert max(nowhere.faces, key=nowhere.faces.__getitem__) == ""


@pytest.mark.parametrize("azimuth_deg", [0.0, 100.0, 225.0])
def test_a_photograph_is_read_wherever_the_lamp_stands(azimuth_deg: float, lamps: Prototypes) -> None:
    part = part_of(0.0)
    width, high = part.height_map.size_mm
    taken = part.photograph(light_azimuth_deg=azimuth_deg, light_elevation_deg=35.0, pixel_mm=0.1)
    view = photo_view(replace(taken, centre_mm=(0.5 * width, 0.5 * high)))
    assert by_faces(compared([view], stamped_line(part.stamped), [lamps], "vision"), "vision") == TEXT


# ----------------------------------------------------------------------------------------------------------- combine

WEIGHTS = ExpertWeights(
    sharpness=30.0, together=0.5, no_face=0.4, covered=0.05, named=1.0, network=0.7, network_fit=0.0,
    faces=0.5, faces_fit=0.0, depths=0.5, depths_fit=0.0, filled=0.1,
)  # fmt: skip
PLACES = 4


def line(cosines: object, *, network: object = None, named: tuple[bool, ...] = ()) -> LineExperts:
    """Four places of three characters; each face has the same cosines at all of them."""
    rows = np.array(cosines, dtype=np.float64)
    values = np.repeat(rows[:, None], PLACES, axis=1)
    share = np.full((PLACES, 3), 1.0 / 3.0) if network is None else np.tile(network, (PLACES, 1))
    with np.errstate(divide="ignore"):
        return LineExperts(np.log(share), values, np.array(named or (False,) * len(rows)))


def together(experts: LineExperts, weights: ExpertWeights = WEIGHTS) -> np.ndarray:
    return np.exp(combine_experts(experts, believe_faces(experts, weights), weights))


def test_the_face_that_explains_all_places_speaks() -> None:
    right, other = [0.8, 0.5, 0.3], [0.4, 0.5, 0.45]
    belief = believe_faces(line([other, right]), WEIGHTS)
    assert belief.faces.argmax() == 1
    assert belief.faces.sum() == pytest.approx(1.0)
    assert (belief.log.argmax(axis=1) == 0).all()
    assert belief.fit == pytest.approx(0.4, abs=0.01)
    # one that was named is more probable than another that fits as well
    named = believe_faces(line([right, right], named=(True, False)), WEIGHTS).faces
    assert np.log(named[0] / named[1]) == pytest.approx(WEIGHTS.named)


def test_where_no_face_fits_the_recogniser_speaks_alone() -> None:
    share = [0.7, 0.2, 0.1]
    experts = line([[0.1, 0.15, 0.05]], network=share)
    belief = believe_faces(experts, WEIGHTS)
    assert belief.faces[-1] > 0.999
    assert np.exp(belief.log).sum(axis=1).max() < 0.01
    alone = np.array(share) ** WEIGHTS.network
    np.testing.assert_allclose(together(experts)[0], alone / alone.sum(), atol=1e-3)


def test_a_covered_place_is_left_to_the_recogniser() -> None:
    experts = line([[0.8, 0.3, 0.3]])
    experts.cosines[:, 2] = [0.1, 0.2, 0.1]
    belief = believe_faces(experts, WEIGHTS)
    assert belief.faces[0] > 0.99
    shows = np.exp(belief.log).sum(axis=1)
    assert shows[2] < 0.1 < 0.9 < shows[[0, 1, 3]].min()


def test_what_no_face_has_keeps_the_recognisers_share_and_what_is_forbidden_stays_so() -> None:
    experts = line([[0.8, 0.3, np.nan]], network=[0.5, 0.1, 0.4])
    np.testing.assert_allclose(np.exp(believe_faces(experts, WEIGHTS).log)[:, 2], 0.4, atol=0.01)
    forbidden = line([[0.8, 0.3, np.nan]], network=[0.6, 0.4, 0.0])
    assert (together(forbidden)[:, 2] == 0.0).all()
    assert (together(forbidden).sum(axis=1) <= 1.0 + 1e-9).all()


def test_depths_count_up_to_a_limit_and_only_of_a_font_that_the_line_is_in() -> None:
    experts = line([[0.8, 0.75, 0.3]], named=(True,))
    depths = np.full((PLACES, 3), np.nan)
    depths[1, :2] = -2.0, 0.0
    depths[2, :2] = -200.0, 0.0
    felt = replace(experts, depths=depths, depth_face=np.array([True]))
    before, after = together(experts), together(felt)
    np.testing.assert_allclose(after[[0, 3]], before[[0, 3]], atol=1e-9)
    odds = [np.log(rows[:, 0] / rows[:, 1]) for rows in (before, after)]
    assert odds[0][1] > odds[1][1] > odds[1][2]
    assert odds[0][2] - odds[1][2] == pytest.approx(-WEIGHTS.depths * np.log(WEIGHTS.filled), abs=0.1)
    elsewhere = line([[0.2, 0.1, 0.1]], named=(True,))
    felt = replace(elsewhere, depths=depths, depth_face=np.array([True]))
    np.testing.assert_allclose(together(felt), together(elsewhere), atol=0.02)


def test_lines_may_be_combined_at_once() -> None:
    lines = [
        line([[0.8, 0.5, 0.3], [0.2, 0.6, 0.7]]),
        line([[0.3, 0.5, np.nan], [0.6, 0.2, 0.1]], network=[0.2, 0.5, 0.3]),
    ]
    stacked = LineExperts(
        *(np.stack([getattr(one, f.name) for one in lines]) for f in fields(LineExperts)[:3])
    )
    np.testing.assert_allclose(together(stacked), [together(one) for one in lines])
