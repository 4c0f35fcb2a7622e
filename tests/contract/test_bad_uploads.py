"""Files that nobody should send, sent to a real service: no 5xx, no hang, bounded memory, and nothing of them stays."""

from __future__ import annotations

import re
import time
from itertools import islice
from pathlib import Path

import httpx

from tests.contract.front_doors import RunningService
from tests.support.bad_files import bad_maps, bad_photos, bad_scans, other_file
from tests.support.waiting import children

SLOWEST_S = 30.0
"""For one answer, on a busy machine; most come in milliseconds."""
MOST_MEMORY_MB = 3000.0
"""Of the web server and its worker together at any moment; a worker at rest has about 600, the corpus declares
terabytes."""
EACH = 24
"""One of so many: all of them are read by `tests/pipeline/reading/test_part_order_files.py`, without a service."""


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
