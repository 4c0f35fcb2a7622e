"""Who may call: tokens with scopes, asked for wherever others than this machine can reach the service."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from itsdangerous import BadData, URLSafeTimedSerializer

from glyphs.errors import FileError, MarksError
from pipeline.common.atomic import replacing
from pipeline.common.records import Scope, TokenRecord
from pipeline.service.web.problem import Problem

if TYPE_CHECKING:
    from starlette.requests import HTTPConnection

COOKIE = "tactile_marks_token"
LOCAL = "local"
"""Name of a caller who needs no token."""
_ALL = frozenset(Scope)
_MOST_SECRET = 200
SIGNED_IN_S = 12 * 3600
"""A shift."""


class DeniedError(MarksError):
    """A request that is not allowed.

    Attributes:
        status: 401 where a token is missing or no good, 403 where it does not allow this.
    """

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


@dataclass(frozen=True)
class Caller:
    """Whoever makes a request.

    Attributes:
        name: of the token; "local" where none is asked for.
        scopes: what it allows.
        token: name of the token; empty without one.
    """

    name: str
    scopes: frozenset[Scope]
    token: str = ""


class Tokens(Protocol):
    """Where tokens are kept: `pipeline.store.store.Store` is one."""

    def token(self, secret: str) -> TokenRecord | None:
        """The token of a secret that holds now."""

    def token_named(self, name: str) -> TokenRecord | None:
        """The token of a name that holds now."""


class Access:
    """Tells who calls, by the header `Authorization: Bearer tm_...` or by the operator page's cookie.

    * The cookie holds the token's name, signed, and never its secret; it ends with the token, or after a shift.
    * `token_of` is asked once a request, at the door; the routes ask `caller`, which remembers.
    """

    COOKIE = COOKIE

    def __init__(self, tokens: Tokens, *, required: bool, key: bytes) -> None:
        """Take what tokens are checked by.

        Args:
            tokens: where they are kept.
            required: whether callers need one.
            key: that cookies are signed with.
        """
        self._tokens, self.required = tokens, required
        self._cookies = URLSafeTimedSerializer(key, salt="tactile-marks page")

    def caller(self, request: HTTPConnection, scope: Scope) -> Caller:
        """Who calls, if that is allowed.

        Raises:
            DeniedError: no token, one that does not hold, or one without the scope.
        """
        record: TokenRecord | None = getattr(request.state, "token", None)
        if record is None:
            try:
                record = self.token_of(request)
            except DeniedError:
                if self.required:
                    raise
                return Caller(LOCAL, _ALL)  # none is needed; it may have an old cookie, say
        if scope not in record.scopes:
            held = ", ".join(sorted(record.scopes)) or "nothing"
            raise DeniedError(403, f"the token {record.name!r} allows {held}, and this needs {scope.value}")
        return Caller(record.name, record.scopes, record.name)

    def token_of(self, request: HTTPConnection) -> TokenRecord:
        """The token of a request.

        Raises:
            DeniedError: it has none, or one that does not hold.
        """
        kind, _, secret = request.headers.get("authorization", "").partition(" ")
        cookie = request.cookies.get(COOKIE, "")
        if kind.lower() == "bearer":
            record = self._token(secret.strip())
        elif cookie:
            record = self._signed_in(cookie)
        else:
            raise DeniedError(401, "a token is needed; send it as: Authorization: Bearer tm_...")
        if record is None:
            raise DeniedError(401, "the token is not known, has expired or was revoked; ask for another")
        return record

    def log_in(self, secret: str) -> str | None:
        """The cookie's value for a token typed in; None if it does not hold."""
        record = self._token(secret.strip())
        return None if record is None else str(self._cookies.dumps(record.name))

    def _token(self, secret: str) -> TokenRecord | None:
        return self._tokens.token(secret) if len(secret) <= _MOST_SECRET else None

    def _signed_in(self, cookie: str) -> TokenRecord | None:
        try:
            name = self._cookies.loads(cookie, max_age=SIGNED_IN_S)
        except BadData:
            return None
        return self._tokens.token_named(name)


def session_key(path: Path) -> bytes:
    """The key that cookies are signed with: in a file that nobody else can read, so that a restart signs nobody out.

    Raises:
        FileError: it cannot be read or written.
    """
    try:
        if not path.exists():
            with replacing(path, private=True) as temporary:
                temporary.write_bytes(secrets.token_bytes(32))
        return path.read_bytes()
    except OSError as error:
        raise FileError(
            path, f"cannot be used ({error.strerror})", "check that the service's folder can be written"
        ) from error


def denied_problem(error: DeniedError, *, headers: Mapping[str, str] | None = None) -> Problem:
    """The answer to a caller who may not."""
    asked = {"WWW-Authenticate": "Bearer"} if error.status == 401 else {}
    return Problem(error.status, str(error), headers={**asked, **(headers or {})})
