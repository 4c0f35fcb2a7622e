"""Who may call: tokens with scopes, asked for wherever others than this machine can reach the service."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from glyphs.errors import MarksError
from pipeline.common.records import Scope, TokenRecord

if TYPE_CHECKING:
    from starlette.requests import Request

COOKIE = "tactile_marks_token"
LOCAL = "local"
"""Name of a caller who needs no token."""
_ALL = frozenset(Scope)
_MOST_SECRET = 200


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
    """

    name: str
    scopes: frozenset[Scope]


class Tokens(Protocol):
    """Where tokens are kept: `pipeline.store.store.Store` is one."""

    def token(self, secret: str) -> TokenRecord | None:
        """The token of a secret that holds now."""


class Access:
    """Tells who calls, by the header `Authorization: Bearer tm_...` or the operator page's cookie."""

    COOKIE = COOKIE

    def __init__(self, tokens: Tokens, *, required: bool) -> None:
        self._tokens, self.required = tokens, required

    def caller(self, request: Request, scope: Scope) -> Caller:
        """Who calls, if that is allowed.

        Raises:
            DeniedError: no token, one that does not hold, or one without the scope.
        """
        secret = _secret(request)
        if not self.required and not secret:
            return Caller(LOCAL, _ALL)
        if not secret:
            raise DeniedError(401, "a token is needed; send it as: Authorization: Bearer tm_...")
        record = self._tokens.token(secret) if len(secret) <= _MOST_SECRET else None
        if record is None:
            if not self.required:
                return Caller(LOCAL, _ALL)  # an old cookie, say
            raise DeniedError(401, "the token is not known, has expired or was revoked; ask for another")
        if scope not in record.scopes:
            held = ", ".join(sorted(record.scopes)) or "nothing"
            raise DeniedError(403, f"the token {record.name!r} allows {held}, and this needs {scope.value}")
        return Caller(record.name, record.scopes)

    def log_in(self, secret: str) -> str | None:
        """The cookie's value for a token typed in; None if it does not hold."""
        secret = secret.strip()
        known = len(secret) <= _MOST_SECRET and self._tokens.token(secret) is not None
        return secret if known else None


def _secret(request: Request) -> str:
    header = request.headers.get("authorization", "")
    kind, _, secret = header.partition(" ")
    if kind.lower() == "bearer":
        return secret.strip()
    return request.cookies.get(COOKIE, "")
