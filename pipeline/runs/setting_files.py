"""Send files named in settings with a run's order to machines that may not have them.

files that settings name --files_to_send--> contents --order--> worker --with_local_files--> settings of copies
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path

from pipeline.common.job_file import FILES, files_of
from pipeline.common.settings import ReadSettings
from pipeline.errors import require_file

_MOST_BYTES = 200_000_000


def files_to_send(settings: ReadSettings) -> dict[str, bytes]:
    """Contents of the files named in the settings, by name.

    Raises:
        FileError: one is missing or too large.
    """
    named = files_of(settings)
    for path in named:
        require_file(path, most_bytes=_MOST_BYTES)
    return {str(path): path.read_bytes() for path in named}


def with_local_files(settings: ReadSettings, sent: Mapping[str, bytes] | None) -> ReadSettings:
    """The settings with the paths of this machine's copies; unchanged if nothing was sent."""
    if not sent:
        return settings
    own = {name: _copy(Path(name).name, content) for name, content in sent.items()}

    files = {
        name: own.get(str(path), path) for name in FILES if (path := getattr(settings, name)) is not None
    }
    fonts = tuple(str(own.get(str(Path(font)), font)) for font in settings.font)
    return settings.model_copy(update={**files, "font": fonts})


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    # removed when the process ends
    return tempfile.TemporaryDirectory(prefix="tactile-marks-")


@cache
def _copy(name: str, content: bytes) -> Path:
    """Write a file once, in a folder named by its hash; it keeps its name, which names fonts."""
    folder = Path(_folder().name) / sha256(content).hexdigest()[:32]
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return path
