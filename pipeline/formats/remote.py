"""Files named by URLs: listed, and copied to this machine for as long as they are read.

    s3://bucket/lot/a.npz --fetched--> /tmp/tactile-marks-x/height_map/a.npz --read--> gone

Credentials, endpoints and proxies are those of fsspec's file systems (AWS_ACCESS_KEY_ID, AWS_PROFILE, AWS_ENDPOINT_URL,
GOOGLE_APPLICATION_CREDENTIALS). Chains (`zip://a::s3://b`), archives and caches, which could write or open anything
else, are refused. Names are used unchanged, %20 and :: included.
"""

from __future__ import annotations

import contextlib
import errno
import re
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from glyphs.errors import FileError, MarksError, MissingExtraError
from pipeline.errors import WEB, is_url, is_web, problem_of, shown_as
from pipeline.formats.kinds import MOST_BYTES, why_not_searched
from pipeline.formats.part_files import (
    LOCAL,
    PartFiles,
    harmless_name,
    has_magic,
    local_name,
    scheme_of,
    spelling_on_disk,
    split_name,
)

_S3, _GS, _HTTP = ("s3fs", "s3"), ("gcsfs", "gs"), ("aiohttp", "cluster")
_EXTRAS = {"s3": _S3, "s3a": _S3, "gs": _GS, "gcs": _GS, **dict.fromkeys(WEB, _HTTP)}
_MORE = ("abfs", "abfss", "az", "ftp", "hdfs", "memory", "sftp", "smb", "ssh", "webhdfs")
_SCHEMES = (*LOCAL, *_EXTRAS, *_MORE)
# seconds that a server may take to connect, and between two pieces of data
_CONNECT_S, _SILENCE_S = 5.0, 20.0
_ATTEMPTS = 2
# longest copy: a start plus its size at this rate; a slower server is given up
_START_S, _LEAST_BYTES_PER_S = 60.0, 50_000.0
_NETWORK_MEND = "check the network, the endpoint and the credentials, and start it again"
# query of an address in a library's message; it may hold a signature
_QUERY = re.compile(r"\?[^\s'\"]+")


def list_remote(url: str, *, recurse: bool) -> tuple[list[tuple[str, list[str]]], dict[str, str]]:
    """List the files of a folder, or of a glob and of the folders that it matches, sorted by name.

    A URL of a file gives that file. A folder of a web server ends in a slash; its files are the links on its page, and
    its subfolders are not searched. Raises FileError, MissingExtraError as `local_copies`. Returns (folder, URLs of its
    files and of those below it) of every folder that is named, the files of a glob below an empty name; and the folders
    that were not searched, with the reason.
    """
    files = _file_system(url)
    with _as_file_errors(url):
        path = str(files._strip_protocol(url.rstrip("/")))
        if is_web(url) and url.endswith("/"):
            path += "/"
        bare, start = url.rstrip("/"), path.rstrip("/")

        def url_of(entry: dict[str, Any]) -> str:
            if bare.endswith(start):  # the names lack the beginning: s3://, sftp://host
                return bare.removesuffix(start) + str(entry["name"]).rstrip("/")
            return str(files.unstrip_protocol(str(entry["name"]).rstrip("/")))

        urls: dict[str, list[str]] = {}
        skipped: dict[str, str] = {}

        def add(root: str, path: str, entries: list[dict[str, Any]]) -> None:
            urls.setdefault(root, []).extend(sorted(url_of(entry) for entry in entries if _is_file(entry)))
            # a store may list a folder among its own entries
            folders = {str(e["name"]).rstrip("/"): url_of(e) for e in entries if not _is_file(e)}
            for below, folder in sorted(folders.items()):
                why = "" if recurse or not root else "--no-recurse"
                why = "a folder of a web server" if is_web(url) else why
                why = why_not_searched(split_name(folder)[1]) or why
                if why:
                    skipped[folder] = why
                elif below != path.rstrip("/") and "**" not in url:
                    add(root or folder, below, files.ls(below, detail=True))

        if has_magic(url):
            add("", path, list(files.glob(path, detail=True).values()))
        else:
            add(bare, path, files.ls(path, detail=True))
        return list(urls.items()), skipped


@contextlib.contextmanager
def local_copies(part: PartFiles, *, photos: bool = True) -> Iterator[PartFiles]:
    """The part with its files on this machine; copies of those named by URLs are removed on leaving.

    If the part has touch files, a photograph that cannot be copied is a problem of the photograph alone, and without
    `photos` none is copied. A part with a problem is not copied. Raises FileError: a file is missing, may not be read,
    is too long, or cannot be copied; it names the URL. MissingExtraError: a library is not installed.
    """
    if part.felt and not photos:
        part = replace(part, photos=())
    with contextlib.ExitStack() as copies:

        def here(file: str | Path, kind: str) -> str:
            name = local_name(str(file))
            if not is_url(name):
                return str(spelling_on_disk(name)) if name else ""
            if part.problem is not None or (kind == "photo" and part.photo_problem is not None):
                return name  # never opened
            return str(copies.enter_context(local_copy(name, most_bytes=MOST_BYTES[kind])))

        part = replace(part, height_map=here(part.height_map, "height_map"), scan=here(part.scan, "scan"))
        try:
            part = replace(part, photos=tuple(here(name, "photo") for name in part.photos))
        except FileError as fault:
            if not part.felt:
                raise
            part = replace(part, photo_problem=fault)
        yield part


