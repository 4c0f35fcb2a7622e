"""What comes from outside is refused before it is work: jobs, glyph databases, meshes. The service goes on."""

from __future__ import annotations

import hashlib
import io
import struct
from collections.abc import Callable
from pathlib import Path

import h5py
import httpx
import numpy as np
import pytest

from tests.contract.front_doors import Command, RunningService, status_of

BLOCK_BYTES = 512


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A glyph database of one font, as `glyphs build` writes it."""
    from importlib.metadata import entry_points

    path = tmp_path_factory.mktemp("glyphs") / "gothic.glyphs"
    (entry,) = entry_points(group="console_scripts", name="tactile-marks")
    assert entry.load()(["glyphs", "build", str(path), "gothic"]) == 0
    return path.read_bytes()


def edited(database: bytes, change: Callable[[h5py.File], object]) -> bytes:
    """The database with its HDF5 part changed and its digest right."""
    head, body = database[:BLOCK_BYTES], io.BytesIO(database[BLOCK_BYTES:])
    with h5py.File(body, "r+") as file:
        change(file)
    lines = head.rstrip(b"\0").split(b"\n")
    lines[2] = b"sha256 " + hashlib.sha256(body.getvalue()).hexdigest().encode()
    return b"\n".join(lines).ljust(BLOCK_BYTES, b"\0") + body.getvalue()


def never_written(file: h5py.File) -> None:
    del file["fonts/0/points"]
    file["fonts/0"].create_dataset(
        "points", shape=(200_000_000, 2), dtype="f8", chunks=(1000, 2), compression="gzip"
    )


def stored_elsewhere(file: h5py.File) -> None:
    count = file["fonts/0/advance"].size
    del file["fonts/0/advance"]
    file["fonts/0"].create_dataset(
        "advance", shape=(count,), dtype="f8", external=[("/etc/passwd", 0, 8 * count)]
    )


def linked_elsewhere(file: h5py.File) -> None:
    del file["fonts"]
    file["fonts"] = h5py.ExternalLink("/tmp/other.h5", "/fonts")


def named_often(file: h5py.File) -> None:
    for k in range(1, 2000):
        file[f"fonts/{k}"] = file["fonts/0"]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (never_written, "unpacks to more than"),
        (stored_elsewhere, "in another file"),
        (linked_elsewhere, "link into another file"),
        (named_often, "second name for its data"),
    ],
)
def test_a_hostile_glyph_database_is_refused_by_jobs_and_parts(
    service: RunningService,
    database: bytes,
    height_map: Path,
    change: Callable[[h5py.File], object],
    why: str,
) -> None:
    name = change.__name__
    (service.folder / "databases" / f"{name}.glyphs").write_bytes(edited(database, change))
    with httpx.Client(base_url=service.url, timeout=60.0) as http:
        written = http.put(f"/v1/jobs/{name}", json={"format": "A9", "database": name})
        assert written.status_code == 503, written.text  # a file of the service, not the caller's
        assert why in written.json()["detail"]
        assert str(service.folder) not in written.text
        read = http.post(
            "/v1/parts", files={"scan": ("part.npz", height_map.read_bytes())}, data={"database": name}
        )
        assert read.status_code == 503, read.text
        assert why in read.json()["detail"]
        assert name not in [job["name"] for job in http.get("/v1/jobs").json()]


def test_a_whole_glyph_database_is_taken(service: RunningService, database: bytes) -> None:
    (service.folder / "databases" / "whole.glyphs").write_bytes(database)
    written = httpx.put(
        f"{service.url}/v1/jobs/whole", json={"format": "A9", "database": "whole"}, timeout=60.0
    )
    assert written.status_code == 201, written.text


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"format": [f"re:.*A.{{10}}+exclude={chr(0x391 + k)}" for k in range(40)]}, "give 16 at most"),
        ({"format": [f"re:.*A.{{10}}+exclude={chr(0x391 + k)}" for k in range(16)]}, "two of re"),
        ({"line": {f"line{k}": "A9" for k in range(40)}}, "give 16 at most"),
        ({"check": ["luhn"] * 40}, "give 16 at most"),
        ({"format": "A" * 2001}, "give 2,000 at most"),
        ({"format": "re:(A|B)*A(A|B){20}"}, "too involved"),
        ({"format": "re:.*A.{10}[\u4e00-\u5dff]{5}.{40}"}, "too involved"),
        (["A9"], "not a JSON object"),
    ],
)
def test_a_job_that_is_far_too_much_to_prepare_is_refused(
    service: RunningService, settings: object, why: str
) -> None:
    refused = httpx.put(f"{service.url}/v1/jobs/large", json=settings, timeout=60.0)
    assert refused.status_code == 422, refused.text
    assert why in refused.json()["detail"]
    assert status_of(f"{service.url}/readyz") == 200


def test_a_mesh_of_triangles_over_each_other_is_refused(service: RunningService) -> None:
    corners = np.tile(np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [40.0, 20.0, 0.0]]), (10_000, 1, 1))
    corners += np.random.default_rng(3).uniform(0.0, 0.1, corners.shape)
    rows = np.zeros(10_000, dtype=[("normal", "<3f4"), ("corners", "<(3,3)f4"), ("more", "<u2")])
    rows["corners"] = corners
    stl = bytes(80) + struct.pack("<I", rows.size) + rows.tobytes()
    refused = httpx.post(f"{service.url}/v1/parts", files={"scan": ("heap.stl", stl)}, timeout=60.0)
    assert refused.status_code == 422, refused.text
    assert "lie over each other" in refused.json()["detail"]


def test_the_command_line_refuses_a_hostile_database(
    command: Command, database: bytes, height_map: Path, tmp_path: Path
) -> None:
    path = tmp_path / "hostile.glyphs"
    path.write_bytes(edited(database, never_written))
    ended = command("read", height_map, "--database", path, "--format", "A9", "--jobs", "1")
    assert ended.status != 0
    assert "unpacks to more than" in ended.out + ended.err
