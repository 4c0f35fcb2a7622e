"""What goes wrong with a request, as RFC 9457 has it: application/problem+json, and what to do."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import structlog

MEDIA_TYPE = "application/problem+json"
TITLES = {
    400: "The request cannot be understood",
    401: "A token is needed",
    403: "The token does not allow this",
    404: "Not found",
    405: "This address has no such method",
    409: "It has changed meanwhile",
    411: "The length of the request is missing",
    408: "The upload has stalled",
    413: "The upload is too large",
    415: "Files of this kind are not read",
    422: "What was sent cannot be used",
    429: "Too many requests",
    500: "The service failed",
    503: "The service cannot do it now",
}
log = structlog.get_logger("tactile-marks")


class Problem(Exception):  # noqa: N818 - an answer, more than an exception
    """A request that is answered with a problem.

    Attributes:
        status: of HTTP.
        detail: what is wrong and how to correct it.
        headers: of the answer.
        more: members beside those of the RFC.
    """

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        headers: dict[str, str] | None = None,
        more: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status, self.detail = status, detail
        self.headers, self.more = headers or {}, more or {}

    @property
    def is_final(self) -> bool:
        """Whether only the sender can mend it; else the same request may succeed later."""
        return self.status < 500 and self.status not in (408, 429)

    def body(self, request_id: str) -> dict[str, Any]:
        """The members of the answer."""
        title = TITLES.get(self.status, "The request failed")
        return {
            **self.more,
            "type": "about:blank",
            "title": title,
            "status": self.status,
            "detail": self.detail,
            "request_id": request_id,
        }


def without_folders(text: str) -> str:
    """The text with every absolute path cut down to its last part."""
    return re.sub(r"(?<![\w.:/])/(?:[^/\n;,'\"()]+/)+", "", text)


def stopping() -> Problem:
    """What a request is answered that comes while the service ends, or that its end cuts short."""
    detail = "the service is stopping; send it again in a moment"
    return Problem(503, detail, headers={"Retry-After": "5", "Connection": "close"})


class OwnProblem(Problem):
    """Something of the service's own that is of no use now: a file, a job, a glyph database.

    It is no verdict on what was sent, which may be sent again later.
    """

    def __init__(self, detail: str, *, retry_after_s: int = 5) -> None:
        super().__init__(503, detail, headers={"Retry-After": str(retry_after_s)})


def no_room(error: Exception) -> Problem:
    """What to say where a file of the service's own cannot be written or read: the sender has done nothing wrong."""
    log.error("files cannot be kept", why=str(error))
    detail = "the service cannot keep what was sent; its log says why; send it again later"
    return Problem(503, detail, headers={"Retry-After": "30"})


@dataclass(frozen=True)
class ProblemBody:
    """The members of a problem, for the description of the interface."""

    title: str
    status: int
    detail: str
    request_id: str
    type: str = field(default="about:blank")
