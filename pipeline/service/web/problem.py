"""Problems of requests, by RFC 9457: application/problem+json, with what is wrong and what to do.

Whatever fails becomes a problem in one place, `problem_of`: for HTTP, trigger ports and the watched folder alike.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import structlog

from glyphs.errors import FileError
from pipeline.store.errors import ConflictError, NotFoundError, StoreError, UnfitError
from whisker_array.scan.stage_error import StageError

MEDIA_TYPE = "application/problem+json"
_STATUSES = {NotFoundError: 404, ConflictError: 409, UnfitError: 422}
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


def busy(wait_s: float) -> Problem:
    """The answer while the queue of parts is full."""
    seconds = str(max(1, round(wait_s)))
    detail = f"the queue is full; as many parts wait as may; send it again in {seconds} s"
    return Problem(503, detail, headers={"Retry-After": seconds})


def problem_of(error: BaseException) -> Problem:
    """Turn a failure into a response that shows none of the service's own paths or addresses; log unexpected ones."""
    if isinstance(error, Problem):
        return error
    for kind, status in _STATUSES.items():
        if isinstance(error, kind):
            return Problem(status, str(error))
    if isinstance(error, StageError):
        return OwnProblem(str(error), retry_after_s=30) if error.later else Problem(422, str(error))
    if isinstance(error, StoreError):
        log.error("store", why=str(error))
        return OwnProblem("the store does not answer; the service's log says why")
    if isinstance(
        error, FileError | OSError
    ):  # of the service's own; what is wrong with one sent is a problem already
        log.error("files cannot be kept", why=str(error))
        detail = "the service cannot keep what was sent; its log says why; send it again later"
        return OwnProblem(detail, retry_after_s=30)
    log.error("fault of the program", exc_info=error)
    return Problem(500, "the service failed; its log says why")
