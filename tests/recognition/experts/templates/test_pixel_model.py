"""What a pixel says, against the mixture of its docstring written out with scipy.stats."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from recognition.experts.templates.pixel_model import (
    BRIM_CLEAN,
    BRIM_COVERED,
    DEBRIS,
    DEBRIS_SPREAD,
    DEBRIS_UP,
    EDGE_FLOOR,
    EDGE_SPREAD,
    FELT_REACH,
    FILLED_CLEAN,
    FILLED_COVERED,
    N_FELT,
    N_LEVELS,
    N_PREDICTED,
    RELATIVE_SPREAD,
    WALL_SPREAD,
    PixelModel,
    pixel_model,
)

PROFILE, EDGE = 0, 1
REACH = np.array([0.5, 0.3])
NOISE = 0.05 * REACH
"""As `model` has it unless told otherwise."""
FLOAT32 = 1e-4
"""Of a ratio of about 10 kept in single precision, and of the quadrature."""
PLAUSIBLE = 1.5
"""Largest predictions within which marks are felt: beyond, chips are so rare that their share bounds little."""


@cache
def model(share: float = 0.05, *, raised: bool = False) -> PixelModel:
    """Of a profile and an edge, with noise as a share of what is predicted."""
    return pixel_model(noise=share * REACH, reach=REACH, profile=np.array([True, False]), raised=raised)


def said(made: PixelModel, channel: int, felt: float, predicted: float, cover: float = 0.0) -> float:
    """The ratio through the look-up, as the dense sum takes it."""
    e = np.zeros((2, 1, 1), np.float32)
    e[channel] = felt
    at = (np.float32(predicted) / REACH[channel] + 1.0) * 0.5 * (N_PREDICTED - 1)
    column = int(np.clip(np.rint(at), 0, N_PREDICTED - 1))
    row = made.felt_index(e, np.full((1, 1), cover, np.float32))[channel, 0, 0]
    return float(made.table.ravel()[row + column])


def shares(cover: float) -> tuple[float, float, float, float]:
    """Of clean, filled to the brim, partly filled, and debris: they are all that may happen."""
    filled = FILLED_CLEAN + cover * (FILLED_COVERED - FILLED_CLEAN)
    brim = BRIM_CLEAN + cover * (BRIM_COVERED - BRIM_CLEAN)
    return (1 - filled) * (1 - DEBRIS), filled * brim, filled * (1 - brim), (1 - filled) * DEBRIS


def density(e: float, t: float, cover: float, channel: int, noise: float, *, raised: bool = False) -> float:
    """p(e | t) from the parts of the mixture."""
    reach = float(REACH[channel])
    deep = abs(t) / reach
    if channel == PROFILE:
        misfit = math.hypot(RELATIVE_SPREAD * t, WALL_SPREAD * reach * 4 * deep * (1 - deep))
        chips_up = e >= 0 if not raised else e < 0
        side = 2 * (DEBRIS_UP if chips_up else 1 - DEBRIS_UP)
    else:
        misfit, side = math.hypot(EDGE_SPREAD * t, EDGE_FLOOR * reach), 1.0
    land = stats.norm(0.0, noise).pdf(e)
    level = land
    if abs(t) >= noise:
        # filled to a level that is anywhere between 0 and t, felt with noise
        anywhere = stats.uniform(min(t, 0.0), abs(t))
        level = integrate.quad(
            lambda x: anywhere.pdf(x) * stats.norm(x, noise).pdf(e),
            min(t, 0),
            max(t, 0),
            points=[e],
            limit=200,
        )[0]
    debris = side * stats.norm(0.0, DEBRIS_SPREAD * reach).pdf(e)
    clean = stats.norm(t, math.hypot(noise, misfit)).pdf(e)
    return float(np.dot(shares(cover), [clean, land, level, debris]))


def expected(e: float, t: float, cover: float, channel: int, **options: bool) -> float:
    noise = float(NOISE[channel])
    of_ink = density(e, t, cover, channel, noise, **options)
    return math.log(of_ink / density(e, 0.0, cover, channel, noise, **options))


def felt_nodes(channel: int) -> np.ndarray:
    return np.linspace(-FELT_REACH, FELT_REACH, N_FELT) * REACH[channel]


def predicted_nodes(channel: int) -> np.ndarray:
    return np.linspace(-1.0, 1.0, N_PREDICTED) * REACH[channel]


@pytest.mark.parametrize("raised", [False, True])
@pytest.mark.parametrize("channel", [PROFILE, EDGE])
def test_the_look_up_is_the_mixture_at_the_nearest_node(channel: int, raised: bool) -> None:
    made = model(raised=raised)
    rng = np.random.default_rng(7)
    reach = float(REACH[channel])
    for _ in range(40):
        e, t = rng.uniform(-2.2, 2.2) * reach, rng.uniform(-1, 1) * reach
        cover = rng.uniform()
        near_e = float(felt_nodes(channel)[np.abs(felt_nodes(channel) - e).argmin()])
        near_t = float(predicted_nodes(channel)[np.abs(predicted_nodes(channel) - t).argmin()])
        # the nodes are what is quantised: half a step of each at most
        assert abs(near_e - e) <= (0.5 + 1e-6) * 2 * FELT_REACH * reach / (N_FELT - 1)
        assert abs(near_t - t) <= (0.5 + 1e-6) * 2 * reach / (N_PREDICTED - 1)
        near_cover = round(cover * (N_LEVELS - 1)) / (N_LEVELS - 1)
        if abs(near_e) < 1e-9:
            continue  # neither above nor below: the density steps there
        direct = expected(near_e, near_t, near_cover, channel, raised=raised)
        assert said(made, channel, e, t, cover) == pytest.approx(direct, abs=FLOAT32, rel=FLOAT32)


def test_the_shares_are_all_that_may_happen() -> None:
    for cover in (0.0, 0.3, 1.0):
        assert sum(shares(cover)) == pytest.approx(1.0)


@settings(deadline=None, max_examples=20)
@given(st.floats(0.03, 0.3), st.floats(0.01, 3.0), st.booleans(), st.booleans(), st.integers(0, N_LEVELS - 1))
def test_no_pixel_overrules_all_others(
    noise: float, reach: float, profile: bool, raised: bool, level: int
) -> None:
    made = pixel_model(
        noise=np.array([noise * reach]), reach=np.array([reach]), profile=np.array([profile]), raised=raised
    )
    table = made.table[0, level].astype(np.float64)
    assert np.isfinite(table).all()
    # nothing is predicted: nothing is said
    assert (table[:, N_PREDICTED // 2] == 0.0).all()
    clean, brim, level_share, debris = shares(level / (N_LEVELS - 1))
    plausible = np.abs(np.linspace(-FELT_REACH, FELT_REACH, N_FELT)) <= PLAUSIBLE
    if profile:
        # missing ink may be filled, ink where there is none may be a chip: each part of p(e|0) stands in p(e|t)
        assert table.min() >= math.log(brim / (1.0 - debris)) - FLOAT32
    sharpest = 1.0 / math.sqrt(2 * math.pi) / noise
    rarest = 2 * (1 - DEBRIS_UP) if profile else 1.0
    chip = rarest * stats.norm(0.0, DEBRIS_SPREAD).pdf(PLAUSIBLE)
    most = math.log1p((clean * sharpest + level_share / noise + brim * sharpest) / (debris * chip))
    assert table[plausible].max() <= most


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("channel", [PROFILE, EDGE])
def test_clean_ink_speaks_for_missing_ink_against_and_less_where_covered(channel: int, sign: float) -> None:
    made = model()
    full = sign * float(REACH[channel])
    for cover in np.linspace(0.0, 1.0, N_LEVELS):
        assert said(made, channel, full, full, cover) > 0.5
    missing = [said(made, channel, 0.0, full, cover) for cover in np.linspace(0.0, 1.0, N_LEVELS)]
    assert missing[0] < -1.0
    assert (np.diff(missing) > 0.0).all()
    # what is seen to be covered says hardly anything
    assert -0.8 < missing[-1] < 0.0
    # the wrong sign speaks for nobody
    assert said(made, channel, -full, full) <= 0.1


def test_more_of_the_ink_says_more() -> None:
    made = model()
    full = float(-REACH[PROFILE])
    told = [said(made, PROFILE, share * full, full) for share in (0.0, 0.3, 0.6, 1.0)]
    assert (np.diff(told) > 0.0).all()


def test_chips_stand_out_of_sunk_marks_and_lie_between_raised_ones() -> None:
    sunk, raised = model(), model(raised=True)
    # a raised mark is a sunk one seen from below; edges do not know up from down
    np.testing.assert_allclose(raised.table[PROFILE], sunk.table[PROFILE, :, ::-1, ::-1], atol=FLOAT32)
    np.testing.assert_allclose(raised.table[EDGE], sunk.table[EDGE], atol=FLOAT32)
    np.testing.assert_allclose(sunk.table[EDGE], sunk.table[EDGE, :, ::-1, ::-1], atol=FLOAT32)
    full = 0.98 * float(REACH[PROFILE])  # between no two nodes
    # felt high, a sunk plate has a chip, a raised one a stroke: the mark's own sign is the better witness
    assert said(raised, PROFILE, full, full) > said(sunk, PROFILE, full, full) + 0.5
    assert said(sunk, PROFILE, -full, -full) == pytest.approx(said(raised, PROFILE, full, full), abs=FLOAT32)


@pytest.mark.parametrize("channel", [PROFILE, EDGE])
def test_without_noise_strokes_have_only_chips_and_levels_to_fear(channel: int) -> None:
    reach = float(REACH[channel])
    k = int(np.abs(felt_nodes(channel) - 0.8 * reach).argmin())
    e = float(felt_nodes(channel)[k])
    clean, _, level_share, debris = shares(0.0)
    side = 2 * DEBRIS_UP if channel == PROFILE else 1.0
    chip = side * stats.norm(0.0, DEBRIS_SPREAD * reach).pdf(e)
    spread = math.hypot(RELATIVE_SPREAD, 0.0) if channel == PROFILE else math.hypot(EDGE_SPREAD, EDGE_FLOOR)
    ink = clean * stats.norm(reach, spread * reach).pdf(e) + level_share / reach + debris * chip
    nothing = debris * chip
    if channel == EDGE:
        nothing += clean * stats.norm(0.0, EDGE_FLOOR * reach).pdf(e)
    limit = math.log(ink / nothing)
    off = [abs(said(model(share), channel, e, reach) - limit) for share in (0.1, 0.03, 0.01, 0.003, 1e-3)]
    assert off[-1] < 1e-3
    assert off[-1] < 0.1 * off[0]


def test_reaches_beyond_the_table_count_as_its_rim() -> None:
    made = model()
    for channel in (PROFILE, EDGE):
        reach = float(REACH[channel])
        assert said(made, channel, 9 * reach, 4 * reach) == said(made, channel, FELT_REACH * reach, reach)
        assert said(made, channel, -9 * reach, -4 * reach) == said(made, channel, -FELT_REACH * reach, -reach)
