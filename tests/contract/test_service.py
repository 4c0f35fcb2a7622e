"""A part sent over HTTP, answered, kept, listed and shown."""

from __future__ import annotations

from pathlib import Path

import httpx

from tests.contract.front_doors import RunningService


def test_a_part_is_read_kept_and_shown(service: RunningService, height_map: Path) -> None:
    with httpx.Client(base_url=service.url, timeout=60.0) as http:
        answer = http.post(
            "/v1/parts", files={"scan": ("part.npz", height_map.read_bytes())}, data={"name": "plate-1"}
        )
        assert answer.status_code == 201, answer.text
        part = answer.json()
        assert part["name"] == "plate-1"
        assert part["reading"]["text"] == "K7"
        assert http.get(f"/v1/parts/{part['id']}").json()["reading"] == part["reading"]
        assert part["id"] in [one["id"] for one in http.get("/v1/parts").json()]
