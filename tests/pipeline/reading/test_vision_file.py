from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.camera.photo import Photo
from glyphs.errors import FileError
from glyphs.surface.maps import EdgeMap, TraceDirection
from pipeline.reading.vision_file import KeptVision, load_vision, moved, save_vision
from recognition.box import Box
from recognition.lattice import Lattice
from recognition.reader_settings import ReaderSettings
from recognition.reading import Decision, Reading, ReadingFlag
from recognition.vision_combine import as_reading
from recognition.vision_frame import LinePlace, photo_middle_mm

HALF_PRECISION = 1e-3
"""Relative, of edges: ten bits of mantissa."""


def lattice(shift: float = 0.0) -> Lattice:
    chars = ("A", "B", "1")
    with np.errstate(divide="ignore"):
        log = np.log(np.array([[0.9, 0.05, 0.0], [0.2, 0.3, 0.4]]))
    boxes = (Box(1.0 + shift, 2.0, 4.0 + shift, 7.0), Box(5.0 + shift, 2.0, 8.0 + shift, 7.0))
    return Lattice(chars, log, boxes=boxes, spaces_after=frozenset({0}))


def edges(shape: tuple[int, int] = (40, 90), pitch_mm: float = 0.1) -> EdgeMap:
    rng = np.random.default_rng(4)
    valid = rng.random(shape) > 0.1
    layers = np.where(valid, rng.standard_normal((2, *shape)), 0.0).astype(np.float32)
    return EdgeMap(
        layers, (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y), valid, pitch_mm, origin_mm=(-3.0, 1.0)
    )


def vision(**trace: object) -> Reading:
    members = {
        "lattice": lattice(),
        "open_lattice": lattice(1.0),
        "edge_map": edges(),
        "engine": "templates",
        "place": LinePlace((4.0, 5.0), 7.0, 5.0, 1.5),
        "by_engine": MappingProxyType({"templates": lattice()}),
    }
    return replace(
        as_reading(lattice(), ReaderSettings(), flags=ReadingFlag.FOREIGN_SHAPES | ReadingFlag.DROPOUTS),
        notes=("read by templates alone",),
        seconds=MappingProxyType({"templates": 0.2}),
        height_mm=5.0,
    ).traced(**{**members, **trace})


def assert_same_lattice(one: Lattice | None, other: Lattice | None) -> None:
    if one is None or other is None:
        assert one is other
        return
    assert one.chars == other.chars
    np.testing.assert_array_equal(one.log_belief, other.log_belief)
    assert one.boxes == other.boxes
    assert one.spaces_after == other.spaces_after


def test_what_was_seen_comes_back(tmp_path: Path) -> None:
    kept = KeptVision(vision(), (1.0, 2.0), "AB")
    save_vision(tmp_path / "a.npz", kept)
    again = load_vision(tmp_path / "a.npz")
    assert again.vision == kept.vision
    assert again.vision.trace.place == kept.vision.trace.place
    assert again.vision.trace.engine == "templates"
    assert (again.middle_mm, again.expected) == ((1.0, 2.0), "AB")
    assert_same_lattice(again.vision.trace.lattice, kept.vision.trace.lattice)
    assert_same_lattice(again.vision.trace.open_lattice, kept.vision.trace.open_lattice)
    assert_same_lattice(again.vision.trace.by_engine["templates"], kept.vision.trace.by_engine["templates"])
    assert again.vision.trace.edge_map is not None
    assert kept.vision.trace.edge_map is not None
    np.testing.assert_array_equal(again.vision.trace.edge_map.valid, kept.vision.trace.edge_map.valid)
    np.testing.assert_allclose(
        again.vision.trace.edge_map.enhancement, kept.vision.trace.edge_map.enhancement, rtol=HALF_PRECISION
    )
    assert again.vision.trace.edge_map.origin_mm == kept.vision.trace.edge_map.origin_mm


