"""Forms with files whose name is given as `filename*` alone (RFC 5987), as older HTTP libraries send it.

The library that takes forms apart leaves such a name out, and then takes the file for text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Coroutine
from contextlib import aclosing
from email.message import Message
from typing import Any

from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request
from starlette.responses import Response

_FIELD = "Content-Disposition"
_PLAIN_NAME = re.compile(rb";\s*filename\s*=", re.IGNORECASE)
_NOT_QUOTED = {ord(char): "_" for char in '"\\\r\n'}


def with_plain_name(disposition: bytes) -> bytes:
    """The header Content-Disposition, with the name of `filename*` as `filename` where it has none."""
    if b"filename*" not in disposition.lower() or _PLAIN_NAME.search(disposition):
        return disposition
    header = Message()
    header[_FIELD] = disposition.decode("latin-1")
    name = (header.get_filename() or "").translate(_NOT_QUOTED)
    return disposition + b'; filename="' + name.encode("utf-8", "replace") + b'"'


class _Parser(MultiPartParser):
    def on_headers_finished(self) -> None:
        part = self._current_part
        if part.content_disposition is not None:
            part.content_disposition = with_plain_name(part.content_disposition)
        super().on_headers_finished()


class FormRoute(APIRoute):
    """A route that takes files."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """FastAPI's handler, which treats every file of a form as an upload."""
        handle = super().get_route_handler()

        async def handle_form(request: Request) -> Response:
            if request.headers.get("content-type", "").lower().startswith("multipart/form-data"):
                try:
                    async with aclosing(request.stream()) as stream:
                        request._form = await _Parser(request.headers, stream).parse()
                except MultiPartException as error:
                    raise HTTPException(status_code=400, detail=error.message) from error
            return await handle(request)

        return handle_form
