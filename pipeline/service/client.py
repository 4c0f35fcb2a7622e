"""The service from Python.

with Client("http://127.0.0.1:8417", token="tm_...") as client:
    part = client.read(photo="part.png", name="tray-7/part-3")
    if part.plan is not None:
        part = client.add_scan(part.id, "part.h5")
    print(part.text, part.state)

A part is sent with an idempotency key, so it becomes one part however often it is sent (`patient_http`).
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from pipeline.common.reading_records import from_json
from pipeline.common.records import History, PartRecord, PartState, ReviewAction
from pipeline.service.patient_http import PatientHttp, ServiceError, Source

if TYPE_CHECKING:
    import httpx

__all__ = ["Client", "ServiceError"]

T = TypeVar("T")
Which = Literal["photo", "edges", "boxes"]


class Client:
    """Speaks to a service; threads may share it."""

    def __init__(
        self,
        url: str,
        token: str | None = None,
        *,
        timeout_s: float = 120.0,
        patience_s: float = 60.0,
        ca_file: Path | None = None,
    ) -> None:
        """Make ready; nothing is sent yet. Arguments as `PatientHttp`.

        Raises:
            MissingExtraError: httpx is not installed.
        """
        self._http = PatientHttp(url, token, timeout_s=timeout_s, patience_s=patience_s, ca_file=ca_file)

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def read(
        self,
        photo: Source | Sequence[Source] | None = None,
        scan: Source | None = None,
        *,
        name: str = "",
        expected: str = "",
        database: str = "",
        job: str = "",
        touch: Literal["asked", "stage", "plan"] = "asked",
        idempotency_key: str | None = None,
    ) -> PartRecord:
        """Have a part read from its photograph, its scan, or both.

        Args:
            photo: PNG, JPEG, BMP, TIFF, WebP or GIF; or several of the part under different lights, read as one.
            scan: recording (.h5) or height map (.npz, .x3p, .sdf, .sur ...); bytes are taken for a recording.
            name: name of the part on the line.
            expected: expected text.
            database: glyph database to read with.
            job: job with the settings of reading, database included.
            touch: what happens if the camera is unsure. "stage": the service's stage feels the part at once. "asked":
                the stage feels it after a call of `touch`. Without a stage a person gets the part in both cases.
                "plan": this program will send a scan, by the answer's plan.
            idempotency_key: key of this part (default: a new one). With a key that is stored with the part, the part
                can be sent again even after a restart of this program.

        Raises:
            ServiceError: the request was refused, or the service was not reached in time.
            ValueError: neither photograph nor scan is given.
            OSError: a file cannot be read.
        """
        fields = {"name": name, "expected": expected, "database": database, "job": job, "touch": touch}
        photos = [photo] if isinstance(photo, (str, bytes, Path)) else list(photo or ())
        files = [("photo", (one, "photo")) for one in photos]
        if scan is not None:
            files.append(("scan", (scan, "scan.h5")))
        if not files:
            raise ValueError("give a photograph, a scan, or both")
        answer = self._http.send(
            "POST",
            "/v1/parts",
            data={key: value for key, value in fields.items() if value},
            files=files,
            headers={"idempotency-key": idempotency_key or secrets.token_urlsafe(24)},
        )
        return _record(PartRecord, answer)

    def verify(
        self,
        expected: str,
        photo: Source | Sequence[Source] | None = None,
        scan: Source | None = None,
        **options: Any,
    ) -> PartRecord:
        """Read a part and compare it with the expected text; `part.reading.verdict` is the result.

        Raises:
            ServiceError, ValueError, OSError: as `read`; also if the text is empty.
        """
        if not expected.strip():
            raise ValueError("give the text that the part should read")
        return self.read(photo, scan, expected=expected, **options)

    def add_scan(self, part_id: str, scan: Source, *, idempotency_key: str | None = None) -> PartRecord:
        """Add a scan of a part; the answer is read from both.

        Raises:
            ServiceError: refused, or not reached in time.
            OSError: the file cannot be read.
        """
        answer = self._http.send(
            "POST",
            f"{_path(part_id)}/scan",
            files=[("scan", (scan, "scan.h5"))],
            headers={"idempotency-key": idempotency_key or secrets.token_urlsafe(24)},
        )
        return _record(PartRecord, answer)

    def touch(self, part_id: str) -> PartRecord:
        """Have the service's own stage scan a part that waits for touch.

        Raises:
            ServiceError: refused, or not reached in time.
        """
        return _record(PartRecord, self._http.send("POST", f"{_path(part_id)}/touch", repeatable=False))

    def review(
        self,
        part_id: str,
        *,
        action: ReviewAction,
        text: str = "",
        who: str,
        note: str = "",
        before: str | None = None,
    ) -> PartRecord:
        """Review a part: confirm or correct its serial, or mark it unreadable.

        Args:
            part_id: id of the part.
            action: confirm, correct or unreadable.
            text: the correct serial.
            who: name of the reviewer.
            note: free text.
            before: the text that the reviewer saw; if it has changed since, a ServiceError of status 409 is raised.

        Raises:
            ServiceError: refused, or not reached in time.
        """
        body = {"action": ReviewAction(action).value, "text": text, "who": who, "note": note}
        if before is not None:
            body["before"] = before
        return _record(
            PartRecord, self._http.send("POST", f"{_path(part_id)}/review", json=body, repeatable=False)
        )

    def part(self, part_id: str) -> PartRecord:
        """A part as it stands.

        Raises:
            ServiceError: there is none, or the service is not reached in time.
        """
        return _record(PartRecord, self._http.send("GET", _path(part_id)))

    def parts(
        self,
        *,
        state: PartState | None = None,
        text: str = "",
        name: str = "",
        before: str | None = None,
        limit: int = 50,
    ) -> tuple[PartRecord, ...]:
        """Parts, newest first.

        Args:
            state: only these.
            text: that the serial holds.
            name: that the name holds.
            before: id of the last part of the page before.
            limit: most parts.

        Raises:
            ServiceError: refused, or not reached in time.
        """
        wanted = {"state": state.value if state else "", "text": text, "name": name, "before": before or ""}
        query = {key: value for key, value in wanted.items() if value}
        answer = self._http.send("GET", "/v1/parts", params={**query, "limit": str(limit)})
        return _record(tuple[PartRecord, ...], answer)

    def history(self, part_id: str) -> History:
        """All that happened to a part.

        Raises:
            ServiceError: there is none, or the service is not reached in time.
        """
        return _record(History, self._http.send("GET", f"{_path(part_id)}/history"))

    def picture(self, part_id: str, which: Which) -> bytes:
        """A picture of a part, JPEG or PNG: as photographed, as scanned, or with the characters' boxes.

        Raises:
            ServiceError: there is none, or the service is not reached in time.
        """
        return self._http.send("GET", f"{_path(part_id)}/pictures/{which}").content


def _path(part_id: str) -> str:
    if not (part_id.isascii() and part_id.isalnum()):
        raise ServiceError(404, {}, f"{part_id!r} is not a part's id")
    return f"/v1/parts/{part_id}"


def _record(kind: type[T], answer: httpx.Response) -> T:
    try:
        return from_json(kind, answer.json())
    except ValueError as error:
        raise ServiceError(
            answer.status_code,
            {},
            "the answer is not understood; is there a service of this version at the url?",
        ) from error
