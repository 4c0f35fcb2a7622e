"""A service whose workers cannot start: parts are answered with the cause, and so is whoever asks if it is ready."""

from __future__ import annotations

from pathlib import Path

import httpx

from tests.contract.front_doors import run_service
from tests.support.waiting import wait_until


def test_parts_are_answered_with_the_cause_while_no_worker_can_start(
    tmp_path: Path, height_map: Path
) -> None:
    options = ("--jobs", "1", "--format", "A9", "--tokens", "off", "--worker-memory-mb", "40")
    with (
        run_service(tmp_path, *options, ready=False) as service,
        httpx.Client(base_url=service.url, timeout=120.0) as http,
    ):
        part = http.post("/v1/parts", files={"scan": ("part.npz", height_map.read_bytes())})
        assert part.status_code == 503
        assert "start: " in part.json()["detail"]
        assert int(part.headers["Retry-After"]) > 0
        wait_until(lambda: "no worker can start: " in http.get("/readyz").text, service.process)
        ready = http.get("/readyz")
        assert ready.status_code == 503
        assert "it may use 40 MB of memory" in ready.json()["detail"]
        assert http.get("/healthz").status_code == 200