@contextlib.contextmanager
def local_copy(url: str, *, most_bytes: int) -> Iterator[Path]:
    """Copy one file to a folder of its own, its name without unsafe characters. Errors as in `local_copies`."""
    files = _file_system(url)
    with _as_file_errors(url):
        path = str(files._strip_protocol(url))
        guard = _guard(url, most_bytes)
        # a web server states the size, or refuses, when the copy is requested
        entry: dict[str, Any] = {"name": url, "type": "file"} if is_web(url) else files.info(path)
        if url.endswith("/") or not _is_file(entry):
            raise problem_of(url, "is not a file", "name a file, or the folder among the inputs")
        guard.set_size(entry.get("size"))
        folder = tempfile.TemporaryDirectory(prefix="tactile-marks-", ignore_cleanup_errors=True)
    with folder as name:
        target = Path(name) / harmless_name(split_name(url)[1])
        with _as_file_errors(url):
            files.get_file(path, str(target), callback=guard)
            guard.absolute_update(target.stat().st_size)
        with shown_as({str(target): url}):
            yield target


def _guard(url: str, most_bytes: int) -> Any:
    from fsspec.callbacks import Callback

    began_s = time.monotonic()

    class Guard(Callback):  # type: ignore[misc]
        def call(self, hook_name: str | None = None, **kwargs: object) -> None:
            size = max(self.size or 0, self.value)
            if size > most_bytes:
                sizes = f"{size / 1e9:.1f} GB long, over the limit of {most_bytes / 1e9:.1f} GB"
                raise problem_of(url, f"is {sizes}", "crop it")
            if time.monotonic() - began_s > _START_S + self.value / _LEAST_BYTES_PER_S:
                raise problem_of(url, "is sent too slowly", _NETWORK_MEND)

    return Guard()


def _is_file(entry: dict[str, Any]) -> bool:
    return entry.get("type") == "file" and not str(entry["name"]).endswith("/")


def _file_system(url: str) -> Any:
    scheme = scheme_of(url)
    if scheme not in _SCHEMES:
        raise problem_of(url, "has an unsupported scheme", f"name one of {', '.join(sorted(_SCHEMES))}")
    try:
        import fsspec
        from fsspec.config import conf
    except ModuleNotFoundError as error:
        raise MissingExtraError("URLs", "fsspec", "cluster") from error
    with _as_file_errors(url):
        try:
            kind = fsspec.get_filesystem_class(scheme)
            configured = conf.get(scheme, {})
            options = {k: v for k, v in _limits(scheme).items() if k not in configured}
            files = kind(**{**options, **kind._get_kwargs_from_urls(url)})
        except ImportError as error:
            if scheme in _EXTRAS:
                raise MissingExtraError(f"{scheme}://", *_EXTRAS[scheme]) from error
            raise problem_of(url, f"needs a library ({error})", "install it") from error
    if scheme in ("s3", "s3a"):
        files.retries = _ATTEMPTS
    return files


def _limits(scheme: str) -> dict[str, Any]:
    if scheme in ("s3", "s3a"):
        config = {
            "connect_timeout": _CONNECT_S,
            "read_timeout": _SILENCE_S,
            "retries": {"total_max_attempts": _ATTEMPTS, "mode": "standard"},
        }
        return {"config_kwargs": config, "max_concurrency": 1, "use_listings_cache": False}
    if scheme in WEB:
        import aiohttp

        limits = aiohttp.ClientTimeout(total=None, sock_connect=_CONNECT_S, sock_read=_SILENCE_S)
        return {"client_kwargs": {"timeout": limits}}
    if scheme in ("gs", "gcs"):
        return {"requests_timeout": _SILENCE_S, "use_listings_cache": False}
    return {"timeout": _SILENCE_S} if scheme in ("ftp", "sftp", "ssh") else {}


@contextlib.contextmanager
def _as_file_errors(url: str) -> Iterator[None]:
    try:
        yield
    except MarksError:
        raise
    except FileNotFoundError as error:
        raise problem_of(url, "is not there", "check the name") from error
    except Exception as error:
        lines = str(error).splitlines()
        reason = f"{type(error).__name__}: {lines[0]}" if lines and lines[0] else type(error).__name__
        what, hint = "cannot be fetched", _NETWORK_MEND
        refused = isinstance(error, PermissionError) or getattr(error, "status", None) in (401, 403)
        if refused or type(error).__name__ in _NO_CREDENTIALS:
            what, hint = "may not be read", "check the credentials"
        elif isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            what, hint = "cannot be copied", "make room in the folder that TMPDIR names"
        raise problem_of(url, f"{what} ({_QUERY.sub('', reason)[:300]})", hint) from error


# errors of botocore and google.auth by name, so that neither must be imported
_NO_CREDENTIALS = (
    *("NoCredentialsError", "PartialCredentialsError", "CredentialRetrievalError", "ProfileNotFound"),
    *("TokenRetrievalError", "DefaultCredentialsError", "RefreshError"),
)
