"""Heights from meshes (STL, PLY, OBJ, by trimesh) and points, which state no unit.

x runs to the right, y up unless the settings say that the rows are top first, and z out of the surface. Points on a
grid keep their heights; others are joined by triangles, of which the highest at a place counts. A plate that is tilted,
or lies in x and z because y is up, is first turned to face z.
"""

from __future__ import annotations

import io
import math
import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import MAX_PIXELS
from glyphs.surface.orientation import draw_triangles, plate_normal, rotation_to_z
from pipeline.errors import DataError
from pipeline.formats.raw_map import CUT_SHORT, PROFILE, RawMap, check_size, numbers_in, without_bad_points

# of a LAS file: start and length of the points, and their number; scale and origin of x, y, z; their number from 1.4 on
_LAS_POINTS, _LAS_SCALE, _LAS_MANY = struct.Struct("<IIBHI"), struct.Struct("<6d"), struct.Struct("<Q")
# a head of LAS 1.4 up to the number of points; a usable file of an older version is longer, too
_LAS_HEAD_BYTES = 255
# of an STL file in binary
_STL_HEAD_BYTES, _STL_FACE_BYTES = 84, 50
# of a PLY file: most properties, and what Python takes for the end of a line
_MOST_PROPERTIES, _LINE_ENDS = 200, (b"\n", b"\r", b"\v", b"\f", b"\x1c", b"\x1d", b"\x1e")
# of a PLY or PCD file: its longest head; kinds of numbers as numpy spells them
_MOST_HEAD_BYTES = 20_000
_KINDS = {"F": "f", "I": "i", "U": "u"}
MOST_SCATTERED = 2_000_000  # points off a grid, which are triangulated
MOST_DRAWN = 300_000_000  # samples that the triangles of a mesh cover together: two seconds of work
_LEAST_SAMPLES, _MOST_SAMPLES = 600, 4000
"""Samples along the longer side of a map of triangles; their own size may mean nothing: a flat land has two."""
_GAP = 6.0  # longest side of a triangle between points, in mean distances, from which it spans a dropout
# z of the unit normal of a plate that counts as level: 2 degrees
_LEVEL = 0.9994
# a grid: least rows and columns, least share of them with a point, and pitches by which a point may miss its place
_LEAST_GRID, _LEAST_FILLED, _OFF_GRID = 8, 0.5, 0.1
# problem and hint of points on a line whose other numbers spread as those of a surface
_UNNAMED = (
    "holds points whose first columns are not x, y and z",
    "head the columns x, y and z, or export these three alone",
)

Points = NDArray[np.float64]
Faces = NDArray[np.int64]


