"""Uploads: saved under a generated name, and classified by content or name."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Coroutine, Sequence
from contextlib import aclosing
from dataclasses import dataclass
from email.message import Message
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import params
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request
from starlette.responses import Response

from glyphs.plain_text import visible
from pipeline.common.names import printable_name
from pipeline.common.records import EvidenceKind
from pipeline.formats.kinds import HEAD_BYTES, READ, file_kind, kind_of, refusal
from pipeline.service.web.problem import Problem

if TYPE_CHECKING:
    from starlette.datastructures import FormData, UploadFile

MOST_NAME = 200
# maximum number of photographs of one part
MOST_PHOTOS = 12
_CHUNK = 1 << 20
_SCAN_MAGIC = b"\x89HDF\r\n\x1a\n"
_PLAIN_NAME = re.compile(rb";\s*filename\s*=", re.IGNORECASE)
_NOT_QUOTED = {ord(char): "_" for char in '"\\\r\n'}


@dataclass(frozen=True)
class Upload:
    """An uploaded file, saved under a name of our own; `name` is the sender's, for messages only."""

    path: Path
    name: str
    kind: EvidenceKind
    sha256: str = ""

    @property
    def media_type(self) -> str:
        usual = "application/x-hdf5" if self.kind is EvidenceKind.SCAN else "application/octet-stream"
        return next((kind.media_type for kind in READ if kind.suffix == self.path.suffix), usual)


def check_count(photos: int) -> None:
    """Refuse too many photographs of a part. Raises Problem: 422."""
    if photos > MOST_PHOTOS:
        raise Problem(422, f"there are {photos} photos; {MOST_PHOTOS} of a part are allowed")


def sent_name(name: str | None) -> str:
    """The sender's name for a file: the last part of any path, printable, of bounded length."""
    last = re.split(r"[/\\]", printable_name(name or ""))[-1]
    return last[:MOST_NAME].strip() or "unnamed"


async def receive(sent: UploadFile, role: str, folder: Path, *, number: int = 1) -> Upload:
    """Write an upload into the folder. Raises Problem: 415, another kind of file; 422, an empty one."""
    import anyio.to_thread

    name = sent_name(sent.filename)
    head = await sent.read(HEAD_BYTES)
    if not head:
        raise Problem(422, f"the {role} {name!r} is empty; send it again")
    await sent.seek(0)
    path = folder / f"{role}-{number}{suffix_of(role, name, head)}"
    digest = hashlib.sha256()

    def write() -> None:
        with path.open("xb") as stream:
            while chunk := sent.file.read(_CHUNK):
                digest.update(chunk)
                stream.write(chunk)

    await anyio.to_thread.run_sync(write)
    touch = EvidenceKind.SCAN if file_kind(path.suffix) == "scan" else EvidenceKind.HEIGHT_MAP
    return Upload(path, name, EvidenceKind.PHOTO if role == "photo" else touch, digest.hexdigest())


def suffix_of(role: str, name: str, head: bytes) -> str:
    """Suffix of a photograph by its first `HEAD_BYTES`, of a scan by its name. Raises Problem: 415, another kind."""
    if role == "photo":
        kind = kind_of(head)
        if kind is None:
            raise Problem(415, f"the photo {name!r} {'; '.join(refusal(head))}")
        return kind.suffix
    suffix = Path(name).suffix.lower()
    if file_kind(suffix) in ("scan", "height_map"):
        return suffix
    if head.startswith(_SCAN_MAGIC):
        return ".h5"
    raise Problem(
        415,
        f"the scan {name!r} is of an unsupported kind; send a scan (.h5) or a height map (.npz, .x3p, .sdf, .sur ...) "
        "and let its name end so",
    )


def with_plain_name(disposition: bytes) -> bytes:
    """The header Content-Disposition, with the name of `filename*` as `filename` if it has none."""
    if b"filename*" not in disposition.lower() or _PLAIN_NAME.search(disposition):
        return disposition
    header = Message()
    header["Content-Disposition"] = disposition.decode("latin-1")
    name = (header.get_filename() or "").translate(_NOT_QUOTED)
    return disposition + b'; filename="' + name.encode("utf-8", "replace") + b'"'


class _Parser(MultiPartParser):
    def on_headers_finished(self) -> None:
        part = self._current_part
        if part.content_disposition is not None:
            part.content_disposition = with_plain_name(part.content_disposition)
        super().on_headers_finished()


class FormRoute(APIRoute):
    """A route for forms: fields that are unknown, come twice or have text for a file are refused. Files with only
    `filename*` (RFC 5987), as older HTTP libraries send them, are uploads."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()
        fields = [field for field in self.dependant.body_params if isinstance(field.field_info, params.Form)]
        known = [field.alias for field in fields]
        files = [field.alias for field in fields if isinstance(field.field_info, params.File)]

        async def handle_form(request: Request) -> Response:
            if request.headers.get("content-type", "").lower().startswith("multipart/form-data"):
                try:
                    async with aclosing(request.stream()) as stream:
                        request._form = await _Parser(request.headers, stream).parse()
                except MultiPartException as error:
                    raise HTTPException(status_code=400, detail=error.message) from error
            if known:
                try:
                    _check_fields(await request.form(), known, files)
                except Problem:
                    await request.close()
                    raise
            return await handle(request)

        return handle_form


def _check_fields(form: FormData, known: Sequence[str], files: Sequence[str]) -> None:
    for name in form:
        values = form.getlist(name)
        if name not in known:
            shown = visible(name[:MOST_NAME])
            raise Problem(422, f"there is no form field {shown!r}; there are {', '.join(known)}")
        if len(values) > 1 and name != "photo":
            raise Problem(422, f"the field {name} comes {len(values)} times; send it once")
        if name in files and any(isinstance(value, str) for value in values):
            raise Problem(422, f"{name} is text, not a file; with curl write -F {name}=@FILE")
