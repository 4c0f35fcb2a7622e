"""A service with people at its pages, and records to show there."""

from __future__ import annotations

import contextlib
import html
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
from starlette.testclient import TestClient

from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartState
from pipeline.common.settings import ReadSettings
from tests.support.service_fixtures import inline_service

MM, WIDTH, HEIGHT = 0.05, 800.0, 200.0
META = {"x0_mm": 1.0, "y0_mm": 2.0, "mm_per_pixel": MM, "width": WIDTH, "height": HEIGHT}
HIDDEN = re.compile(r'<input type="hidden" name="([^"]+)" value="([^"]*)"')


def character(
    char: str, place: int = 0, *, state: str = "read", probability: float = 0.99, rivals: str = ""
) -> CharacterRecord:
    """A character as it was read, beside one rival, or confused with several."""
    x_mm = 3.0 + 4.0 * place
    chars, shares = char + ("8" if char == "B" else "B"), (probability, 1.0 - probability)
    if rivals:
        chars, shares, state = char + rivals, (0.5, 0.3, 0.1, 0.05, 0.02), "confused"
    candidates = (CandidateRecord(c, share, 0.5) for c, share in zip(chars, shares, strict=False))
    return CharacterRecord(tuple(candidates), (x_mm, 4.0, x_mm + 3.0, 9.0), state)


def reading(text: str, *, source: str = "fused", decision: str = "review", **more: object) -> ReadingRecord:
    places = tuple(character(c, k) for k, c in enumerate(text.replace(" ", "")))
    made = ReadingRecord(source, text, decision, 0.8, places, ("low confidence",))
    return replace(made, **more)  # type: ignore[arg-type]


class Shop:
    """A service whose parts nobody reads, and a person at its pages."""

    def __init__(self, folder: Path, **settings: Any) -> None:
        self._open = contextlib.ExitStack()
        served = inline_service(folder, reading=ReadSettings(), **settings)
        service, client = self._open.enter_context(served)
        self.app, self.store = client.app, service.store
        self.evidence, self.jobs = service.evidence, service.jobs
        self.client = self.another()

    def close(self) -> None:
        """End the service."""
        self._open.close()

    def another(self) -> TestClient:
        """Another person's browser."""
        return TestClient(
            self.app,
            base_url="http://127.0.0.1:8417",
            follow_redirects=False,
            headers={"Accept": "text/html"},
        )

    def add(
        self,
        text: str = "KX407251",
        *,
        name: str = "P-1",
        state: PartState = PartState.REVIEW,
        readings: tuple[ReadingRecord, ...] | None = None,
        evidence: tuple[EvidenceRecord, ...] = (),
        **more: Any,
    ) -> str:
        given = (reading(text),) if readings is None else readings
        part_id = new_part_id()
        self.store.add_part(
            part_id=part_id, name=name, state=state, readings=given, evidence=evidence, **more
        )
        return part_id

    def pictures(self) -> tuple[EvidenceRecord, EvidenceRecord]:
        """A photograph and an edge map."""
        return self.keep(EvidenceKind.PHOTO_PICTURE, b"photo"), self.keep(
            EvidenceKind.EDGES_PICTURE, b"edges"
        )

    def keep(self, kind: EvidenceKind, content: bytes) -> EvidenceRecord:
        path = self.evidence.incoming / "made.png"
        path.write_bytes(content)
        sha256, n_bytes = self.evidence.keep(path)
        return EvidenceRecord(kind, sha256, n_bytes, "made.png", "image/png", META)

    def say(
        self,
        part_id: str,
        text: str,
        *,
        before: str | None = None,
        who: str = "Ada",
        client: TestClient | None = None,
        **more: str,
    ) -> int:
        """Open a part's page and send its form, as a browser would."""
        client = client or self.client
        page = client.get(f"/review/{part_id}").text
        hidden = {name: html.unescape(value) for name, value in HIDDEN.findall(page)}
        data = {**hidden, "text": text, "who": who, "action": "save", **more}
        self.answer = client.post(
            f"/review/{part_id}", data=data if before is None else {**data, "before": before}
        )
        return self.answer.status_code


def goes_to(answer: httpx.Response) -> str:
    """Where an answer sends the browser, as an address of the service."""
    return answer.url.join(answer.headers["location"]).raw_path.decode()