def test_nothing_seen_comes_back_as_nothing(tmp_path: Path) -> None:
    nothing = vision(lattice=None, edge_map=None, place=None, by_engine=MappingProxyType({}))
    nothing = replace(nothing, characters=(), decision=Decision.REJECT)
    save_vision(tmp_path / "a.npz", KeptVision(nothing))
    again = load_vision(tmp_path / "a.npz")
    assert (again.vision.trace.lattice, again.vision.trace.edge_map, again.vision.trace.place) == (
        None,
        None,
        None,
    )
    assert again.vision.decision is Decision.REJECT
    assert again.middle_mm is None


def test_fine_edges_are_thinned_and_stay_where_they_are(tmp_path: Path) -> None:
    fine = edges((400, 900), 0.01)
    yy, xx = np.mgrid[0:400, 0:900]
    bump = np.exp(-((xx - 300.0) ** 2 + (yy - 100.0) ** 2) / 2000.0).astype(np.float32)
    fine = replace(fine, enhancement=np.stack([bump, bump]), valid=np.ones_like(fine.valid))
    save_vision(tmp_path / "a.npz", KeptVision(vision(edge_map=fine)))
    thin = load_vision(tmp_path / "a.npz").vision.trace.edge_map
    assert thin is not None
    assert thin.pitch_mm > 3.0 * fine.pitch_mm
    weight = thin.enhancement[0] / thin.enhancement[0].sum()
    rows, cols = np.mgrid[0 : thin.shape[0], 0 : thin.shape[1]]
    x = thin.origin_mm[0] + thin.pitch_mm * float((weight * cols).sum())
    y = thin.origin_mm[1] + thin.pitch_mm * float((weight * rows).sum())
    # a tenth of a fine pixel: means over squares have the same middle
    assert (x, y) == pytest.approx((-3.0 + 3.0, 1.0 + 1.0), abs=0.001)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_moving_moves_all_alike(x_mm: float, y_mm: float) -> None:
    kept = KeptVision(vision(), (1.0, 2.0), "AB")
    away = moved(kept, x_mm, y_mm)
    assert away.vision.trace.edge_map is not None
    assert away.vision.trace.edge_map.origin_mm == pytest.approx((-3.0 + x_mm, 1.0 + y_mm))
    assert away.vision.trace.place is not None
    assert away.vision.trace.place.middle_mm == pytest.approx((4.0 + x_mm, 5.0 + y_mm))
    assert away.middle_mm == pytest.approx((1.0 + x_mm, 2.0 + y_mm))
    for one, other in (
        (kept.vision.trace.lattice, away.vision.trace.lattice),
        (kept.vision.trace.open_lattice, away.vision.trace.open_lattice),
        (kept.vision.trace.by_engine["templates"], away.vision.trace.by_engine["templates"]),
    ):
        assert one is not None
        assert other is not None
        for was, now in zip(one.boxes, other.boxes, strict=True):
            assert now.x0_mm - was.x0_mm == pytest.approx(x_mm)
            assert now.y1_mm - was.y1_mm == pytest.approx(y_mm)
    assert away.vision.characters[0].box == away.vision.trace.lattice.boxes[0]  # type: ignore[union-attr]


def test_open_beliefs_are_of_their_text_only() -> None:
    kept = KeptVision(vision(), None, "AB")
    assert kept.vision_for("AB") is kept.vision
    assert kept.vision_for("XY").trace.open_lattice is kept.vision.trace.lattice


def test_middle_of_a_picture() -> None:
    photo = Photo(np.zeros((11, 21), dtype=np.uint8), pitch_mm=0.1)
    assert photo_middle_mm(photo) == pytest.approx((1.0, 0.5))
    assert photo_middle_mm(replace(photo, centre_mm=(7.0, 8.0))) == pytest.approx((7.0, 8.0))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_damaged_files_are_problems(tmp_path: Path, share: float) -> None:
    path = tmp_path / "a.npz"
    save_vision(path, KeptVision(vision()))
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(FileError):
        load_vision(path)


def test_other_archives_are_problems(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, told=np.array([object()], dtype=object))
    with pytest.raises(FileError):
        load_vision(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(FileError):
        load_vision(path)
