"""Dirt seen as dirt, on surfaces made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.experts.templates.occlusion import covered, robust_spread

PER_HEIGHT = 24
PROFILE = np.array([True, False, False])
REACH = np.array([1.0, 0.4, 0.4])
NOISE = np.array([0.01, 0.02, 0.02])
"""Of a sensor, in each channel: a fiftieth or so of the mark."""
MOSTLY_CLEAN = 0.2
"""Mean cover that a clean surface may be thought to have."""
Patch = tuple[slice, slice]
PATCH: Patch = (slice(10, 34), slice(100, 148))
"""A height by two."""
RIM = 5
"""Pixels: the window that cover is smoothed with reaches so far across a patch's rim."""


def land(seed: int = 3, shape: tuple[int, int] = (48, 240)) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.standard_normal((3, *shape)) * NOISE[:, None, None]).astype(np.float32)


def cover(channels: np.ndarray, *, raised: bool = False) -> np.ndarray:
    found = covered(channels, profile=PROFILE, reach=REACH, raised=raised, pixels_per_height=PER_HEIGHT)
    assert found.shape == channels.shape[1:]
    assert found.dtype == np.float32
    assert found.min() >= 0.0
    assert found.max() <= 1.0
    return found


def inside(found: np.ndarray) -> float:
    (rows, cols) = PATCH
    core = found[rows.start + RIM : rows.stop - RIM, cols.start + RIM : cols.stop - RIM]
    return float(core.mean())


def outside(found: np.ndarray) -> float:
    (rows, cols) = PATCH
    away = np.ones(found.shape, dtype=bool)
    away[rows.start - RIM : rows.stop + RIM, cols.start - RIM : cols.stop + RIM] = False
    return float(found[away].mean())


def rough(channels: np.ndarray, times: float = 4.0) -> np.ndarray:
    """Edges rougher in the patch, as smeared grime has them."""
    out = channels.copy()
    out[(slice(1, 3), *PATCH)] *= times
    return out


def risen(channels: np.ndarray, by: float) -> np.ndarray:
    """A plateau of paint: the profile stands higher, its rim shows as edges."""
    out = channels.copy()
    out[(0, *PATCH)] += by
    return out


@pytest.mark.parametrize("seed", range(4))
def test_clean_land_is_hardly_covered(seed: int) -> None:
    assert cover(land(seed)).mean() < MOSTLY_CLEAN


def test_a_rough_patch_is_covered_and_nothing_else() -> None:
    found = cover(rough(land()))
    assert inside(found) > 0.9
    assert outside(found) < 0.05


def test_the_rougher_the_surer() -> None:
    told = [inside(cover(rough(land(), times))) for times in (1.0, 1.6, 2.4, 4.0)]
    assert (np.diff(told) >= 0.0).all()
    assert told[0] < MOSTLY_CLEAN < 0.9 < told[-1]


def test_a_raised_patch_is_covered_by_the_side_that_dirt_lies_on() -> None:
    assert inside(cover(risen(land(), 0.25))) > 0.9
    assert outside(cover(risen(land(), 0.25))) < 0.05
    # lower than the land is no dirt
    assert inside(cover(risen(land(), -0.25))) < MOSTLY_CLEAN
    # hardly higher is no dirt either
    assert inside(cover(risen(land(), 0.05))) < MOSTLY_CLEAN


def strokes(channels: np.ndarray) -> np.ndarray:
    """Grooves with their edges: two uprights a character."""
    out = channels.copy()
    for c in range(30, 220, 30):
        for at in (c, c + 12):
            out[0, 12:36, at : at + 4] -= 0.9
            out[1, 12:36, at : at + 2] += 0.35
            out[1, 12:36, at + 2 : at + 4] -= 0.35
    return out


def test_strokes_are_no_cover() -> None:
    # the whole of it, strokes and what lies between them
    assert cover(strokes(land())).mean() < MOSTLY_CLEAN


def test_chips_are_no_cover() -> None:
    chipped = land()
    rng = np.random.default_rng(5)
    for _ in range(12):
        r, c = rng.integers(4, 40), rng.integers(4, 230)
        chipped[0, r : r + 3, c : c + 4] += 0.8
        chipped[1:, r : r + 3, c : c + 4] += 0.3
    assert cover(chipped).mean() < MOSTLY_CLEAN


def test_dirt_is_seen_between_strokes() -> None:
    found = cover(rough(strokes(land())))
    assert inside(found) > 0.5
    assert inside(found) > 4 * outside(found)


@pytest.mark.parametrize("times", [0.25, 3.0])
def test_edges_have_no_scale_of_their_own(times: float) -> None:
    plain = rough(strokes(land()))
    louder = plain.copy()
    louder[1:] *= np.float32(times)
    # roughness is told against the land's own; single precision rounds
    np.testing.assert_allclose(cover(louder), cover(plain), atol=1e-4)


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_the_whole_scales_with_what_is_predicted(times: float) -> None:
    plain = risen(rough(strokes(land())), 0.2)
    scaled = covered(
        plain * np.float32(times),
        profile=PROFILE,
        reach=times * REACH,
        raised=False,
        pixels_per_height=PER_HEIGHT,
    )
    np.testing.assert_allclose(scaled, cover(plain), atol=1e-4)


def test_where_nothing_but_marks_is_felt_nothing_is_known() -> None:
    full = np.full((3, 20, 20), 0.9, dtype=np.float32)
    full[:, ::2] *= -1
    assert (cover(full) == 0.0).all()


def test_robust_spread_is_that_of_the_land() -> None:
    channels = land()
    spoilt = channels.copy()
    spoilt[:, :, 100:120] += 0.9
    # the median takes a tenth of marks for a tenth more noise; four standard errors of 11520 samples are 4 %
    np.testing.assert_allclose(robust_spread(channels), NOISE, rtol=0.04)
    np.testing.assert_allclose(robust_spread(spoilt), NOISE, rtol=0.2)
