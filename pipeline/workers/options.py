"""Which executor: as a command line asks for it, for so many tasks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from pipeline.workers.executors import PART_TIMEOUT_S, Executor, InlineExecutor, PoolExecutor, cores

FEW_PARTS = 12
"""So many are read here and now: to start processes would take longer."""


@dataclass(frozen=True)
class ExecutorOptions:
    """Who works.

    Attributes:
        jobs: Worker processes; one for each core unless given, or none for a few parts.
        cluster: Address of a Dask scheduler (tcp://HOST:8786), whose workers work instead. Needs the extra cluster.
        part_timeout_s: Seconds after which a process of this machine gives a part up.
    """

    jobs: int | None = None
    cluster: str | None = None
    part_timeout_s: float = PART_TIMEOUT_S

    @contextmanager
    def opened(self, parts: int) -> Iterator[Executor]:
        """The executor for so many parts.

        Raises:
            ClusterError: no cluster, or none that can be used.
            SettingsError: a number of jobs that cannot be.
        """
        if self.cluster is not None:
            from pipeline.workers.cluster import ClusterExecutor

            with ClusterExecutor(self.cluster) as cluster:
                yield cluster
            return
        few = self.jobs is None and parts <= FEW_PARTS
        jobs = min(cores() if self.jobs is None else self.jobs, max(1, parts))
        if few or jobs == 1:
            yield InlineExecutor()
            return
        with PoolExecutor(jobs, timeout_s=self.part_timeout_s) as pool:
            yield pool
