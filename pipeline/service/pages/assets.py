"""Script, style and icon of the pages, under addresses that change with what they hold."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

_A_YEAR_S = 365 * 24 * 3600


class Assets(StaticFiles):
    """The files of `static`; a browser keeps what it was given under a file's own address, and asks again else."""

    def __init__(self) -> None:
        super().__init__(packages=[(__package__, "static")])
        folder = Path(self.all_directories[0])
        self._tags = {f.name: hashlib.sha256(f.read_bytes()).hexdigest()[:16] for f in folder.iterdir()}

    def address(self, name: str) -> str:
        """Where a page finds a file; another content has another address."""
        return f"/static/{name}?v={self._tags[name]}"

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """The file, or 304 where the browser has it."""
        answer = super().file_response(full_path, stat_result, scope, status_code)
        lasting = scope["query_string"] == f"v={self._tags.get(Path(full_path).name)}".encode()
        answer.headers["Cache-Control"] = f"public, max-age={_A_YEAR_S}, immutable" if lasting else "no-cache"
        return answer
