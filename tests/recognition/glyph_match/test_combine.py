"""Recogniser, faces and depths together, on lines put together by hand."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from recognition.glyph_match.combine import (
    ExpertWeights,
    LineExperts,
    believe_faces,
    combine_experts,
    fitted_weights,
)

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


@pytest.mark.parametrize("sense", ["tactile", "vision"])
def test_the_fitted_weights_let_everyone_speak(sense: str) -> None:
    weights = fitted_weights(sense)
    assert 0.0 < weights.covered < 1.0
    assert 0.0 < weights.together <= 1.0
    assert min(weights.network, weights.sharpness) > 0.0
