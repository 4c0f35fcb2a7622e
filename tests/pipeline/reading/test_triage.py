"""How far a reading takes a part, what felt parts say of the bench, and the pictures kept of a part."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from glyphs import HeightMap, stamp
from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.surface.maps import EdgeMap, TraceDirection
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import Agreement, EvidenceKind, PartState
from pipeline.reading.bench_watch import LATEST, SHOWN_BY, BenchWatch
from pipeline.reading.part_pictures import MOST_PIXELS_A_SIDE, Picture, edges_picture, photo_picture
from pipeline.reading.readers import find_height_mm
from pipeline.reading.triage import agreement_of, state_after
from recognition.reader import Reader
from recognition.settings import ReaderSettings


def reading(text: str = "KX407251", decision: str = "accept", source: str = "vision") -> ReadingRecord:
    return ReadingRecord(source, text, decision, 0.9)


@pytest.mark.parametrize(
    ("made", "expected", "agreement", "state"),
    [
        (reading(), "KX407251", Agreement.SAME, PartState.ACCEPTED),
        (reading("KX40 7251"), " KX4 07251 ", Agreement.SAME, PartState.ACCEPTED),  # blanks are not stamped
        (reading(), "KX407257", Agreement.OTHER, PartState.ACCEPTED),
        (reading(), "NO READ", Agreement.OTHER, PartState.ACCEPTED),
        (reading(decision="review"), "KX407251", Agreement.SAME, PartState.TOUCH_NEEDED),
        (reading(decision="review", source="fused"), "KX407251", Agreement.SAME, PartState.REVIEW),
        (reading("", "reject"), "KX407251", Agreement.NOTHING, PartState.TOUCH_NEEDED),
        (reading(), "", Agreement.ALONE, PartState.ACCEPTED),
        (reading("", "reject"), " ", Agreement.ALONE, PartState.TOUCH_NEEDED),
    ],
)
def test_beside_the_lines_own_reader(
    made: ReadingRecord, expected: str, agreement: Agreement, state: PartState
) -> None:
    assert (agreement_of(made, expected), state_after(made)) == (agreement, state)


DEAD = "whisker 3, dead whisker: gives 1 % of the moment of land (see whether it is broken)"
STILL_DEAD = "whisker 3, dead whisker: gives 0 % of the moment of land (see whether it is broken)"
SPIKES = "spikes: 40 single samples stand out (screen the wires)"


def test_one_part_alone_tells_nothing() -> None:
    watch = BenchWatch()
    assert not watch.add([SPIKES])
    assert watch.message() == ""
    assert watch.parts == 1


def test_what_parts_show_one_after_the_other_is_told_once_in_the_latest_words() -> None:
    watch = BenchWatch()
    assert [watch.add([DEAD]), watch.add([STILL_DEAD, SPIKES]), watch.add([DEAD])] == [False, True, False]
    assert watch.message() == DEAD
    watch.add([SPIKES])
    assert watch.message() == f"{SPIKES}; {DEAD}"


def test_it_is_over_when_the_latest_parts_are_sound() -> None:
    watch = BenchWatch()
    for _ in range(LATEST):
        watch.add([DEAD])
    for left in range(LATEST - SHOWN_BY + 1, -1, -1):
        assert bool(watch.message()) == (left > 0)
        watch.add([])


def read_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose font it is takes long and is not the subject."""
    gothic = Reader(ReaderSettings(fonts=("gothic",), experts=("network",)))
    monkeypatch.setattr("recognition.reader.Reader", lambda: gothic)


def test_dirt_does_not_make_the_characters_taller(monkeypatch: pytest.MonkeyPatch) -> None:
    """On this part the highest band is dirt and line together."""
    read_quickly(monkeypatch)
    part = stamp("KX407251", fonts="gothic", height_mm=5.0, seed=3, dirt=0.6)
    # shops stamp within a few percent of the height asked for
    assert find_height_mm(part.height_map, soil=part.soil) == pytest.approx(5.0, rel=0.06)


def test_a_map_without_characters_needs_a_height(monkeypatch: pytest.MonkeyPatch) -> None:
    read_quickly(monkeypatch)
    flat = HeightMap(np.zeros((30, 60), np.float32), 0.1)
    with pytest.raises(MarksError, match="--height-mm"):
        find_height_mm(flat)


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
