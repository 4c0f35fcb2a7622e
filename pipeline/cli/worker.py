"""`tactile-marks worker`: lend this machine's cores to runs on a cluster."""

from __future__ import annotations

import os
import sys

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported


def worker(address: str, *, jobs: int | None = None, memory_gb: float | None = None) -> int:
    """Work for a Dask scheduler until it ends, one process a core; a lost process is replaced.

    Start the scheduler with: dask scheduler. This is `dask worker` with one thread a process and the memory of maps
    kept between parts, without which a part costs up to three times as much.

    Parameters
    ----------
    address
        Address of the scheduler, such as tcp://HOST:8786.
    jobs
        Worker processes; one for each core unless given.
    memory_gb
        Memory of each process, in GB; one that takes more is replaced. Its share of the machine unless given.
    """
    from pipeline.workers.cluster import require_distributed
    from pipeline.workers.executors import cores
    from pipeline.workers.process import MALLOC

    if jobs is not None and jobs < 1:
        raise CommandError(f"worker: jobs is {jobs}", hint="it must be at least 1", status=USAGE)
    if memory_gb is not None and not memory_gb > 0.0:
        raise CommandError(f"worker: memory_gb is {memory_gb}", hint="it must be above 0", status=USAGE)
    with failures_reported():
        require_distributed()
    # what stands in the environment goes before what Dask's nanny would set for the processes that it starts
    environment = {**MALLOC, "NUMBA_NUM_THREADS": "1", **os.environ}
    arguments = [
        *(sys.executable, "-m", "distributed.cli.dask_worker", address),
        *("--nworkers", str(jobs or cores()), "--nthreads", "1"),
        *("--memory-limit", "auto" if memory_gb is None else f"{memory_gb}GB"),
        "--no-dashboard",
    ]
    sys.stdout.flush()
    os.execve(sys.executable, arguments, environment)
