"""Python client of the service.

with Client("http://127.0.0.1:8417", token="tm_...") as client:
    part = client.read(photo="part.png", name="tray-7/part-3")
    if part.plan is not None:
        part = client.add_scan(part.id, "part.h5")
    print(part.text, part.state)

Every part is sent with an idempotency key: it becomes one part, even if it is sent several times. Requests are sent
again while the service is busy, or if the connection is lost and they cannot have an effect twice, for `patience_s`.
"""

from __future__ import annotations

import contextlib
import random
import secrets
import ssl
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from glyphs.errors import MarksError, MissingExtraError
from pipeline.common.reading_records import from_json
from pipeline.common.records import History, PartRecord, PartState, ReviewAction

if TYPE_CHECKING:
    import httpx

__all__ = ["Client", "ServiceError"]

T = TypeVar("T")
Which = Literal["photo", "edges", "boxes"]
# path of a file, or its content as bytes
Source = Path | str | bytes
_BUSY = (429, 502, 503, 504)
_FIRST_WAIT_S = 0.25
_LONGEST_WAIT_S = 20.0


class ServiceError(MarksError):
    """The service refused a request, or could not be reached (`status` 0); `problem` is that of RFC 9457."""

    is_usage = False

    def __init__(self, status: int, problem: Mapping[str, Any], message: str = "") -> None:
        words = message or problem.get("detail") or problem.get("title") or "the service gives no reason"
        super().__init__(f"{status}: {words}" if status else str(words))
        self.status, self.problem = status, dict(problem)


