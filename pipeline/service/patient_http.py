"""HTTP that waits and asks again, for the client.

* A request that finds the service busy waits as long as the answer says, and is sent again.
* One whose connection is lost is sent again where that cannot do anything twice.
* All of it ends after the patience counted from the first attempt.
"""

from __future__ import annotations

import random
import ssl
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.errors import MarksError, MissingExtraError
from pipeline.service.retry_after import retry_after_s

if TYPE_CHECKING:
    import httpx

Source = Path | str | bytes
"""A file, or what it holds."""
_BUSY = (429, 502, 503, 504)
_FIRST_WAIT_S = 0.25
_LONGEST_WAIT_S = 20.0


class ServiceError(MarksError):
    """The service refuses a request, or cannot be reached.

    Attributes:
        status: of HTTP; 0 where there was no answer.
        problem: what the answer says, as RFC 9457 has it; empty where it says nothing.
    """

    def __init__(self, status: int, problem: Mapping[str, Any], message: str = "") -> None:
        words = message or problem.get("detail") or problem.get("title") or "the service says no more"
        super().__init__(f"{status}: {words}" if status else str(words))
        self.status, self.problem = status, dict(problem)


class PatientHttp:
    """Requests to one service; threads may share it."""

    def __init__(
        self, url: str, token: str | None, *, timeout_s: float, patience_s: float, ca_file: Path | None
    ) -> None:
        """Make ready; nothing is sent yet.

        Args:
            url: of the service, http://127.0.0.1:8417.
            token: tm_..., where the service asks for one. Over plain http anybody on the way can read it.
            timeout_s: for one answer.
            patience_s: for asking again, counted from the first attempt; 0: ask once.
            ca_file: certificates of authorities to trust, instead of the usual ones.

        Raises:
            MissingExtraError: httpx is not installed.
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
        # no redirects and no proxies of the environment: the token goes to the service and nowhere else
        self._http = httpx.Client(
            base_url=url, headers=headers, timeout=timeout_s, verify=trusted, trust_env=False
        )

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def send(
        self,
        method: str,
        path: str,
        *,
        files: Sequence[tuple[str, tuple[Source, str]]] = (),
        repeatable: bool = True,
        **request: Any,
    ) -> httpx.Response:
        """Send a request, with retries where they help.

        Args:
            method: HTTP method.
            path: path on the service.
            files: each with its field, and the name to send where it is not a file.
            repeatable: whether the request is idempotent; if not, it is sent again only if it surely was not carried
                out.
            request: further arguments of httpx.

        Raises:
            ServiceError: refused, or not reached in time.
            OSError: a file cannot be read.
        """
        import httpx

        until, attempt = time.monotonic() + self._patience_s, 0
        while True:
            attempt += 1
            wait_s = 0.0
            try:
                with ExitStack() as opened:
                    if files:
                        request["files"] = [(key, _opened(opened, *file)) for key, file in files]
                    answer = self._http.request(method, path, **request)
            except httpx.TransportError as error:
                # without a connection nothing was sent
                safe = repeatable or isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)
                failure = ServiceError(0, {}, f"the service is not reached: {error or repr(error)}")
            else:
                if answer.is_success:
                    return answer
                failure = _refused(answer)
                asked_to_wait = "retry-after" in answer.headers
                safe = answer.status_code in _BUSY and (asked_to_wait or repeatable)
                wait_s = retry_after_s(answer.headers)
            wait_s = max(wait_s, min(_LONGEST_WAIT_S, _FIRST_WAIT_S * 2.0 ** (attempt - 1)))
            wait_s *= 1.0 + 0.25 * random.random()  # many clients that were refused together come back apart
            if not safe or time.monotonic() + wait_s > until:
                raise failure
            time.sleep(wait_s)


def _opened(stack: ExitStack, source: Source, name: str) -> tuple[str, Any]:
    if isinstance(source, bytes):
        return name, source
    path = Path(source)
    return path.name, stack.enter_context(path.open("rb"))


def _refused(answer: httpx.Response) -> ServiceError:
    try:
        problem = answer.json()
    except ValueError:
        problem = {}
    if not isinstance(problem, dict):
        problem = {}
    if not problem and answer.has_redirect_location:
        return ServiceError(answer.status_code, {}, f"the service has moved to {answer.headers['location']}")
    return ServiceError(answer.status_code, problem, "" if problem else answer.reason_phrase)
