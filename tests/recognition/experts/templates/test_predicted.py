"""Predicted templates against ideal glyphs scanned one by one, and what a set may share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.die import default_depth_mm, default_die, ideal_relief
from glyphs.surface.maps import TraceDirection
from recognition.experts.templates.frames import channels
from recognition.experts.templates.predicted import (
    CANONICAL_HEIGHT_MM,
    PIXELS,
    TemplateCache,
    TemplateKey,
    TemplateSet,
    predict_templates,
    rounded,
    template_key,
)
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.whisker.array import ALL_DIRECTIONS, RasterPlan, WhiskerArray
from whisker_array.whisker.touch import Touch, default_touch


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def key_of(font: Font, touch: Touch, height_mm: float = 5.0, **options: float) -> TemplateKey:
    return template_key(font, touch, ALL_DIRECTIONS, height_mm=height_mm, **options)


def by_hand(font: Font, char: str, key: TemplateKey, like: np.ndarray, *, height_mm: float) -> np.ndarray:
    """One ideal character on a plate of its own, of any height, scanned; (directions, rows, cols)."""
    scale = height_mm / CANONICAL_HEIGHT_MM
    pitch = height_mm / PIXELS
    half_rows, half_cols = like.shape[1] // 2, like.shape[2] // 2
    die = default_die(height_mm, font=font, depth_mm=key.die.depth_mm * scale)
    assert die.stroke_mm == pytest.approx(key.die.stroke_mm * scale)
    die = replace(
        die,
        edge_radius_mm=key.die.edge_radius_mm * scale,
        root_radius_mm=key.die.root_radius_mm * scale,
    )
    ideal = ideal_relief(
        font.glyph(char), die, height_mm=height_mm, pitch_mm=pitch / 2, margin_mm=height_mm, raised=key.raised
    )
    x, y = ideal.centre_mm
    reach_x, reach_y = half_cols * pitch, half_rows * pitch
    touch = key.touch()
    plan = RasterPlan(
        array=WhiskerArray(n_whiskers=1, pitch_mm=pitch),
        region_mm=(x - reach_x, y - reach_y, x + reach_x, y + reach_y),
        line_pitch_mm=pitch,
        sample_pitch_mm=pitch / 2,
        directions=key.directions,
        lead_mm=0.2 * height_mm,
        air_samples=0,
    )
    scaled = replace(touch, preload_mm=touch.preload_mm * scale, tip_radius_mm=touch.tip_radius_mm * scale)
    return edge_map(trace_scan(ideal.height_map, touch=scaled, plan=plan), ideal=True).enhancement


@pytest.mark.parametrize("raised", [False, True])
@pytest.mark.parametrize("height_mm", [5.0, 2.5, 10.0])
def test_a_template_is_the_ideal_glyph_scanned(
    height_mm: float, raised: bool, gothic: Font, touch: Touch
) -> None:
    key = key_of(gothic, touch, raised=raised)
    made = predict_templates(gothic, "K1", key)
    for char, patch in zip("K1", made.patches, strict=True):
        alone = by_hand(gothic, char, key, patch, height_mm=height_mm)
        assert alone.shape == patch.shape
        assert np.abs(patch).max() > 0.1
        # enhancement; float32 heights over half a pixel make slopes uncertain by 1e-5, and the tip's
        # lag on the land differs with the length of the run-in
        np.testing.assert_allclose(alone, patch, atol=2e-3)


@pytest.mark.parametrize("height_mm", [2.5, 10.0])
def test_touch_is_free_of_scale(height_mm: float, gothic: Font, touch: Touch, templates: TemplateSet) -> None:
    key = key_of(gothic, default_touch(height_mm), height_mm)
    canonical = key_of(gothic, touch)
    # marks of other heights are a little deeper or shallower for their height, by the table of depths
    assert replace(key, die=canonical.die) == canonical
    ratio = default_depth_mm(height_mm) / height_mm / (default_depth_mm(5.0) / 5.0)
    assert key.die.depth_mm / canonical.die.depth_mm == pytest.approx(ratio, rel=0.11)
    other = predict_templates(gothic, "".join(templates.chars), key)
    for mine, theirs in zip(templates.patches, other.patches, strict=True):
        assert correlation(mine, theirs) > 0.99


def test_patches_are_odd_and_the_glyph_is_in_the_middle(templates: TemplateSet) -> None:
    _, directions, rows, cols = templates.patches.shape
    assert directions == 4
    assert rows % 2 == cols % 2 == 1
    for char, patch, half in zip(templates.chars, templates.patches, templates.half_width, strict=True):
        profile = channels(patch, ALL_DIRECTIONS)[0]
        inked = np.flatnonzero(np.abs(profile).max(axis=0) > 0.25 * np.abs(profile).max())
        # a pixel, and half a bevel
        assert 0.5 * (inked[0] + inked[-1]) == pytest.approx(cols // 2, abs=1.5), char
        assert 0.5 * (inked[-1] - inked[0]) == pytest.approx(half * PIXELS, abs=2.5), char
        across = np.flatnonzero(np.abs(profile).max(axis=1) > 0.25 * np.abs(profile).max())
        assert across[-1] - across[0] == pytest.approx(PIXELS, abs=3.0), char


def test_raised_marks_are_nearly_but_not_simply_the_negative(
    gothic: Font, touch: Touch, templates: TemplateSet
) -> None:
    raised = predict_templates(gothic, "".join(templates.chars), key_of(gothic, touch, raised=True))
    for sunk, up in zip(templates.patches, raised.patches, strict=True):
        assert correlation(channels(sunk, ALL_DIRECTIONS), channels(up, ALL_DIRECTIONS)) < -0.9
        assert np.abs(sunk + up).max() > 0.02


@pytest.mark.parametrize("angle", [-8.0, 5.0])
def test_a_rotated_set_turned_back_is_the_straight_one(
    angle: float, gothic: Font, touch: Touch, templates: TemplateSet
) -> None:
    turned = predict_templates(gothic, "".join(templates.chars), key_of(gothic, touch, rotation_deg=angle))
    assert turned.patches.shape[2] % 2 == turned.patches.shape[3] % 2 == 1
    for t in range(len(templates.chars)):
        cut = []
        for patch in (templates.patches[t], turned.patches[t]):
            rows, cols = (n // 2 for n in patch.shape[1:])
            half_rows, half_cols = int(0.55 * PIXELS), int(templates.half_width[t] * PIXELS)
            cut.append(
                patch[:, rows - half_rows : rows + half_rows + 1, cols - half_cols : cols + half_cols + 1]
            )
        # walls answer a little otherwise when traced at an angle, and turning interpolates
        assert correlation(*cut) > 0.95


def test_only_the_directions_asked_for_are_felt(gothic: Font, touch: Touch, templates: TemplateSet) -> None:
    some = (TraceDirection.FORWARD_Y, TraceDirection.FORWARD_X)
    made = predict_templates(gothic, "K", template_key(gothic, touch, some, height_mm=5.0))
    # near the cell's rim the neighbour is felt, here another one
    rows, cols = made.patches.shape[2:]
    r, c = (templates.patches.shape[2] - rows) // 2, (templates.patches.shape[3] - cols) // 2
    same = templates.patches[0][[1, 0], r : r + rows, c : c + cols]
    np.testing.assert_allclose(made.patches[0], same, atol=2e-3)


def test_near_equal_parts_share_a_set_and_other_touches_do_not(gothic: Font, touch: Touch) -> None:
    cache = TemplateCache()
    first = cache.get(gothic, "1", key_of(gothic, touch))
    assert cache.get(gothic, "1", key_of(gothic, touch, 5.02)) is first
    assert cache.get(gothic, "1", key_of(gothic, touch, 5.0, rotation_deg=0.5)) is first
    slippery = replace(touch, friction=0.1)
    assert cache.get(gothic, "1", key_of(gothic, slippery)) is not first
    assert cache.get(gothic, "7", key_of(gothic, touch)) is not first
    assert cache.get(load_font("futural"), "1", key_of(gothic, touch)) is not first


def test_the_cache_forgets_what_was_used_longest_ago(gothic: Font, touch: Touch) -> None:
    cache = TemplateCache(keep=2)
    one, two = (cache.get(gothic, c, key_of(gothic, touch)) for c in "1I")
    assert cache.get(gothic, "1", key_of(gothic, touch)) is one
    cache.get(gothic, "L", key_of(gothic, touch))
    assert cache.get(gothic, "1", key_of(gothic, touch)) is one
    assert cache.get(gothic, "I", key_of(gothic, touch)) is not two


@pytest.mark.parametrize("step", [0.1, 0.2])
def test_rounding_is_to_a_geometric_ladder(step: float) -> None:
    rng = np.random.default_rng(0)
    for value in np.exp(rng.uniform(-5.0, 5.0, 50)):
        near = rounded(value, step)
        assert abs(np.log(near / value)) <= 0.5 * np.log1p(step) + 1e-12
        assert rounded(near, step) == pytest.approx(near, rel=1e-12)


def test_the_cache_forgets_the_longest_unused_where_their_arrays_grow_too_large() -> None:
    font, touch = load_font("gothic"), default_touch(5.0)
    keys = [key_of(font, touch, rotation_deg=5.0 * k) for k in range(4)]
    cache = TemplateCache(most_bytes=10_000_000)
    first = cache.get(font, "AB", keys[0])
    second = cache.get(font, "AB", keys[1])
    assert cache.get(font, "AB", keys[0]) is first
    # what matching derives counts as well
    second.work["derived"] = ("of it", [np.zeros(20_000_000, dtype=np.uint8)])
    cache.get(font, "AB", keys[2])
    assert cache.get(font, "AB", keys[0]) is first
    assert cache.get(font, "AB", keys[1]) is not second
