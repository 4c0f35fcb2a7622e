from __future__ import annotations

import cv2
import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.surface.maps import EdgeMap, TraceDirection
from pipeline.common.records import EvidenceKind
from pipeline.reading.part_pictures import MOST_PIXELS_A_SIDE, Picture, edges_picture, photo_picture

DIRECTIONS = (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y)


def decoded(made: Picture) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(made.content, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image)


def brightest_mm(made: Picture, value: np.ndarray | None = None) -> tuple[float, float]:
    """Plate frame of the middle of the spot, from the picture, or values of its pixels, and its meta alone."""
    value = decoded(made).mean(axis=2) if value is None else value
    assert value.shape == (made.meta["height"], made.meta["width"])
    value = np.where(value > 0.5 * value.max(), value, 0.0)
    rows, cols = np.mgrid[0 : value.shape[0], 0 : value.shape[1]]
    x, y = (float((value * k).sum() / value.sum()) for k in (cols, rows))
    size = made.meta["mm_per_pixel"]
    return (made.meta["x0_mm"] + size * x, made.meta["y0_mm"] + size * y)


def spot(shape: tuple[int, int], at: tuple[int, int]) -> np.ndarray:
    rows, cols = np.mgrid[0 : shape[0], 0 : shape[1]]
    return np.asarray(np.exp(-((rows - at[0]) ** 2 + (cols - at[1]) ** 2) / (0.001 * shape[0] * shape[1])))


@pytest.mark.parametrize("shape", [(120, 400), (1000, 4001), (3000, 500)])
def test_photo_picture_tells_where_it_lies(shape: tuple[int, int]) -> None:
    at = (shape[0] // 3, shape[1] // 4)
    pixels = np.rint(250.0 * spot(shape, at)).astype(np.uint8)
    photo = Photo(np.stack([pixels] * 3, axis=2), pitch_mm=0.02, centre_mm=(5.0, -7.0))
    made = photo_picture(photo)
    assert made.kind is EvidenceKind.PHOTO_PICTURE
    assert max(made.meta["width"], made.meta["height"]) <= MOST_PIXELS_A_SIDE
    x = 5.0 + 0.02 * (at[1] - 0.5 * (shape[1] - 1))
    y = -7.0 + 0.02 * (at[0] - 0.5 * (shape[0] - 1))
    # a pixel of the picture; its rounded size is not quite in proportion
    assert brightest_mm(made) == pytest.approx((x, y), abs=made.meta["mm_per_pixel"])


def test_colours_are_kept() -> None:
    red = np.zeros((40, 60, 3), dtype=np.uint8)
    red[..., 0] = 200
    made = photo_picture(Photo(red))
    image = decoded(made)
    assert image[20, 30] == pytest.approx([0, 0, 200], abs=8)
    assert made.meta["mm_per_pixel"] == 1.0


def test_edges_picture_is_blue_below_and_red_above_the_land() -> None:
    shape = (60, 200)
    layer = spot(shape, (20, 50)) - spot(shape, (40, 150))
    valid = np.ones(shape, dtype=np.bool_)
    valid[:, 190:] = False
    edges = EdgeMap(np.stack([layer, layer]).astype(np.float32), DIRECTIONS, valid, 0.1, origin_mm=(3.0, 4.0))
    made = edges_picture(edges)
    image = decoded(made).astype(np.int64)
    assert made.kind is EvidenceKind.EDGES_PICTURE
    red_less_blue = np.clip(image[..., 2] - image[..., 0], 0, None)
    blue_less_red = np.clip(image[..., 0] - image[..., 2], 0, None)
    for value, (row, col) in ((red_less_blue, (20, 50)), (blue_less_red, (40, 150))):
        found = brightest_mm(made, value)
        assert found == pytest.approx((3.0 + 0.1 * col, 4.0 + 0.1 * row), abs=0.05)
    far_right = image[:, -10:].mean(axis=(0, 1))
    assert np.ptp(far_right) < 6.0, "grey where nothing was measured"
    assert image[5, 5].min() > 240, "land is white"


def test_edges_of_which_nothing_is_known_are_drawn() -> None:
    nothing = EdgeMap(np.zeros((1, 9, 9), np.float32), DIRECTIONS[:1], np.zeros((9, 9), np.bool_), 0.1)
    assert decoded(edges_picture(nothing)).shape[2] == 3
