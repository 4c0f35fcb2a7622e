"""A Dask scheduler and workers as processes of their own, as on several machines."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

START_S = 60.0


@dataclass
class ClusterProcess:
    """What was started.

    Attributes:
        address: of the scheduler.
        scheduler: its process.
        workers: `tactile-marks worker`, each the head of a group of its own with its nannies' children.
    """

    address: str
    scheduler: subprocess.Popen[bytes]
    folder: Path
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def add_worker(self) -> subprocess.Popen[bytes]:
        """Start one more worker of one process."""
        with (self.folder / f"worker-{len(self.workers)}.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "pipeline", "worker", self.address, "--jobs", "1"],
                cwd=self.folder, stdout=log, stderr=log, start_new_session=True, env=environment(),
            )  # fmt: skip
        self.workers.append(process)
        return process

    def lose(self, worker: subprocess.Popen[bytes]) -> None:
        """A machine loses its power: worker and nanny are gone at once."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(worker.pid, signal.SIGKILL)
        worker.wait()

    def told(self) -> str:
        """What they have written."""
        return "\n".join(f"{p.name}:\n{p.read_text(errors='replace')}" for p in self.folder.glob("*.log"))


def environment() -> dict[str, str]:
    """This process's, with the tree and the tests' own functions on the path, and no settings.

    Whether a worker is gone is known after 3 s, not Dask's 30.
    """
    tree = str(Path(__file__).parents[2])
    kept = {k: v for k, v in os.environ.items() if not k.startswith("TACTILE_MARKS_")}
    return {**kept, "PYTHONPATH": tree, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "3s"}


@contextlib.contextmanager
def cluster_process(
    folder: Path, *, workers: int = 2, deaths_allowed: int | None = None
) -> Iterator[ClusterProcess]:
    """A scheduler on a free port of the loopback address, and workers that may still be on their way.

    Args:
        folder: folder of the logs.
        workers: number of workers that are started.
        deaths_allowed: workers that may die of a task before it is given up (default: Dask's).
    """
    told = folder / "scheduler.json"
    allowed = (
        {}
        if deaths_allowed is None
        else {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(deaths_allowed)}
    )
    with (folder / "scheduler.log").open("wb") as log:
        scheduler = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
             "--no-dashboard", "--scheduler-file", str(told)],
            cwd=folder, stdout=log, stderr=log, start_new_session=True, env={**environment(), **allowed},
        )  # fmt: skip
    cluster = ClusterProcess("", scheduler, folder)
    try:
        cluster.address = _address(told, scheduler)
        for _ in range(workers):
            cluster.add_worker()
        yield cluster
    finally:
        for process in (*cluster.workers, scheduler):
            cluster.lose(process)


def _address(told: Path, scheduler: subprocess.Popen[bytes]) -> str:
    until = time.monotonic() + START_S
    while time.monotonic() < until and scheduler.poll() is None:
        with contextlib.suppress(OSError, ValueError, KeyError):
            return str(json.loads(told.read_text())["address"])
        time.sleep(0.05)
    raise RuntimeError("the scheduler has not started")