def read_mesh(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of a mesh."""
    import trimesh

    suffix, data = path.suffix.lower(), path.read_bytes()
    if suffix == ".ply":
        _check_ply(data, most)
    elif suffix == ".obj":
        # corners and faces alone: trimesh takes quadratic time for many groups and materials
        data = re.sub(rb"\\\r?\n", b" ", data)
        data = re.sub(rb"(?m)^(?![vf][ \t]).*\n?|/[^\s]*", b"", data)
    elif len(data) != _STL_HEAD_BYTES + _STL_FACE_BYTES * int.from_bytes(data[80:84], "little"):
        # one solid of the text, likewise
        data = b"solid\n" + re.sub(rb"(?im)^[ \t]*(?:end)?solid\b.*", b"", data) + b"\nendsolid"
    try:  # given a path, trimesh would look for textures beside it
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False)
    except KeyError as error:
        if error.args[0] not in ("x", "y", "z"):
            raise
        raise DataError(f"has no {error.args[0]}", "export x, y and z") from error
    corners, triangles, before = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
    for geometry in scene.geometry.values():
        corners.append(np.asarray(geometry.vertices, dtype=np.float64))
        triangles.append(np.asarray(getattr(geometry, "faces", triangles[0]), dtype=np.int64) + before)
        before += len(corners[-1])
    raw = map_of_points(np.concatenate(corners), np.concatenate(triangles), most=most)
    return replace(raw, one_unit=True)


def _check_ply(data: bytes, most: int) -> None:
    """Check that a PLY file has about as many lines or bytes as its head declares, before trimesh makes arrays."""
    end = data.find(b"end_header", 0, _MOST_HEAD_BYTES)
    if end < 0 or data.count(b"property", 0, end) > _MOST_PROPERTIES:
        raise DataError("is damaged or not a PLY file (its head does not end)", "copy or export it again")
    declared = sum(int(count) for count in re.findall(rb"(?m)^element +\S+ +(\d{1,15})\s*$", data[:end]))
    if declared > len(data) - end:
        raise DataError(*CUT_SHORT)
    check_size(declared, 1, 3 * most)  # points, and faces of a closed body
    if b"ascii" in data[:100] and sum(data.count(sign, end) for sign in _LINE_ENDS) > 2 * declared + 1000:
        raise DataError("holds far more lines than it declares", "export it again")


def read_pcd(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of the points of a PCD file (Point Cloud Library), ASCII or binary, but not compressed."""
    data = path.read_bytes()
    mark = data.find(b"\nDATA ", 0, _MOST_HEAD_BYTES) + 1
    end = data.find(b"\n", mark) + 1
    if not mark or not end:
        raise DataError("is damaged or not a PCD file (it has no line DATA)", "copy or export it again")
    head = {}
    for line in data[:end].decode("ascii", "replace").splitlines():
        key, *values = line.split() or [""]
        head[key] = values
    names, form = head["FIELDS"], head["DATA"][0]
    counts = [int(n) for n in head.get("COUNT", ["1"] * len(names))]
    if not {"x", "y", "z"} <= set(names):
        raise DataError(f"has the fields {' '.join(names)[:80]}", "export x, y and z")
    places = [names.index(axis) for axis in "xyz"]
    if form == "ascii":
        columns = [sum(counts[:place]) for place in places]
        return map_of_points(np.loadtxt(io.BytesIO(data[end:]), usecols=columns, ndmin=2), most=most)
    if form != "binary":
        hint = "save it as ASCII or binary PCD, as PLY or as columns x y z"
        raise DataError(f"holds its points as {form}", hint)
    sizes = [int(size) * count for size, count in zip(head["SIZE"], counts, strict=True)]
    count = int(head["POINTS"][0])
    # before there is a type: NumPy has none for records of gigabytes
    if min(sizes) < 0 or len(data) - end < count * sum(sizes):
        raise DataError(*CUT_SHORT)
    record = np.dtype({
        "names": ["x", "y", "z"],
        "formats": [f"<{_KINDS[head['TYPE'][place]]}{head['SIZE'][place]}" for place in places],
        "offsets": [sum(sizes[:place]) for place in places],
        "itemsize": sum(sizes),
    })  # fmt: skip
    rows = numbers_in(data, record, end, (count,), most)
    return map_of_points(np.stack([rows[axis] for axis in "xyz"], axis=1), most=most)


def read_las(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of the points of a LAS file; compressed ones (LAZ) are refused."""
    data = path.read_bytes()
    if not data.startswith(b"LASF"):
        raise DataError("is damaged or not a LAS file", "copy or export it again")
    if len(data) < _LAS_HEAD_BYTES:
        raise DataError(*CUT_SHORT)
    start, _, kind, length, count = _LAS_POINTS.unpack_from(data, 96)
    if kind & 0xC0:
        raise DataError("holds compressed points (LAZ)", "save it as LAS, as PLY or as columns x y z")
    count = count or _LAS_MANY.unpack_from(data, 247)[0]
    scale_and_origin = np.reshape(_LAS_SCALE.unpack_from(data, 131), (2, 3))
    record = np.dtype({"names": ["xyz"], "formats": ["(3,)<i4"], "offsets": [0], "itemsize": length})
    counts = numbers_in(data, record, start, (count,), most)["xyz"]
    return map_of_points(counts * scale_and_origin[0] + scale_and_origin[1], most=most)


def map_of_points(
    points: NDArray[np.number], faces: Faces | None = None, *, most: int = MAX_PIXELS
) -> RawMap:
    """Make a grid of heights from points (n, 3) and their triangles (m, 3), if any. Raises DataError: too few points,
    points in one line, or a map of more samples than the limit."""
    xyz: Points = np.array(points, dtype=np.float64)
    if faces is None:
        empty = ~xyz.any(axis=1)
        if empty.sum() > 1:
            xyz[empty] = np.nan  # sensors write 0 0 0 where they saw nothing
        for axis in range(3):
            without_bad_points(xyz[:, axis])
    known = np.asarray(np.isfinite(xyz).all(axis=1))
    if known.sum() < 4:
        raise DataError(f"holds {known.sum()} points", "export the surface")
    if faces is None:
        if _is_profile(xyz[known]):
            raise DataError(*(_UNNAMED if _sweeps(xyz[known]) else PROFILE))
        faces = np.empty((0, 3), dtype=np.int64)
    gridded = _on_grid(xyz[known])
    if gridded is None:
        normal = plate_normal(xyz[known])
        if normal is not None and normal[2] < _LEVEL:
            xyz = xyz @ rotation_to_z(normal).T
        gridded = _grid_of_triangles(xyz, faces, known, most)
    z, x_pitch, y_pitch = gridded
    return RawMap(z[::-1], x_pitch, y_pitch, bottom_first=True, one_unit=len(faces) > 0)


def _is_profile(points: Points) -> bool:
    if len(points) < _LEAST_GRID:
        return False
    steps = np.diff(points[:, :2], axis=0)
    one_way = steps.min(axis=0) * steps.max(axis=0) >= 0.0
    return bool((one_way & (steps.std(axis=0) < 0.5 * np.abs(steps.mean(axis=0)))).any())


def _sweeps(points: Points) -> bool:
    """Whether a coordinate of the points runs in equal steps and starts again, line by line, as over a surface."""
    steps = np.diff(points, axis=0)
    usual = np.median(steps, axis=0)
    is_usual = (np.abs(steps - usual) < 0.5 * np.abs(usual)).mean(axis=0)
    starts_again = (steps * np.sign(usual) < (1.5 - _LEAST_GRID) * np.abs(usual)).sum(axis=0)
    return bool(((is_usual > 0.8) & (starts_again >= _LEAST_GRID - 1)).any())


def _on_grid(points: Points) -> tuple[Points, float, float] | None:
    """Heights (rows, cols) and pitches along x and y; None for points off a grid."""
    places, pitches = [], []
    for along in (points[:, 0], -points[:, 1]):
        gaps = np.diff(np.unique(along))
        if not gaps.size:
            return None
        # numbers written with few digits make gaps of different sizes, and rounded ones tiny gaps
        count = round((along.max() - along.min()) / float(np.median(gaps[gaps > 0.3 * gaps.max()])))
        pitch = float((along.max() - along.min()) / max(count, 1))
        steps = (along - along.min()) / pitch
        places.append(np.rint(steps).astype(np.int64))
        pitches.append(pitch)
        if np.abs(steps - places[-1]).max() > _OFF_GRID:
            return None
    cols, rows = (int(p.max()) + 1 for p in places)
    if min(rows, cols) < _LEAST_GRID or rows * cols > len(points) / _LEAST_FILLED:
        return None
    z = np.full((rows, cols), -np.inf)
    np.maximum.at(z, (places[1], places[0]), points[:, 2])
    return np.where(np.isfinite(z), z, np.nan), pitches[0], pitches[1]


def _grid_of_triangles(
    points: Points, faces: Faces, known: NDArray[np.bool_], most: int
) -> tuple[Points, float, float]:
    width, height = (float(np.ptp(points[known, axis])) for axis in (0, 1))
    if not min(width, height) > 0.0:
        raise DataError(*PROFILE)
    if len(faces):
        faces = faces[known[faces].all(axis=1)]
        pitch = float(np.median(_longest_sides(points, faces))) / math.sqrt(2.0)
        longer = max(width, height)
        pitch = min(max(pitch, longer / _MOST_SAMPLES), longer / _LEAST_SAMPLES)
    else:
        points = points[known]
        if len(points) > MOST_SCATTERED:
            raise DataError(f"holds {len(points):,} points off a grid", "export them on a grid")
        from scipy.spatial import Delaunay, QhullError

        pitch = math.sqrt(width * height / len(points))
        try:
            faces = Delaunay(points[:, :2]).simplices.astype(np.int64)
        except QhullError as error:
            raise DataError(*PROFILE) from error
        faces = faces[_longest_sides(points, faces) < _GAP * pitch]
    rows, cols = int(height / pitch + 1e-6) + 1, int(width / pitch + 1e-6) + 1
    check_size(rows, cols, most)
    left, top = np.nanmin(points[:, 0]), np.nanmax(points[:, 1])
    places = np.column_stack([(points[:, 0] - left) / pitch, (top - points[:, 1]) / pitch, points[:, 2]])
    if _drawn_samples(places, faces) > MOST_DRAWN:
        what = f"holds {len(faces):,} triangles that lie over each other, too many to look for the uppermost"
        raise DataError(what, "export the marked surface alone")
    z = np.full((rows, cols), np.nan)
    draw_triangles(z, places, faces)
    return z, pitch, pitch


def _longest_sides(points: Points, faces: Faces) -> NDArray[np.float64]:
    """(m,) longest sides seen from above."""
    corners = points[faces][:, :, :2]
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1))


def _drawn_samples(places: Points, faces: Faces) -> float:
    a, b, c = (places[faces[:, k], :2] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    rows = np.ptp(places[:, 1][faces], axis=1)
    return float((0.5 * np.abs(ux * vy - vx * uy) + 4.0 * (rows + 1.0)).sum())
