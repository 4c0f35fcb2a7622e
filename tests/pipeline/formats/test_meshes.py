"""Meshes, and maps of plates that lie askew: read square to the plate, or said to be tilted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import lazy_loader
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from glyphs import stamp
from glyphs.surface.maps import HeightMap
from pipeline.common.settings import MapSettings
from pipeline.errors import DataError
from pipeline.formats.grid import part_map
from pipeline.formats.raw_map import RawMap
from pipeline.formats.touch_file import read_height_map
from recognition.see.levelling import square_to_plate
from tests.support.felt import tilted

trimesh = lazy_loader.load("trimesh")
PART = stamp("K7", fonts="gothic", height_mm=5, seed=1).height_map
ROWS, COLS = PART.shape
TURN = np.array([[0.96, -0.28, 0.0], [0.28, 0.96, 0.0], [0.0, 0.0, 1.0]])


def points() -> NDArray[np.float64]:
    """(samples, 3), y upwards, corner at (3, 5)."""
    x, y = np.meshgrid(3.0 + np.arange(COLS) * PART.pitch_mm, 5.0 - np.arange(ROWS) * PART.pitch_mm)
    return np.column_stack([x.ravel(), y.ravel(), PART.z_mm.ravel()])


def mesh(corners: NDArray[np.float64], shape: tuple[int, int] = (ROWS, COLS)) -> trimesh.Trimesh:
    k = np.arange(len(corners)).reshape(shape)
    a, b, c, d = (k[i, j].ravel() for i in (np.s_[:-1], np.s_[1:]) for j in (np.s_[:-1], np.s_[1:]))
    return trimesh.Trimesh(
        corners, np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)]), process=False
    )


def write(path: Path) -> Path:
    geometry = mesh(points()) if path.stem == "mesh" else trimesh.PointCloud(points())
    geometry.export(path)
    return path


@pytest.mark.parametrize("name", ["mesh.stl", "mesh.ply", "points.ply", "points.xyz"])
def test_a_grid_keeps_its_heights(name: str, tmp_path: Path) -> None:
    height_map = read_height_map(write(tmp_path / name))
    assert height_map.pitch_mm == pytest.approx(PART.pitch_mm, rel=1e-6)  # coordinates are float32
    np.testing.assert_allclose(height_map.z_mm, PART.z_mm, atol=1e-6)


SMALL = PART.z_mm[100:140, 100:150]


def small_mesh() -> trimesh.Trimesh:
    """Some of the part."""
    row, col = np.indices(SMALL.shape)
    corners = np.column_stack([col.ravel() * PART.pitch_mm, -row.ravel() * PART.pitch_mm, SMALL.ravel()])
    return mesh(corners, SMALL.shape)


def grouped_obj() -> str:
    """Texture places, normals, continued lines, and a group, an object and a material for each triangle."""
    plate = small_mesh()
    lines = [f"v {x} {y} {z}" for x, y, z in plate.vertices] + ["vt 0 0", "vn 0 0 1", "s off"]
    for k, face in enumerate(plate.faces + 1):
        lines += [
            f"g g{k}",
            f"o o{k}",
            f"usemtl m{k}",
            "f " + " \\\n".join(f"{corner}/1/1" for corner in face),
        ]
    return "\n".join(lines)


def text_stl() -> str:
    """A solid with a misleading name for each triangle."""
    return "".join(
        f"solid vertex {k}\nfacet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corner) for corner in triangle)
        + "endloop\nendfacet\nendsolid\n"
        for k, triangle in enumerate(small_mesh().triangles)
    )


@pytest.mark.parametrize(("name", "make"), [("a.obj", grouped_obj), ("a.stl", text_stl)])
def test_groups_and_solids_are_one_surface(name: str, make: Callable[[], str], tmp_path: Path) -> None:
    (tmp_path / name).write_text(make())
    height_map = read_height_map(tmp_path / name)
    assert height_map.pitch_mm == pytest.approx(PART.pitch_mm, rel=1e-6)
    np.testing.assert_allclose(height_map.z_mm, SMALL, atol=1e-6)


@pytest.mark.parametrize("joined", [True, False])
def test_off_a_grid_triangles_are_resampled(joined: bool, tmp_path: Path) -> None:
    turned = points() @ TURN.T
    if joined:
        mesh(turned).export(tmp_path / "a.stl")
        height_map = read_height_map(tmp_path / "a.stl")
    else:
        jitter = np.random.default_rng(0).uniform(-0.2, 0.2, (len(turned), 2)) * PART.pitch_mm
        turned[:, :2] += jitter
        trimesh.PointCloud(turned).export(tmp_path / "a.ply")
        height_map = read_height_map(tmp_path / "a.ply")
    # where each sample of the map lies on the part
    v, u = np.nonzero(np.isfinite(height_map.z_mm))
    x = turned[:, 0].min() + u * height_map.pitch_mm
    y = turned[:, 1].max() - v * height_map.pitch_mm
    back = np.column_stack([x, y, np.zeros_like(x)]) @ TURN
    col, row = (back[:, 0] - 3.0) / PART.pitch_mm, (5.0 - back[:, 1]) / PART.pitch_mm
    nearest = PART.z_mm[
        np.rint(row).astype(int).clip(0, ROWS - 1), np.rint(col).astype(int).clip(0, COLS - 1)
    ]
    # half a sample aside on a wall of 45 degrees makes 0.035 mm, twice that for one corner of a triangle
    assert np.percentile(np.abs(height_map.z_mm[v, u] - nearest), 99.9) < 2.0 * 0.7 * PART.pitch_mm
    assert len(v) == pytest.approx(ROWS * COLS * (PART.pitch_mm / height_map.pitch_mm) ** 2, rel=0.02)


def turned_by(deg: float, axis: tuple[float, float, float]) -> NDArray[np.float64]:
    """(3, 3) rotation about an axis."""
    return Rotation.from_rotvec(np.radians(deg) * np.array(axis) / np.linalg.norm(axis)).as_matrix()


@pytest.mark.parametrize(
    "turn",
    [
        turned_by(45.0, (1.0, 0.0, 0.0)),
        turned_by(-60.0, (0.3, 1.0, 0.0)),
        # y up, as 3D programs export it
        turned_by(-90.0, (1.0, 0.0, 0.0)),
    ],
)
@pytest.mark.parametrize("name", ["a.stl", "a.ply"])
def test_a_tilted_plate_is_seen_along_its_normal(
    turn: NDArray[np.float64], name: str, tmp_path: Path
) -> None:
    corners = points() @ turn.T
    (mesh(corners) if name == "a.stl" else trimesh.PointCloud(corners)).export(tmp_path / name)
    height_map = read_height_map(tmp_path / name)
    # neither mirrored nor turned over: the marks are where they were, and as deep
    row, col = np.indices(height_map.shape) * height_map.pitch_mm / PART.pitch_mm
    there = ndimage.map_coordinates(PART.z_mm, (row, col), order=1, mode="nearest")
    known = np.isfinite(height_map.z_mm)
    assert known.mean() > 0.97
    plane = np.stack([np.ones(row.shape), row, col], axis=-1)[known]
    off = (height_map.z_mm - there)[known]
    off -= plane @ np.linalg.lstsq(plane, off, rcond=None)[0]
    # a third of a sample aside on the walls
    assert np.sqrt(np.mean(off**2)) < 0.02
    assert abs(np.median(off[there[known] < np.percentile(there, 3)])) < 2e-3


def test_a_block_keeps_its_axes(tmp_path: Path) -> None:
    """A body as thick as it is wide has no plate to turn: z is up, as the file has it."""
    body = trimesh.creation.box((30.0, 12.0, 20.0))
    body.export(tmp_path / "block.stl")
    assert read_height_map(tmp_path / "block.stl").size_mm == pytest.approx((30.0, 12.0), abs=0.2)


def test_long_thin_triangles_are_drawn_by_what_they_cover(tmp_path: Path) -> None:
    """A fan of slivers across the plate, as CAD programs write a flat: each lies in a box as large as the plate."""
    edge = np.linspace(0.0, 20.0, 2001)
    rim = np.column_stack([np.full(edge.size, 40.0), edge, 0.001 * edge])
    corners = np.concatenate([[[0.0, 0.0, 0.0], [0.0, 20.0, 0.02]], rim])
    k = np.arange(2, edge.size + 1)
    fan = np.column_stack([np.zeros(k.size, dtype=int), k, k + 1])
    faces = np.concatenate([fan, [[0, edge.size + 1, 1]]])
    trimesh.Trimesh(corners, faces, process=False).export(tmp_path / "fan.stl")
    z_mm = read_height_map(tmp_path / "fan.stl").z_mm
    rows = np.linspace(0.02, 0.0, z_mm.shape[0])[:, None]
    np.testing.assert_allclose(z_mm, np.broadcast_to(rows, z_mm.shape), atol=2e-5)


PITCH_MM = 0.1


def grooved() -> HeightMap:
    """A plate of 14 x 8 mm with two shallow grooves, one each way."""
    y, x = np.mgrid[0.0 : 8.0 + 1e-9 : PITCH_MM, 0.0 : 14.0 + 1e-9 : PITCH_MM]
    reach = np.minimum(np.abs(x - 5.0), np.abs(y - 3.0)) - 0.5
    return HeightMap(-np.clip(-0.3 * reach, 0.0, 0.1), PITCH_MM)


def load(seen: HeightMap) -> HeightMap | DataError:
    try:
        return part_map(RawMap(seen.z_mm, PITCH_MM, PITCH_MM), MapSettings()).height_map
    except DataError as problem:
        return problem


@settings(deadline=None, max_examples=25)
@given(deg=st.floats(0.0, 69.0), azimuth_deg=st.floats(0.0, 360.0))
@example(deg=61.0, azimuth_deg=0.0)
def test_a_tilted_plate_is_turned_square_or_said_to_be_tilted(deg: float, azimuth_deg: float) -> None:
    flat = grooved()
    loaded = load(tilted(flat, deg, azimuth_deg)[0])
    if isinstance(loaded, DataError):  # never the question for the unit
        assert float(str(loaded).rsplit("tilted by ")[1].split()[0]) == pytest.approx(deg, abs=1.0)
        assert "level the part" in loaded.hint
        return
    known = np.isfinite(square_to_plate(loaded)[0].z_mm)
    x, y = (np.flatnonzero(known.any(axis=axis)) * PITCH_MM for axis in (0, 1))
    assert (np.ptp(x), np.ptp(y)) == pytest.approx(flat.size_mm, abs=4.0 * PITCH_MM)
