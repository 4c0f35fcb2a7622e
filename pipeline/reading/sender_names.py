"""Name files in errors as their sender does, and tell the service's own problems from the sender's."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator, Mapping
from pathlib import Path

from glyphs.errors import FileError, MarksError
from pipeline.errors import FaultError, OwnFileError, describe_fault, is_machine_error, shown_as

_log = logging.getLogger(__name__)
EXPECTED = "expected"  # name of the text expected of a part, in errors beside those of its files


@contextlib.contextmanager
def sender_names(folder: Path, names: Mapping[str, str]) -> Iterator[None]:
    """Turn every problem into a file error with the sender's name for the file (the first, if an error names none).
    Raises FileError: one of the files. OwnFileError: this machine. FaultError: a fault of this program."""
    from recognition.decide.verify import VerifyError

    def without_folders(message: str) -> str:
        for place in (*(Path(path).parent for path in names), folder):
            if len(str(place)) > 1:
                message = message.replace(f"{place.resolve()}/", "").replace(f"{place}/", "")
        return message

    name = next(iter(names.values()), "part")
    try:
        with shown_as(names):
            yield
    except VerifyError as error:
        raise FileError(EXPECTED, error.what, error.hint) from error
    except FileError as error:
        kind = OwnFileError if error.path.is_absolute() or is_machine_error(error) else FileError
        raise kind(error.path.name, without_folders(error.what), error.hint) from error
    except MarksError as error:
        raise FileError(name, without_folders(error.what), error.hint) from error
    except MemoryError as error:
        raise OwnFileError(name, "needs more memory than a worker may have", "crop or thin it") from error
    except OSError as error:
        what = without_folders(f"cannot be read ({error.strerror or error})")
        raise OwnFileError(name, what, "check the disk") from error
    except Exception as error:
        _log.exception("fault of the program while reading %s", name)
        raise FaultError(name, without_folders(describe_fault(error)), "please report it") from error
