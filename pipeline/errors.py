"""Errors of files, of this machine and of the program. Errors of a file's content are raised without the file's name:
the caller that opened it names it, by path or URL, or as `shown_as` sets it."""

from __future__ import annotations

import contextlib
import errno
import re
import signal
import threading
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType

from glyphs.errors import FileError, MarksError, MissingExtraError, report_damage

WEB = ("http", "https")
_URL = re.compile(r"(?:[a-z0-9+.-]+::)*[a-z][a-z0-9+.-]*://", re.IGNORECASE | re.ASCII)
_PASSWORD = re.compile(r"(?<=://)[^/@:]*:[^/@]*@")
_SHOWN: ContextVar[Mapping[str, str]] = ContextVar("_SHOWN", default=MappingProxyType({}))
_MACHINE_ERRNOS = frozenset(
    getattr(errno, name)
    for name in ("EIO", "ENOSPC", "EDQUOT", "EROFS", "EMFILE", "ENFILE", "ENOMEM", "ESTALE", "ETIMEDOUT")
    if hasattr(errno, name)
)
"""Errors of the disk and of the system's limits, not of one file."""
# processor time for a file, and for each MB of it: twice that of scattered points, which take most
_SPARE_S, _S_PER_MB = 20.0, 1.0


class DataError(MarksError):
    """Unusable content; `reading` turns it into a FileError that names the file."""

    def __init__(self, what: str, hint: str) -> None:
        super().__init__(what, hint=hint)


class FaultError(FileError):
    """A fault of the program while it worked on a file; the file is not to blame."""


class OwnFileError(FileError):
    """A file, disk or limit of this machine that prevents reading the input; a later attempt may succeed."""


def is_machine_error(error: BaseException) -> bool:
    """Check whether disk, system or memory caused an error, whichever file it occurred at."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError) or (isinstance(cause, OSError) and cause.errno in _MACHINE_ERRNOS):
            return True
        # no file is named: tempfile finds no writable folder, or the working folder is gone
        if isinstance(cause, FileNotFoundError) and cause.filename is None:
            return True
        cause = cause.__cause__
    return False


def describe_fault(error: Exception, *, longest: int = 300) -> str:
    """Describe an unexpected error on one line: its kind and message."""
    described = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"fault of the program ({' '.join(described.split())[:longest]})"


def is_url(text: str | Path) -> bool:
    """Whether a name is a URL, such as s3://bucket/key or the chain zip://a::s3://b, and not a path."""
    return _URL.match(str(text)) is not None


def is_web(url: str) -> bool:
    """Whether a URL is a web address, whose folders end in a slash."""
    return url.partition("://")[0].lower() in WEB


def without_secrets(url: str) -> str:
    """Remove the password from a URL, and the query from a web address: it may hold a signature."""
    shown = _PASSWORD.sub("***@", url)
    return shown.partition("?")[0] if is_web(shown) else shown


def problem_of(name: str | Path, what: str, hint: str) -> FileError:
    """Make the error of a file or URL, with the name to show and without secrets."""
    shown = without_secrets(_SHOWN.get().get(str(name), str(name)))
    return FileError(shown, what.replace(str(name), shown), hint)


@contextlib.contextmanager
def shown_as(names: Mapping[str, str]) -> Iterator[None]:
    """Show files under other names, by path, in a FileError raised within the block."""
    token = _SHOWN.set({**_SHOWN.get(), **names})
    try:
        yield
    except FileError as error:
        if str(error.path) not in names:
            raise
        raise problem_of(error.path, error.what, error.hint) from error
    finally:
        _SHOWN.reset(token)


@contextlib.contextmanager
def naming(name: str | Path) -> Iterator[None]:
    """Name the file, a path or URL, in errors that name no file. Raises FileError: in place of a MarksError that names
    no file, or another one than is to be shown. MissingExtraError: as it is raised in the block."""
    try:
        yield
    except MissingExtraError:  # nothing is wrong with the file
        raise
    except MarksError as error:
        if error.where and (error.where != str(name) or error.where not in _SHOWN.get()):
            raise
        raise problem_of(name, error.what, error.hint) from error


def require_file(path: Path, *, most_bytes: int) -> None:
    """Check that a path is a file, not empty and not too long. Raises FileError: it is not."""
    try:
        status = path.stat()
    except FileNotFoundError:
        raise FileError(path, "is not there", "check the name") from None
    except (OSError, ValueError) as error:
        raise FileError(path, f"cannot be opened ({error})", "check the name and its permissions") from error
    if not path.is_file():
        raise FileError(path, "is not a file", "name a file")
    if status.st_size == 0:
        raise FileError(path, "is empty", "copy or save it again")
    if status.st_size > most_bytes:
        raise FileError(
            path,
            f"is {status.st_size / 1e6:,.1f} MB long, over the limit of {most_bytes / 1e6:,.1f} MB",
            "crop it",
        )


@contextlib.contextmanager
def processor_limit(limit_s: float) -> Iterator[None]:
    """Limit the processor time of Python code, such as a parser, in the main thread of a system with such a timer.
    Raises DataError: the time is over; again five times a second, for code that catches every exception."""
    main = threading.current_thread() is threading.main_thread()
    if not (main and hasattr(signal, "setitimer") and signal.getsignal(signal.SIGPROF) is signal.SIG_DFL):
        yield
        return

    def stop(*_: object) -> None:
        what = f"takes more than {limit_s:.0f} s to decode, far more than others of its size"
        raise DataError(what, "export it again, or in another format")

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, limit_s, 0.2)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, signal.SIG_DFL)


@contextlib.contextmanager
def reading(path: Path, *, most_bytes: int, kind: str = "") -> Iterator[None]:
    """Check that the file exists, limit the time, and name the file in every error raised while it is read.

    Each error of a third-party parser of the format `kind` is reported as damage of the file; without it, an unexpected
    error remains a fault of the program. Raises FileError: the file is missing or too long, or its content is at fault.
    MissingExtraError: as it is raised in the block.
    """
    with naming(path):
        require_file(path, most_bytes=most_bytes)
        limit_s = _SPARE_S + _S_PER_MB * path.stat().st_size / 1e6
        damage = report_damage(path, kind=kind) if kind else contextlib.nullcontext()
        with damage, processor_limit(limit_s):
            yield
