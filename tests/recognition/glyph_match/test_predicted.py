"""Predicted templates against ideal glyphs scanned one by one, and predictions that are kept on disk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from glyphs.camera.shading import Light
from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.die import ideal_relief
from glyphs.stamping.faces import default_depth_mm, default_die
from recognition.glyph_match import kept_predictions
from recognition.glyph_match.face_library import face_library
from recognition.glyph_match.kept_predictions import Arrays, load_or_predict
from recognition.glyph_match.predicted import (
    CANONICAL_HEIGHT_MM,
    PIXELS,
    TemplateKey,
    TemplateSet,
    ideal_plate,
    line_of,
    lit_views,
    predict_templates,
    round_to_ladder,
    template_key,
)
from recognition.glyph_match.prototypes import felt_prototypes, lit_prototypes
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS
from recognition.see.view import DIRECTIONS, GREY, HEIGHTS, View, ViewKind
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import Touch, default_touch

# --------------------------------------------------------------------------------------------------------- predicted


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def key_of(font: Font, touch: Touch, height_mm: float = 5.0, **options: float) -> TemplateKey:
    return template_key(font, touch, height_mm=height_mm, **options)


def by_hand(font: Font, char: str, key: TemplateKey, like: np.ndarray, *, height_mm: float) -> np.ndarray:
    """One ideal character on a plate of its own, of any height, scanned; (directions, rows, cols)."""
    scale = height_mm / CANONICAL_HEIGHT_MM
    pitch = height_mm / PIXELS
    half_rows, half_cols = like.shape[1] // 2, like.shape[2] // 2
    die = default_die(height_mm, font=font, depth_mm=key.die.depth_mm * scale)
    assert die.stroke_mm == pytest.approx(key.die.stroke_mm * scale)
    die = replace(
        die, edge_radius_mm=key.die.edge_radius_mm * scale, root_radius_mm=key.die.root_radius_mm * scale
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
        directions=DIRECTIONS,
        lead_mm=0.2 * height_mm,
        air_samples=0,
    )
    scaled = replace(touch, preload_mm=touch.preload_mm * scale, tip_radius_mm=touch.tip_radius_mm * scale)
    return edge_map(trace_scan(ideal.height_map, touch=scaled, plan=plan), ideal=True).enhancement


@pytest.mark.parametrize(("height_mm", "raised"), [(2.5, True), (10.0, False)])
def test_a_template_is_the_ideal_glyph_scanned(
    height_mm: float, raised: bool, gothic: Font, touch: Touch
) -> None:
    key = key_of(gothic, touch, raised=raised)
    templates = predict_templates(gothic, "K1", key)
    for char, patch in zip("K1", templates.patches, strict=True):
        alone = by_hand(gothic, char, key, patch, height_mm=height_mm)
        assert alone.shape == patch.shape
        assert np.abs(patch).max() > 0.1
        # enhancement; float32 heights over half a pixel make slopes uncertain by 1e-5, and the tip's
        # lag on the land differs with the length of the run-in
        np.testing.assert_allclose(alone, patch, atol=2e-3)


@pytest.mark.parametrize("height_mm", [2.5, 10.0])
def test_touch_is_free_of_scale(height_mm: float, gothic: Font, touch: Touch, templates: TemplateSet) -> None:
    scaled = default_whisker(height_mm, gauge_room_mm=0.0)  # with room for its gauge in proportion, too
    key = key_of(gothic, default_touch(height_mm).with_whisker(scaled), height_mm)
    canonical = key_of(gothic, touch)
    # marks of other heights are a little deeper or shallower for their height, by the table of depths
    assert replace(key, die=canonical.die) == canonical
    ratio = default_depth_mm(height_mm) / height_mm / (default_depth_mm(5.0) / 5.0)
    assert key.die.depth_mm / canonical.die.depth_mm == pytest.approx(ratio, rel=0.11)
    other = predict_templates(gothic, "".join(templates.chars), key)
    for mine, theirs in zip(templates.patches, other.patches, strict=True):
        assert correlation(mine, theirs) > 0.99


def test_the_plate_that_is_felt_is_that_of_the_patches(templates: TemplateSet) -> None:
    """Its strip has every character where `middles_mm` says, with edges and heights."""
    line = line_of(templates.middles_mm)
    strip = templates.view.strip(line)
    assert templates.view.kind is ViewKind.FELT
    along = np.linalg.norm(templates.middles_mm - line.centre_mm[0], axis=1) / line.height_mm
    ink = strip[HEIGHTS] < 0.5 * strip[HEIGHTS].min()
    for column, half in zip((along + MARGIN) * HEIGHT_ROWS - 0.5, templates.half_width, strict=True):
        near = slice(round(column - 0.6 * HEIGHT_ROWS), round(column + 0.6 * HEIGHT_ROWS) + 1)
        across, down = (np.flatnonzero(ink[:, near].any(axis=k)) for k in (0, 1))
        assert near.start + 0.5 * (across[0] + across[-1]) == pytest.approx(column, abs=1.0)
        # at half of the depth; walls of 45 degrees
        assert across[-1] - across[0] == pytest.approx(2.0 * half * HEIGHT_ROWS, abs=3.0)
        assert 0.5 * (down[0] + down[-1]) == pytest.approx((ROWS - 1) / 2, abs=1.0)


def test_a_lit_plate_is_bright_where_it_faces_the_lamp(gothic: Font) -> None:
    plate = ideal_plate(gothic, "I", default_die(CANONICAL_HEIGHT_MM, font=gothic))
    left, right = (
        view.layers[GREY] for view in lit_views(plate, (Light(azimuth_deg=180.0), Light(azimuth_deg=0.0)))
    )
    middle, half = plate.surface.shape[0] // 2, plate.surface.shape[1] // 2
    rows = slice(middle - 20, middle + 20)
    # the walls of a sunk stroke: the one beyond it faces the lamp
    walls = [(grey[rows, half:].max() - grey[rows, :half].max()) for grey in (left, right)]
    assert walls[0] > 0.02
    assert walls[1] < -0.02
    assert left.mean() == pytest.approx(0.2 ** (1.0 / 2.2), abs=0.05)


def test_near_equal_parts_share_a_set_and_other_touches_do_not(gothic: Font, touch: Touch) -> None:
    assert key_of(gothic, touch, 5.02) == key_of(gothic, touch)
    assert key_of(gothic, replace(touch, friction=0.1)) != key_of(gothic, touch)


@pytest.mark.parametrize("step", [0.1, 0.2])
def test_rounding_is_to_a_geometric_ladder(step: float) -> None:
    rng = np.random.default_rng(0)
    for value in np.exp(rng.uniform(-5.0, 5.0, 50)):
        near = round_to_ladder(value, step)
        assert abs(np.log(near / value)) <= 0.5 * np.log1p(step) + 1e-12
        assert round_to_ladder(near, step) == pytest.approx(near, rel=1e-12)


# -------------------------------------------------------------------------------------------------- kept predictions


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    monkeypatch.setattr(kept_predictions, "folder_of", lambda function: tmp_path)
    yield tmp_path
    tmp_path.chmod(0o700)


def make() -> Arrays:
    return {"values": np.arange(5.0)}


def never() -> Arrays:
    raise AssertionError("made a second time")


def same(one: object, other: object) -> bool:
    pairs = [
        (getattr(one, f.name), getattr(other, f.name)) for f in fields(one) if f.name not in ("work", "touch")
    ]  # type: ignore[arg-type]
    return all(same(a, b) if isinstance(a, View) else np.array_equal(a, b) for a, b in pairs if a is not None)


@pytest.mark.usefixtures("folder")
def test_what_was_made_is_found_again_and_other_things_are_not() -> None:
    load_or_predict(("one", 2, (3.0, np.zeros(2))), make)
    assert np.array_equal(load_or_predict(("one", 2, (3.0, np.zeros(2))), never)["values"], np.arange(5.0))
    for other in (
        ("one", 2, (3.0, np.zeros(3))),
        ("one", 2.0, (3.0, np.zeros(2))),
        ("one", 2, 3.0, np.zeros(2)),
    ):
        with pytest.raises(AssertionError, match="second time"):
            load_or_predict(other, never)


@pytest.mark.parametrize("damage", [b"", b"nothing", None])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes | None) -> None:
    load_or_predict(("one",), make)
    (path,) = folder.glob("*.npz")
    content = path.read_bytes()
    path.write_bytes(content[:60] + b"\xff" * 40 + content[100:] if damage is None else damage)
    assert np.array_equal(load_or_predict(("one",), make)["values"], np.arange(5.0))
    assert np.array_equal(load_or_predict(("one",), never)["values"], np.arange(5.0))


def test_without_a_folder_everything_is_made_each_time(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    for nowhere in (None, folder / "missing"):
        monkeypatch.setattr(kept_predictions, "folder_of", lambda function, nowhere=nowhere: nowhere)
        assert np.array_equal(load_or_predict(("one",), make)["values"], np.arange(5.0))
        with pytest.raises(AssertionError, match="second time"):
            load_or_predict(("one",), never)


def test_what_was_used_longest_ago_is_removed(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setattr(kept_predictions, "MOST_BYTES", 1_000)  # room for three
    for k in range(6):
        load_or_predict((k,), make)
        load_or_predict((0,), make)
    load_or_predict((0,), never)
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 1_000


def test_predictions_from_the_disk_are_those_that_were_made(folder: Path) -> None:
    font, touch = load_font("gothic"), default_touch(5.0)

    def predict() -> tuple[object, ...]:
        templates = predict_templates(font, "K7", template_key(font, touch, height_mm=5.0))
        felt, lit = (face_library(sense).map for sense in ("tactile", "vision"))
        return (
            templates,
            templates.view,
            felt_prototypes(templates, felt, ""),
            lit_prototypes(font, "K7", lit),
        )

    made, files = predict(), set(folder.iterdir())
    found = predict()
    assert set(folder.iterdir()) == files
    assert all(same(one, other) for one, other in zip(made, found, strict=True))
