"""Addresses relative to their page, which work under any path prefix of a proxy.

https://plant.example/marks/review/01JD...   -->   ../parts/01JD...   instead of /parts/01JD...
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from starlette.types import Scope


def to_root(scope: Scope) -> str:
    """The relative path from the requested address to the service's first page: "./", "../", "../../" ..."""
    path = scope.get("raw_path") or scope["path"].encode("utf-8", "surrogateescape")
    return "../" * (path.partition(b"?")[0].count(b"/") - 1) or "./"


def relative(scope: Scope, address: str) -> str:
    """An address of the service, such as /parts, relative to the requested one."""
    return to_root(scope) + address.removeprefix("/")


def without_prefix(scope: Scope, root_path: str) -> Scope:
    """The request without a prefix that a proxy passes on.

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
