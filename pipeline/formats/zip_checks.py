"""Check a ZIP archive before its directory is listed and its members are unpacked."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

from pipeline.errors import DataError

# largest directory of an archive: some 30,000 members, for each of which Python makes an object
MOST_DIRECTORY_BYTES = 2_000_000
# end of a directory: tag, disks, members, length, start, comment; the same in 64 bits stands before, with a pointer
_END, _END_64 = struct.Struct("<4s4H2IH"), struct.Struct("<4sQ2H2I4Q")
_POINTER_BYTES, _MOST_COMMENT_BYTES = 20, 65_535


def check_zip(
    path: Path, *, most_bytes: int | None = None, ending: str = "", hint: str = "export the map alone"
) -> None:
    """Refuse an archive of too many members, or of too many bytes in those with an ending (lower case). Raises
    DataError: it is refused (without `most_bytes` members are checked later). zipfile.BadZipFile: it is no archive."""
    with path.open("rb") as stream:
        length = stream.seek(0, 2)
        tail_bytes = min(length, _MOST_COMMENT_BYTES + _END.size + _POINTER_BYTES + _END_64.size)
        stream.seek(length - tail_bytes)
        tail = stream.read()
    place = tail.rfind(b"PK\5\6")
    if 0 <= place <= len(tail) - _END.size:
        size = _END.unpack_from(tail, place)[5]
        place_64 = place - _POINTER_BYTES - _END_64.size
        if place_64 >= 0 and tail[place_64 : place_64 + 4] == b"PK\6\6":
            size = _END_64.unpack_from(tail, place_64)[8]
        if size > MOST_DIRECTORY_BYTES:
            raise DataError("holds far more members than a height map or table", hint)
    if most_bytes is None:
        return
    with zipfile.ZipFile(path) as archive:
        members = [m for m in archive.infolist() if m.filename.lower().endswith(ending)]
    if (unpacked := sum(member.file_size for member in members)) > most_bytes:
        largest = max(members, key=lambda member: member.file_size).filename
        raise DataError(f"unpacks to {unpacked / 1e6:,.0f} MB ({largest[:50]})", hint)