class Client:
    """A connection to a service; threads may share it. Requests raise ServiceError: refused, or no answer in time."""

    def __init__(
        self,
        url: str,
        token: str | None = None,
        *,
        timeout_s: float = 120.0,
        patience_s: float = 60.0,
        ca_file: Path | None = None,
    ) -> None:
        """Prepare the connection. Raises MissingExtraError: httpx is not installed.

        Args:
            url: address of the service, such as http://127.0.0.1:8417.
            token: tm_..., if the service asks for one. Over plain http anybody on the network path can read it.
            timeout_s: longest wait for one answer, s.
            patience_s: time for retries, counted from the first attempt, s; 0 sends once.
            ca_file: certificates of the authorities to trust (default: those of the system).
        """
        try:
            import httpx
        except ImportError as error:
            raise MissingExtraError("the client", "httpx", "service") from error
        self._patience_s = patience_s
        trusted = ssl.create_default_context(cafile=str(ca_file)) if ca_file is not None else True
        headers = {"user-agent": "tactile-marks", "accept": "application/json"}
        if token:
            headers["authorization"] = f"Bearer {token}"
        # no redirects and no proxies of the environment, so that the token goes only to the service
        self._http = httpx.Client(
            base_url=url, headers=headers, timeout=timeout_s, verify=trusted, trust_env=False
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
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
        """Read a part from its photograph, its scan, or both. Raises ValueError: there is neither. OSError: no such
        file.

        Args:
            photo: PNG, JPEG, BMP, TIFF, WebP or GIF; or several photographs under different lights, read as one.
            scan: recording (.h5) or height map (.npz, .x3p, .sdf, .sur ...); bytes are read as a recording.
            expected: text that the part should read; `part.reading.verdict` then says whether it does.
            job: job that holds the read settings, database included.
            touch: what happens if the camera is unsure. "stage": the service's stage feels the part at once. "asked":
                the stage feels it after a call of `touch`. Without a stage, both send the part to a person.
                "plan": your program sends a scan that follows the plan in the answer.
            idempotency_key: key of this part (default: a new one); with a stored key it can be sent again after a
                restart.
        """
        fields = {"name": name, "expected": expected, "database": database, "job": job, "touch": touch}
        photos = [photo] if isinstance(photo, (str, bytes, Path)) else list(photo or ())
        files = [("photo", _read(picture, "photo")) for picture in photos]
        if scan is not None:
            files.append(("scan", _read(scan, "scan.h5")))
        if not files:
            raise ValueError("give a photograph, a scan, or both")
        data = {key: value for key, value in fields.items() if value}
        return self._send_files("/v1/parts", files, idempotency_key, data=data)

    def add_scan(self, part_id: str, scan: Source, *, idempotency_key: str | None = None) -> PartRecord:
        """Add a scan to a part, which is then read from both. Raises OSError: the file cannot be read."""
        return self._send_files(f"{_path(part_id)}/scan", [("scan", _read(scan, "scan.h5"))], idempotency_key)

    def touch(self, part_id: str) -> PartRecord:
        return _record(PartRecord, self._send("POST", f"{_path(part_id)}/touch", repeatable=False))

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
        """Review a part. Raises ServiceError: 409, the text is no longer the one that the reviewer saw (`before`)."""
        body = {
            "action": ReviewAction(action).value,
            "text": text,
            "who": who,
            "note": note,
            "before": before,
        }
        answer = self._send("POST", f"{_path(part_id)}/review", json=body, repeatable=False)
        return _record(PartRecord, answer)

    def part(self, part_id: str) -> PartRecord:
        return _record(PartRecord, self._send("GET", _path(part_id)))

    def parts(
        self,
        *,
        state: PartState | None = None,
        text: str = "",
        name: str = "",
        before: str | None = None,
        limit: int = 50,
    ) -> tuple[PartRecord, ...]:
        """List parts by serial and name, newest first, up to the part with the id `before`."""
        wanted = {"state": state.value if state else "", "text": text, "name": name, "before": before or ""}
        query = {key: value for key, value in wanted.items() if value}
        answer = self._send("GET", "/v1/parts", params={**query, "limit": str(limit)})
        return _record(tuple[PartRecord, ...], answer)

    def history(self, part_id: str) -> History:
        return _record(History, self._send("GET", f"{_path(part_id)}/history"))

    def picture(self, part_id: str, which: Which) -> bytes:
        """Get a picture of a part as JPEG or PNG: the photograph, the edge map, or the boxes of the characters."""
        return self._send("GET", f"{_path(part_id)}/pictures/{which}").content

    def _send_files(
        self, path: str, files: Sequence[tuple[str, tuple[str, bytes]]], key: str | None, **request: Any
    ) -> PartRecord:
        headers = {"idempotency-key": key or secrets.token_urlsafe(24)}
        return _record(PartRecord, self._send("POST", path, files=files, headers=headers, **request))

    def _send(self, method: str, path: str, *, repeatable: bool = True, **request: Any) -> httpx.Response:
        """Send a request; one that is not `repeatable` is sent again only if it was certainly not carried out."""
        import httpx

        until, wait_s = time.monotonic() + self._patience_s, _FIRST_WAIT_S
        while True:
            try:
                answer = self._http.request(method, path, **request)
            except httpx.TransportError as error:
                # if there was no connection, nothing was sent
                safe = repeatable or isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)
                failure = ServiceError(0, {}, f"the service was not reached: {error or error!r}")
                asked_s = 0.0
            else:
                if answer.is_success:
                    return answer
                failure, asked_s = _error_of(answer), retry_after_s(answer.headers)
                safe = answer.status_code in _BUSY and ("retry-after" in answer.headers or repeatable)
            # spread the retries of clients that were refused at the same time
            pause_s = max(wait_s, asked_s) * (1.0 + 0.25 * random.random())
            if not safe or time.monotonic() + pause_s > until:
                raise failure
            time.sleep(pause_s)
            wait_s = min(2.0 * wait_s, _LONGEST_WAIT_S)


def _read(source: Source, name: str) -> tuple[str, bytes]:
    return (name, source) if isinstance(source, bytes) else (Path(source).name, Path(source).read_bytes())


def _error_of(answer: httpx.Response) -> ServiceError:
    with contextlib.suppress(ValueError):
        if isinstance(problem := answer.json(), dict) and problem:
            return ServiceError(answer.status_code, problem)
    moved = f"the service has moved to {answer.headers['location']}" if answer.has_redirect_location else ""
    return ServiceError(answer.status_code, {}, moved or answer.reason_phrase)


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
            "the answer was not understood; check that the url is that of a service of this version",
        ) from error


def retry_after_s(headers: Mapping[str, str]) -> float:
    """Waiting time requested by a response, seconds; 0 without one in seconds."""
    text = headers.get("retry-after", "").strip()
    return float(text[:9]) if text.isascii() and text.isdigit() else 0.0
