"""Script, style and icon of the pages: read once, served from memory under addresses that change with them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from importlib.resources import files

from starlette.requests import Request
from starlette.responses import Response

_MEDIA_TYPES = {
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
_A_YEAR_S = 365 * 24 * 3600


@dataclass(frozen=True)
class StaticFile:
    """One file.

    Attributes:
        content: bytes.
        media_type: for the browser.
        tag: of the content.
    """

    content: bytes
    media_type: str
    tag: str


class StaticFiles:
    """The files of `static`; no other name answers, so no path can lead out."""

    def __init__(self) -> None:
        self._files = {
            found.name: StaticFile(
                found.read_bytes(),
                _MEDIA_TYPES[found.name.rpartition(".")[2]],
                hashlib.sha256(found.read_bytes()).hexdigest()[:16],
            )
            for found in files("pipeline.service.pages").joinpath("static").iterdir()
            if found.name.rpartition(".")[2] in _MEDIA_TYPES
        }

    def address(self, name: str) -> str:
        """Where a page finds it; another content has another address."""
        return f"/static/{name}?v={self._files[name].tag}"

    def answer(self, request: Request, name: str) -> Response:
        """The file; 304 where the browser has it, 404 where there is none."""
        found = self._files.get(name)
        if found is None:
            return Response("no such file\n", status_code=404, media_type="text/plain")
        lasting = request.query_params.get("v") == found.tag
        headers = {
            "Cache-Control": f"public, max-age={_A_YEAR_S}, immutable" if lasting else "no-cache",
            "ETag": f'"{found.tag}"',
            "X-Content-Type-Options": "nosniff",
        }
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        return Response(found.content, media_type=found.media_type, headers=headers)
