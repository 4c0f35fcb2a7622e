"""`tactile-marks serve`: the vision-fallback service."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported
from pipeline.cli.settings import DEFAULT_FILE, READING, SERVICE, Config, Reading, Service

STARTED_S = time.monotonic()
"""When the command began: this module comes first, what is heavy after it."""


def serve(
    *,
    service: Service = SERVICE,
    reading: Reading = READING,
    config: Config = None,
    init_config: Annotated[
        tuple[Path, ...] | None, Parameter(consume_multiple=(0, 1), negative="", show_default=False)
    ] = None,
) -> int:
    """Serve: photographs in, serials out; where the camera is unsure, the scan that would settle it.

    Listens on this machine only, at http://127.0.0.1:8417, and keeps its data in tactile-marks-data. The operator's
    page is at /.

    Parameters
    ----------
    init_config
        Serve nothing, but write a file of settings with every default, commented out: tactile-marks.toml, or the
        file named. One that is there is left alone.
    """
    if init_config is not None:
        return _write_settings((*init_config, DEFAULT_FILE)[0])
    if reading.mode is not None:
        raise CommandError(
            "serve: mode is set, but a service reads with the camera first and then by touch",
            hint="leave mode out",
            status=USAGE,
        )
    with failures_reported():
        from pipeline.cli.serving import run

        return run(
            service,
            reading,
            started_s=STARTED_S,
            say=lambda line: print(line, file=sys.stderr, flush=True),
        )


def _write_settings(file: Path) -> int:
    from pipeline.cli.settings_reference import settings_file

    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(settings_file())
    except FileExistsError as error:
        raise CommandError(
            f"serve: {file} is there already", hint="name another file after --init-config", status=USAGE
        ) from error
    except OSError as error:
        raise CommandError(f"serve: {file} cannot be written ({error.strerror})", status=USAGE) from error
    print(f"written to {file}: every setting with its default, commented out", file=sys.stderr)
    return 0
