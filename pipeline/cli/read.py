"""`tactile-marks read`: parts in, a table of serials out."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import INTERRUPTED, USAGE, CommandError, failures_reported
from pipeline.cli.settings import READING, Config, JobPath, Reading
from pipeline.runs.options import MODULES, RunOptions
from pipeline.workers.options import ExecutorOptions

_RUN, _EXECUTORS = RunOptions(), ExecutorOptions()


def read(
    *inputs: str,
    run: Annotated[RunOptions, Parameter(name="*")] = _RUN,
    executors: Annotated[ExecutorOptions, Parameter(name="*")] = _EXECUTORS,
    reading: Reading = READING,
    job: JobPath = None,
    config: Config = None,
) -> int:
    """Read the serials of parts: height maps, scans and photographs, folders, globs and manifests of them.

    With --out rows are kept as they come: an interrupted run goes on when the same command is given again. The exit
    status is 1 if any part could not be read, and with --verify unless every part is confirmed.

    Parameters
    ----------
    inputs
        Height maps (.npz, .x3p, .sdf, .sur ...), scans (.h5) and photographs (.png, .jpg ...), or folders and globs
        of them; files that differ in their endings only are one part. URLs (s3://, gs:// ...) with the extra cluster,
        and manifests.
    """
    from pipeline.store.errors import StoreError
    from pipeline.workers.cluster import ClusterError

    if not (inputs or run.manifest):
        raise CommandError(
            "read: name a height map, a scan, a photograph, a folder, a glob or a manifest", status=USAGE
        )
    with failures_reported():
        try:
            # a worker loads the libraries of reading while this process loads its own
            with executors.opened(modules=MODULES) as executor:
                from pipeline.runs.production import run_batch

                return run_batch(inputs, reading, run, executor)
        except (ClusterError, StoreError) as error:
            raise CommandError(str(error)) from error
        except KeyboardInterrupt as error:
            if run.out is None:
                raise
            raise CommandError(
                "interrupted",
                hint=f"finished parts are kept in {run.out}, run the same command again to continue",
                status=INTERRUPTED,
            ) from error
