"""schemathesis against the description of the interface: whatever is sent, no 5xx, and every answer as described."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from glyphs.surface.maps import HeightMap
from pipeline.files.npz import write_npz
from tests.support.service_fixtures import inline_service

EXAMPLES = 25
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]


@pytest.fixture(scope="module")
def known_part(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, str]]:
    """The application, and the id of a part that it knows."""
    folder = tmp_path_factory.mktemp("fuzzed")
    rng = np.random.default_rng(0)
    path = folder / "noise.npz"
    write_npz(path, HeightMap(rng.normal(scale=0.01, size=(60, 90)).astype(np.float32), 0.1))
    with inline_service(folder / "service", hosts="testserver") as (_, client):
        part = client.post("/v1/parts", files={"scan": ("noise.npz", io.BytesIO(path.read_bytes()))}).json()
        yield client.app, part["id"]


@pytest.fixture
def interface(known_part: tuple[Any, str]) -> Any:
    app, part_id = known_part
    schema = schemathesis.openapi.from_asgi("/openapi.json", app)

    @schema.hook
    def map_path_parameters(context: Any, path_parameters: Any) -> Any:
        # of random ids none is ever known: every other call asks for a part that is there
        if path_parameters and len(str(path_parameters.get("part_id", ""))) % 2:
            path_parameters["part_id"] = part_id
        return path_parameters

    return schema


@pytest.mark.parametrize("mode", list(GenerationMode), ids=lambda mode: mode.value)
def test_whatever_is_sent_is_answered_as_described(interface: Any, mode: GenerationMode) -> None:
    asked = []
    for result in interface.get_all_operations():
        operation = result.ok()
        asked.append(operation.label)

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
        except Unsatisfiable:
            # what has no parameters can be sent no wrong ones
            assert mode is GenerationMode.NEGATIVE
    assert {"POST /v1/parts", "POST /v1/parts/{part_id}/scan", "POST /v1/parts/{part_id}/review"} <= set(
        asked
    )
