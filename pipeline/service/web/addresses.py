"""Addresses relative to the page that holds them: they hold under any path that a proxy puts in front.

https://plant.example/marks/review/01JD...   -->   ../parts/01JD...   instead of /parts/01JD...
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from starlette.types import Scope


def to_root(scope: Scope) -> str:
    """The way from the address asked for up to the service's first page: "./", "../", "../../" ..."""
    path = scope.get("raw_path") or scope["path"].encode("utf-8", "surrogateescape")
    return "../" * (path.partition(b"?")[0].count(b"/") - 1) or "./"


def relative(scope: Scope, address: str) -> str:
    """An address of the service, such as /parts, seen from the one asked for."""
    return to_root(scope) + address.removeprefix("/")


def without_prefix(scope: Scope, root_path: str) -> Scope:
    """The request as the service's routes know it, where a proxy passes its prefix on.

    Args:
        scope: scope of the request.
        root_path: prefix of the proxy, such as /marks; empty: there is none.
    """
    if not root_path or not f"{scope['path']}/".startswith(f"{root_path}/"):
        return scope
    n = len(root_path)
    inner: dict[str, Any] = {**scope, "path": scope["path"][n:] or "/"}
    raw = scope.get("raw_path")
    if raw is not None and raw.startswith(root_path.encode()):
        inner["raw_path"] = raw[n:] or b"/"
    return inner
