"""Characters laid on a felt line by least squares: poses are found, and doubtful places are judged by depths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs import stamp
from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from recognition.glyph_match.depth_glyphs import depth_glyph
from recognition.glyph_match.felt_line import POSE_SD_REFINED, ZERO_POSE, FeltLine
from recognition.glyph_match.laid_line import depth_likelihoods
from recognition.glyph_match.pose import DEEP, DOWN, PIXELS, RIGHT, TALL, TURN, WIDE, Glyph, PlaceSamples
from recognition.glyph_match.predicted import CANONICAL_HEIGHT_MM, predict_templates, template_key
from recognition.language.lattice import Lattice
from recognition.language.remainders import ALPHANUMERIC
from recognition.see.text_line import TextLine
from recognition.see.view import HEIGHTS, felt_view, relief_of
from tests.support.felt import felt, stamped_line
from whisker_array.estimation.edges import edge_map
from whisker_array.whisker.touch import Touch

TEXT = "QB50R3X8"
SHORT = st.floats(-0.08, 0.08)


@pytest.fixture(scope="module")
def gothic() -> Font:
    return load_font("gothic")


@pytest.fixture(scope="module")
def glyph(gothic: Font) -> Glyph:
    return depth_glyph(gothic, "R")


@pytest.mark.parametrize("name", BUILTIN_FONTS)
def test_depths_of_a_die_are_those_that_a_whisker_feels(name: str, touch: Touch) -> None:
    font = load_font(name)
    set_ = predict_templates(font, "R8", template_key(font, touch, height_mm=5.0))
    for char, (x, y) in zip(set_.chars, set_.middles_mm, strict=True):
        want = depth_glyph(font, char)[..., 0]
        v, u = (np.indices(want.shape) - [[[want.shape[0] // 2]], [[want.shape[1] // 2]]]) * (
            CANONICAL_HEIGHT_MM / PIXELS
        )
        felt_there = -set_.view.sample(np.stack([x + u, y + v], axis=-1), 0.0)[HEIGHTS]
        near = np.abs(u) < 0.45 * CANONICAL_HEIGHT_MM
        assert np.corrcoef(want[near], felt_there[near])[0, 1] > 0.96


def pose(*, right: float = 0.0, down: float = 0.0, size: float = 0.0) -> np.ndarray:
    """A pose of usual depth on level land."""
    moved = ZERO_POSE.copy()
    moved[[RIGHT, DOWN, WIDE, TALL]] = right, down, size, size
    return moved


def samples_of(glyph: Glyph, at: np.ndarray, *, noise: float = 0.0, seed: int = 0) -> PlaceSamples:
    """A place at which a character was struck in a pose, ten times as deep as the noise."""
    down, right = (np.mgrid[-17:18, -14:15] / PIXELS).reshape(2, -1)
    bare = PlaceSamples(right, down, np.zeros(right.size), usual=10.0)
    rng = np.random.default_rng(seed)
    return PlaceSamples(right, down, bare.residuals(glyph, at) + noise * rng.normal(size=right.size), 10.0)


@settings(max_examples=20)
@given(right=SHORT, down=SHORT, size=SHORT, turn=SHORT, deep=st.floats(-0.4, 0.3), seed=st.integers(0, 99))
def test_a_pose_is_found_again_and_other_characters_fit_worse(
    gothic: Font, right: float, down: float, size: float, turn: float, deep: float, seed: int
) -> None:
    glyphs = {char: depth_glyph(gothic, char) for char in "RPBK"}
    struck = pose(right=right, down=down, size=size)
    struck[[TURN, DEEP]] = turn, deep
    place = samples_of(glyphs["R"], struck, noise=1.0, seed=seed)
    # correlation finds a character's place to a pixel, and the fit begins there
    start = pose(right=right + 0.02, down=down - 0.02)
    log_likelihood, fitted = place.fit(glyphs["R"], ZERO_POSE, POSE_SD_REFINED, start)
    np.testing.assert_allclose(fitted[[RIGHT, 1, TURN, WIDE, TALL, DEEP]], struck[: DEEP + 1], atol=0.05)
    assert all(
        place.fit(glyphs[other], ZERO_POSE, POSE_SD_REFINED, start)[0] < log_likelihood for other in "PBK"
    )


@given(right=SHORT, size=SHORT, turn=SHORT, number=st.integers(0, 8))
def test_slopes_are_those_of_the_residuals(
    glyph: Glyph, right: float, size: float, turn: float, number: int
) -> None:
    place, at, step = samples_of(glyph, ZERO_POSE), pose(right=right, size=size), 0.01
    at[TURN] = turn
    move = step * (np.arange(at.size) == number)
    differences = (place.residuals(glyph, at + move) - place.residuals(glyph, at - move)) / (2.0 * step)
    slopes = place.slopes(glyph, at)[:, number]
    # the edges of a character are steep, and differences run over more than a pixel of them
    assert slopes @ differences > 0.9 * np.linalg.norm(slopes) * np.linalg.norm(differences) > 0.0
    assert np.linalg.norm(slopes) == pytest.approx(np.linalg.norm(differences), rel=0.3)


def test_what_lies_far_off_costs_only_so_much(glyph: Glyph) -> None:
    place = samples_of(glyph, ZERO_POSE)
    cost, share, bend = place.loss(np.array([0.0, 4.0, 1e4, 1e6]))
    assert cost[0] < cost[1] < cost[2] == cost[3]
    assert share[0] * place.alike > 0.9
    assert share[2] == 0.0
    np.testing.assert_allclose(bend[[0, 2, 3]], 0.0, atol=0.01)


def doubt(text: str, place: int, rival: str, *, belief: float = 0.7) -> Lattice:
    """A text that is sure but at one place, where its character is less likely than a rival."""
    even = (1.0 - 0.999) / (len(ALPHANUMERIC) - 1)
    share = np.full((len(text), len(ALPHANUMERIC)), even)
    for k, char in enumerate(text):
        share[k, ALPHANUMERIC.index(char)] = 0.999
    share[place, [ALPHANUMERIC.index(c) for c in (text[place], rival)]] = 0.998 - belief, belief
    return Lattice(tuple(ALPHANUMERIC), np.log(share))


@pytest.fixture(scope="module")
def dirty(touch: Touch) -> FeltLine:
    part = stamp(TEXT, fonts="gothic", height_mm=5.0, pitch_mm=5.0 / 60, seed=3, dirt=0.3)
    edges = edge_map(scan := felt(part.height_map, touch=touch, soil=part.soil))
    return FeltLine(felt_view(edges, relief_of(scan, edges), touch), *stamped_line(part.stamped))


@pytest.mark.parametrize(("place", "rival"), [(0, "O"), (1, "8"), (2, "6"), (4, "P"), (5, "8"), (7, "3")])
def test_depths_tell_a_character_from_its_rival(
    place: int, rival: str, dirty: FeltLine, gothic: Font
) -> None:
    before = doubt(TEXT, place, rival)
    assert before.text != TEXT
    log = depth_likelihoods(before, dirty, gothic)
    assert np.isnan(np.delete(log, place, axis=0)).all()
    own, other = (log[place, before.chars.index(char)] for char in (TEXT[place], rival))
    assert own > other + 1.0
    assert np.isfinite(log[place]).sum() == 2


def test_nothing_is_compared_where_all_is_sure_or_nothing_was_felt(dirty: FeltLine, gothic: Font) -> None:
    line, length = dirty.line, np.array([dirty.line.length_mm, 0.0])
    assert depth_likelihoods(doubt(TEXT, 0, "O", belief=1e-6), dirty, gothic) is None
    far = TextLine(line.centre_mm + 3.0 * length, line.height_mm)
    assert depth_likelihoods(doubt(TEXT, 4, "P"), replace(dirty, line=far), gothic) is None
