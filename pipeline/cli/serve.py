"""`tactile-marks serve`: the vision-fallback service."""

from __future__ import annotations

import sys
import time

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported
from pipeline.cli.settings import READING, SERVICE, Config, Reading, Service

STARTED_S = time.monotonic()
"""When the command began: this module comes first, what is heavy after it."""


def serve(*, service: Service = SERVICE, reading: Reading = READING, config: Config = None) -> int:
    """Serve: photographs in, serials out; where the camera is unsure, the scan that would settle it.

    Listens on this machine only, at http://127.0.0.1:8417, and keeps its data in tactile-marks-data. The operator's
    page is at /.
    """
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
