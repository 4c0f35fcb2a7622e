"""Problems of requests, by RFC 9457: application/problem+json, with what is wrong and what to do."""

from __future__ import annotations

import re
from dataclasses import dataclass

import structlog

MEDIA_TYPE = "application/problem+json"
log = structlog.get_logger("tactile-marks")


class Problem(Exception):  # noqa: N818 - an answer, more than an exception
    """A request that is answered with a problem.

    Attributes:
        status: of HTTP.
        detail: what is wrong and how to correct it.
        headers: of the answer.
    """

    def __init__(self, status: int, detail: str, *, headers: dict[str, str] | None = None) -> None:
        super().__init__(detail)
        self.status, self.detail, self.headers = status, detail, headers or {}

    @property
    def is_final(self) -> bool:
        """Whether only the sender can mend it; else the same request may succeed later."""
        return self.status < 500 and self.status not in (408, 429)


@dataclass(frozen=True)
class ProblemBody:
    """The members of a problem; of the type about:blank the title is the status in words."""

    title: str
    status: int
    detail: str
    request_id: str
    type: str = "about:blank"


def without_folders(text: str) -> str:
    """The text with every absolute path cut down to its last part."""
    return re.sub(r"(?<![\w.:/])/(?:[^/\n;,'\"()]+/)+", "", text)


def stopping() -> Problem:
    """The answer to a request that comes while the service stops, or that its end cuts short."""
    detail = "the service is stopping; send it again in a moment"
    return Problem(503, detail, headers={"Retry-After": "5", "Connection": "close"})


class OwnProblem(Problem):
    """Something of the service's own that cannot be used now: a file, a job, a glyph database.

    What was sent may be sent again later.
    """

    def __init__(self, detail: str, *, retry_after_s: int = 5) -> None:
        super().__init__(503, detail, headers={"Retry-After": str(retry_after_s)})


def no_room(error: BaseException) -> Problem:
    """The answer where a file of the service's own cannot be written or read: the sender has done nothing wrong."""
    log.error("files cannot be kept", why=str(error))
    detail = "the service cannot keep what was sent; its log says why; send it again later"
    return Problem(503, detail, headers={"Retry-After": "30"})


def busy(wait_s: float) -> Problem:
    """The answer while the queue of parts is full."""
    seconds = str(max(1, round(wait_s)))
    detail = f"the queue is full; as many parts wait as may; send it again in {seconds} s"
    return Problem(503, detail, headers={"Retry-After": seconds})
