"""Requests generated from the API's own description: no 5xx, and every answer as described."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
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

from tests.contract.front_doors import RunningService

EXAMPLES = 3
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
