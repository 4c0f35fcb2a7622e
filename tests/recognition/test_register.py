"""Sight laid over touch, against the camera that took the picture."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.camera.appearance import draw_camera, draw_light, photograph
from glyphs.camera.photo import Photo
from glyphs.camera.pose import mapped
from glyphs.fonts.outlines import load_font
from glyphs.soiling.soiled import SoiledPart, Soiling
from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from pipeline.files.synth import SynthSpec, make_part
from recognition.box import Box
from recognition.lattice import Lattice
from recognition.register import RegisterFailure, Registration, matched_boxes, register, same_field
from recognition.register_line import register_line
from recognition.tactile_line import FeltLine, felt_line
from recognition.vision_edges import vision_edges
from recognition.vision_frame import photo_origin_mm, photo_pitch_mm
from recognition.vision_templates import VisionBasis, predict_basis

HEIGHT_MM = 5.0
EDGES_MM = 0.25
"""Median error by edges alone: half a stroke. Light makes walls bright or dark by their side, which shifts them."""
LINE_MM, LINE_WORST_MM = 0.2, 0.5
"""Median and worst error by characters: a third of a stroke, and less than a stroke."""
CHARS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"


@lru_cache(maxsize=8)
def soiled(severity: float, number: int) -> SoiledPart:
    return make_part(SynthSpec(format="AA9999", seed=4242, soiling=Soiling(severity=severity)), number).soiled


@lru_cache(maxsize=8)
def taken(severity: float, number: int) -> tuple[Photo, NDArray[np.float64]]:
    """A photograph and the homography from its own frame to the plate."""
    part = soiled(severity, number)
    rng = np.random.default_rng([4242, number])
    light, camera = draw_light(rng), draw_camera(rng)
    photo = photograph(part, light, camera, rng=rng)
    return photo, camera.to_plate(part.height_map) @ np.linalg.inv(frame_from_pixel(photo))


def frame_from_pixel(photo: Photo) -> NDArray[np.float64]:
    p, (x0, y0) = photo_pitch_mm(photo), photo_origin_mm(photo)
    return np.array([[p, 0.0, x0], [0.0, p, y0], [0.0, 0.0, 1.0]])


def felt(surface: HeightMap) -> EdgeMap:
    """Edges as an ideal tip of 0.15 mm would feel them: profile and slope, seen from either side."""
    step = 3
    z = ndimage.gaussian_filter(surface.z_mm.astype(np.float64), 0.15 / surface.pitch_mm)[::step, ::step]
    z = z - np.median(z)
    dy, dx = np.gradient(z)
    layers = np.stack([z + dx, z - dx, z + dy, z - dy])
    directions = (
        TraceDirection.FORWARD_X,
        TraceDirection.BACK_X,
        TraceDirection.FORWARD_Y,
        TraceDirection.BACK_Y,
    )
    return EdgeMap(layers, directions, np.ones(z.shape, dtype=np.bool_), surface.pitch_mm * step)


def errors_mm(found: Registration, true: NDArray[np.float64], part: SoiledPart) -> NDArray[np.float64]:
    """At the corners of the characters."""
    b = np.array(part.part.boxes_mm)
    x, y = np.concatenate([b[:, 0], b[:, 2]]), np.concatenate([b[:, 1], b[:, 3]])
    u, v = found.plate(*mapped(np.linalg.inv(true), x, y))
    return np.asarray(np.hypot(u - x, v - y))


@lru_cache(maxsize=1)
def basis() -> VisionBasis:
    return predict_basis(load_font("gothic"), CHARS)


def line_of(part: SoiledPart, text: str | None = None) -> FeltLine:
    text = part.part.text if text is None else text
    log = np.log(np.array([[0.97 if c == t else 0.02 / len(CHARS) for c in CHARS] for t in text]))
    found = felt_line(
        Lattice(tuple(CHARS), log, tuple(Box(*b) for b in part.part.boxes_mm)), basis(), height_mm=HEIGHT_MM
    )
    assert found is not None
    return found


@pytest.mark.parametrize("number", [0, 1])
def test_clean_part_by_edges_alone(number: int) -> None:
    part, (photo, true) = soiled(0.0, number), taken(0.0, number)
    found = register(felt(part.height_map), vision_edges(photo, height_mm=HEIGHT_MM), height_mm=HEIGHT_MM)
    assert found.failure is None
    assert np.median(errors_mm(found, true, part)) < EDGES_MM


def test_without_pitch_or_stage_the_fields_are_the_start() -> None:
    part, (photo, _) = soiled(0.0, 0), taken(0.0, 0)
    bare = Photo(photo.pixels)
    true = taken(0.0, 0)[1] @ frame_from_pixel(photo) @ np.linalg.inv(frame_from_pixel(bare))
    pixels = HEIGHT_MM / (photo.pitch_mm or 1.0)
    found = register(felt(part.height_map), vision_edges(bare, height_mm=pixels), height_mm=HEIGHT_MM)
    assert found.failure is None
    assert np.median(errors_mm(found, true, part)) < EDGES_MM


def test_same_field_lays_middle_on_middle() -> None:
    one = EdgeMap(
        np.zeros((1, 40, 80)), (TraceDirection.FORWARD_X,), np.ones((40, 80), bool), 0.5, (3.0, 1.0)
    )
    other = EdgeMap(np.zeros((1, 80, 160)), (TraceDirection.FORWARD_X,), np.ones((80, 160), bool), 1.0)
    x, y = Registration(same_field(one, other), 0.0).plate(0.5 * 159, 0.5 * 79)
    np.testing.assert_allclose((x, y), (3.0 + 0.25 * 79, 1.0 + 0.25 * 39), atol=1e-9)


@pytest.mark.parametrize(("severity", "number"), [(0.0, 0), (0.6, 1), (0.9, 0), (0.9, 1)])
def test_by_characters_in_any_dirt(severity: float, number: int) -> None:
    part, (photo, true) = soiled(severity, number), taken(severity, number)
    found = register_line(line_of(part), vision_edges(photo, height_mm=HEIGHT_MM), [np.eye(3)])
    errors = errors_mm(found, true, part)
    assert found.failure is None
    assert np.median(errors) < LINE_MM
    assert errors.max() < LINE_WORST_MM


def test_noise_is_no_line() -> None:
    part = soiled(0.0, 0)
    noise = np.random.default_rng(3).integers(90, 160, taken(0.0, 0)[0].shape, dtype=np.uint8)
    photo = Photo(noise, pitch_mm=0.06, centre_mm=taken(0.0, 0)[0].centre_mm)
    edges = vision_edges(photo, height_mm=HEIGHT_MM)
    assert register_line(line_of(part), edges, [np.eye(3)]).failure is RegisterFailure.POOR
    assert register(felt(part.height_map), edges, height_mm=HEIGHT_MM).failure is RegisterFailure.POOR


def test_pictures_apart_are_not_found() -> None:
    part, (photo, _) = soiled(0.0, 0), taken(0.0, 0)
    away = np.array([[1.0, 0.0, 500.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    edges = vision_edges(photo, height_mm=HEIGHT_MM)
    found = register(felt(part.height_map), edges, height_mm=HEIGHT_MM, starts=[away])
    assert found.failure is RegisterFailure.NOT_FOUND
    assert found.quality == 0.0
    np.testing.assert_allclose(found.plate_from_photo, away)


@settings(deadline=None, max_examples=50)
@given(
    turn=st.floats(-3.0, 3.0),
    scale=st.floats(0.1, 10.0),
    shift=st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
    seed=st.integers(0, 1000),
)
def test_boxes_tell_a_similarity(turn: float, scale: float, shift: tuple[float, float], seed: int) -> None:
    middles = np.random.default_rng(seed).uniform(0.0, 40.0, (6, 2))
    cos, sin = scale * np.cos(turn), scale * np.sin(turn)
    moved = middles @ np.array([[cos, sin], [-sin, cos]]) + shift
    found = matched_boxes(*([Box(x - 1, y - 2, x + 1, y + 2) for x, y in m] for m in (moved, middles)))
    assert found is not None
    x, y = Registration(found, 1.0).plate(*middles.T)
    # 400 mm at ten times the size, in double precision
    np.testing.assert_allclose(np.stack([x, y], axis=1), moved, atol=1e-8)


def test_too_few_boxes_tell_nothing() -> None:
    assert matched_boxes([Box(0, 0, 1, 1)], [Box(0, 0, 1, 1)]) is None
    with pytest.raises(ValueError, match="2 boxes seen for 1 felt"):
        matched_boxes([Box(0, 0, 1, 1)], [Box(0, 0, 1, 1)] * 2)


def test_a_registration_is_a_transform() -> None:
    with pytest.raises(ValueError, match="invertible"):
        Registration(np.zeros((3, 3)), 0.0)
    flat = EdgeMap(np.zeros((1, 9, 9)), (TraceDirection.FORWARD_X,), np.ones((9, 9), bool), 0.5)
    with pytest.raises(ValueError, match="positive number"):
        register(flat, flat, height_mm=0.0)
    there = Registration(np.array([[1.01, 0.02, 3.0], [-0.02, 0.99, -1.0], [1e-4, 2e-4, 1.0]]), 1.0)
    x, y = there.photo(*there.plate([1.0, 20.0], [2.0, 9.0]))
    np.testing.assert_allclose((x, y), ([1.0, 20.0], [2.0, 9.0]), rtol=1e-12)
