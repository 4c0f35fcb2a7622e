"""What goes wrong with a request, as RFC 9457 has it: application/problem+json, and what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

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
    503: "The service is busy",
}


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


@dataclass(frozen=True)
class ProblemBody:
    """The members of a problem, for the description of the interface."""

    title: str
    status: int
    detail: str
    request_id: str
    type: str = field(default="about:blank")
