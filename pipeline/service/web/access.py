"""Access control: tokens with scopes, required of every caller but the user that runs the service (on Linux)."""

from __future__ import annotations

import ipaddress
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.common.people_records import Person
from pipeline.common.records import Scope, TokenRecord
from pipeline.service.web.problem import Problem

if TYPE_CHECKING:
    from starlette.requests import HTTPConnection

    from pipeline.store.store import Store

COOKIE = "tactile_marks_token"
_NEEDED = "a token is needed; send it as: Authorization: Bearer tm_..."
_NEEDED_OF_OTHERS = (
    "a token is needed, for the request comes from a program of another user than the service's, such as a proxy; make "
    "one with `tactile-marks tokens add` and send it as: Authorization: Bearer tm_..."
)

_PROC = Path("/proc/net")
# a socket that its program has closed has no user
_ESTABLISHED = "01"
# columns of the table
_LOCAL, _REMOTE, _STATE, _UID = 1, 2, 3, 7


class DeniedError(Problem):
    """A request that is not allowed: 401 if a token is missing or invalid, 403 if it lacks the scope."""

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(status, detail, headers={"WWW-Authenticate": "Bearer"} if status == 401 else None)


@dataclass(frozen=True)
class Caller:
    """Caller of a request, with the scopes of its token; all scopes and no token name if none is required."""

    scopes: frozenset[Scope]
    token: str = ""

    def person(self, who: str = "") -> Person:
        return Person(self.token or who, token=self.token)


class Access:
    """Identify the caller by the header `Authorization: Bearer tm_...` or by the operator page's cookie, a session that
    the store keeps. `token_of` is asked once a request, at the door; the routes ask `caller`."""

    def __init__(self, store: Store, *, required: bool, own_user: bool = False) -> None:
        """`own_user`: whether callers of other users of this machine need a token, as the door has found them."""
        self._store, self.required, self.own_user = store, required, own_user

    def needs_token(self, request: HTTPConnection) -> bool:
        return self.required or bool(getattr(request.state, "other_user", False))

    def caller(self, request: HTTPConnection, *scopes: Scope) -> Caller:
        """The caller, if one of the scopes allows the request. Raises DeniedError: no token, or no such scope."""
        record: TokenRecord | None = getattr(request.state, "token", None)
        if record is None:
            try:
                record = self.token_of(request)
            except DeniedError:
                if self.needs_token(request):
                    raise
                return Caller(frozenset(Scope))  # none is needed; perhaps it has an old cookie
        if record.scopes.isdisjoint(scopes):
            held, needed = ", ".join(sorted(record.scopes)) or "nothing", " or ".join(scopes)
            raise DeniedError(403, f"the token {record.name!r} allows {held}, and this needs {needed}")
        return Caller(record.scopes, record.name)

    def token_of(self, request: HTTPConnection) -> TokenRecord:
        kind, _, secret = request.headers.get("authorization", "").partition(" ")
        bearer, cookie = kind.lower() == "bearer", request.cookies.get(COOKIE, "")
        if not (bearer or cookie):
            raise DeniedError(401, _NEEDED if self.required else _NEEDED_OF_OTHERS)
        record = self._store.token(secret.strip()) if bearer else self._store.session_token(cookie)
        if record is None:
            raise DeniedError(401, "the token is not known, has expired or was revoked; ask for another")
        return record


def is_in(address: str, networks: Iterable[str]) -> bool:
    """Whether an address is in one of the networks, such as 10.0.0.0/8; False if it is not an address."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return False
    parsed = getattr(parsed, "ipv4_mapped", None) or parsed
    return any(parsed in ipaddress.ip_network(network) for network in networks)


def is_own_user(client: tuple[str, int], server: tuple[str, int]) -> bool:
    """Whether a connection is of the user that runs this program; True where that cannot be seen."""
    uid = user_of(client, server)
    return uid is None or uid == os.geteuid()


def user_of(client: tuple[str, int], server: tuple[str, int]) -> int | None:
    """User id of the program at the client's end; -1 if no open socket here is it, None where that cannot be seen."""
    if sys.platform != "linux":
        return None
    try:
        address = ipaddress.ip_address(client[0])
        table = (_PROC / ("tcp" if address.version == 4 else "tcp6")).read_text(encoding="ascii")
        wanted = (_in_hex(*client[:2]), _in_hex(*server[:2]), _ESTABLISHED)
    except (OSError, ValueError):
        return None
    for line in table.splitlines()[1:]:
        row = line.split()
        if (row[_LOCAL], row[_REMOTE], row[_STATE]) == wanted:
            return int(row[_UID])
    return -1


def _in_hex(host: str, port: int) -> str:
    """An address in the form of the table: words of 32 bits in the machine's byte order."""
    packed = ipaddress.ip_address(host).packed
    words = (packed[k : k + 4] for k in range(0, len(packed), 4))
    shown = "".join(f"{int.from_bytes(word, sys.byteorder):08X}" for word in words)
    return f"{shown}:{port:04X}"
