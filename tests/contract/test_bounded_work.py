"""What comes from outside is refused before it is work: jobs, databases, meshes, bad files, generated requests."""

from __future__ import annotations

import hashlib
import json
import re
import struct
import time
import zlib
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from tests.contract.front_doors import Command, RunningService, status_of
from tests.support.bad_files import bad_maps, bad_photos, bad_scans, other_file
from tests.support.waiting import children


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A glyph database of one font, as `glyphs build` writes it."""
    from importlib.metadata import entry_points

    path = tmp_path_factory.mktemp("glyphs") / "gothic.glyphs"
    (entry,) = entry_points(group="console_scripts", name="tactile-marks")
    assert entry.load()(["glyphs", "build", str(path), "gothic"]) == 0
    return path.read_bytes()


def edited(database: bytes, change: Callable[[dict[str, Any]], object]) -> bytes:
    """The database with its JSON changed and its digest right."""
    name, version, _, packed = database.split(b"\n", 3)
    content = json.loads(zlib.decompress(packed))
    change(content)
    body = zlib.compress(json.dumps(content).encode())
    digest = b"sha256 " + hashlib.sha256(body).hexdigest().encode()
    return b"\n".join((name, version, digest, body))


def an_array(content: dict[str, Any], **change: object) -> None:
    content["fonts"]["gothic"]["glyphs"]["A"]["strokes"][0].update(change)


def bomb(content: dict[str, Any]) -> None:
    content["fonts"]["gothic"]["source"] = "x" * 70_000_000


def never_written(content: dict[str, Any]) -> None:
    an_array(content, shape=[200_000_000, 2])


def objects(content: dict[str, Any]) -> None:
    an_array(content, dtype="|O8")


def many_fonts(content: dict[str, Any]) -> None:
    gothic = content["fonts"]["gothic"]
    content["fonts"] = {f"gothic-{k}": {**gothic, "name": f"gothic-{k}"} for k in range(300)}


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (bomb, "unpacks to more than 64 MB"),
        (never_written, "is not a glyph database"),
        (objects, "is not a glyph database"),
        (many_fonts, "300 fonts, over the limit"),
    ],
)
def test_a_hostile_glyph_database_is_refused_by_jobs_and_parts(
    service: RunningService,
    database: bytes,
    height_map: Path,
    change: Callable[[dict[str, Any]], object],
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
        ({"format": ["check:luhn"] * 40}, "give 16 at most"),
        ({"format": "A" * 2001}, "give 2,000 at most"),
        ({"format": "re:(A|B)*A(A|B){20}"}, "too complex"),
        ({"format": "re:.*A.{10}[\u4e00-\u5dff]{5}.{40}"}, "has more than 200 different characters"),
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
    path.write_bytes(edited(database, bomb))
    ended = command("read", height_map, "--database", path, "--format", "A9", "--jobs", "1")
    assert ended.status != 0
    assert "unpacks to more than" in ended.out + ended.err


SLOWEST_S = 30.0
"""For one answer, on a busy machine; most come in milliseconds."""
MOST_MEMORY_MB = 3000.0
"""Of the web server and its worker together at any moment; a worker at rest has about 600, the corpus declares
terabytes."""
EACH = 24
"""One of so many: all of them are read by `tests/pipeline/reading/test_bad_files_sent.py`, without a service."""


def test_a_corpus_of_bad_files_does_no_harm(service: RunningService) -> None:
    sent, slowest_s, most_mb, logged = 0, 0.0, 0.0, len(service.log)
    with httpx.Client(base_url=service.url, timeout=4 * SLOWEST_S) as http:
        for role, files in (("photo", bad_photos()), ("scan", bad_maps()), ("scan", bad_scans())):
            for name, data in islice(files, 0, None, EACH):
                start = time.perf_counter()
                answer = http.post("/v1/parts", files={role: (name, data)})
                slowest_s = max(slowest_s, time.perf_counter() - start)
                most_mb = max(most_mb, _memory_mb(service))
                sent += 1
                assert answer.status_code in (201, 413, 415, 422), f"{name}: {answer.text}"
                # what points to another file of the server is refused, and not read as if it were the part's
                assert answer.status_code != 201 or "link" not in name, name
                assert other_file() not in answer.text, name
                assert str(service.folder) not in answer.text, name
        assert http.get("/readyz").status_code == 200
        assert not list((service.folder / "evidence" / "incoming").iterdir())
    assert sent >= 100 // EACH
    assert slowest_s < SLOWEST_S
    assert most_mb < MOST_MEMORY_MB
    assert "request failed" not in service.log[logged:]


def _memory_mb(service: RunningService) -> float:
    """Resident memory of the service and all below it."""
    total = 0.0
    for at in (service.process.pid, *children(service.process.pid)):
        try:
            told = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{at}/status").read_text())
        except (FileNotFoundError, ProcessLookupError):
            continue
        total += float(told[1]) / 1000.0 if told else 0.0
    return total


EXAMPLES = 2
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]


@pytest.fixture(scope="module")
def description(service: RunningService, height_map: Path) -> Any:
    """The description, with a part's id that exists in every other path."""
    scan = {"scan": ("K7.npz", height_map.read_bytes())}
    part = httpx.post(f"{service.url}/v1/parts", files=scan, timeout=60.0).json()
    schema = schemathesis.openapi.from_url(f"{service.url}/openapi.json")

    @schema.hook
    def map_path_parameters(context: Any, path_parameters: Any) -> Any:
        if path_parameters and len(str(path_parameters.get("part_id", ""))) % 2:
            path_parameters["part_id"] = part["id"]
        return path_parameters

    return schema


def test_every_failure_is_described_as_a_problem(service: RunningService) -> None:
    paths = httpx.get(f"{service.url}/openapi.json").json()["paths"]
    described = {
        f"{verb.upper()} {path} {status}": set(response.get("content", {}))
        for path, operations in paths.items()
        for verb, operation in operations.items()
        for status, response in operation["responses"].items()
        if status[0] in "45"
    }
    assert "DELETE /v1/jobs/{name} 422" in described
    assert {key: kinds for key, kinds in described.items() if kinds != {"application/problem+json"}} == {}
    # every answer needs the store, which may fail
    operations = {
        f"{verb.upper()} {path}" for path, verbs in paths.items() for verb in verbs if "/v1/" in path
    }
    assert {name for name in operations if f"{name} 503" not in described} == set()


@pytest.mark.parametrize("mode", list(GenerationMode), ids=lambda mode: mode.value)
def test_every_request_is_answered_as_described(description: Any, mode: GenerationMode) -> None:
    asked = []
    for result in description.get_all_operations():
        operation = result.ok()
        asked.append(operation.label)

        @seed(1)
        @given(case=operation.as_strategy(generation_mode=mode))
        @settings(
            max_examples=EXAMPLES,
            deadline=None,
            phases=(Phase.explicit, Phase.generate),
            suppress_health_check=list(HealthCheck),
        )
        def answered_as_described(case: Any) -> None:
            case.call_and_validate(checks=CHECKS)

        try:
            answered_as_described()
        except Unsatisfiable:  # no wrong request exists for an operation without parameters
            assert mode is GenerationMode.NEGATIVE
    wanted = {"POST /v1/parts", "POST /v1/parts/{part_id}/scan", "POST /v1/parts/{part_id}/review"}
    assert wanted <= set(asked)
