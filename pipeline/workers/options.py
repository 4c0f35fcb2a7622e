"""Settings of the workers of a run, declared once for the command line, its file and the library."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import partial
from typing import ClassVar, ParamSpec, TypeVar, cast

from pydantic import Field

from glyphs.errors import MarksError
from pipeline.common.settings import GIVEN_UP, Settings
from pipeline.workers.executors import Executor, WorkerLostError, cores
from pipeline.workers.pool import PART_TIMEOUT_S, WorkPool

P = ParamSpec("P")
R = TypeVar("R")


class PoolSettings(Settings):
    """Settings of the workers on this machine."""

    table: ClassVar[str] = "workers"
    replaced: ClassVar[Mapping[str, str]] = {"part_timeout_s": GIVEN_UP}

    jobs: int | None = Field(default=None, ge=1, le=256)
    """Worker processes. Default: one for each core. Only workers open files: a file that crashes the library that opens
    it costs one part, not the run."""

    @property
    def processes(self) -> int:
        return cores() if self.jobs is None else self.jobs


class WorkerSettings(PoolSettings):
    """Settings of the workers of a run."""

    cluster: str | None = None
    """Address of a Dask scheduler (tcp://HOST:8786), whose workers work instead. Needs the extra cluster."""

    def opened(
        self, parts: int | None = None, *, limit_s: float | None = None
    ) -> AbstractContextManager[Executor]:
        """Open the executor for so many parts; one that takes twice `limit_s` is given up. Raises ClusterError."""
        if self.cluster is not None:
            from pipeline.workers.cluster import ClusterExecutor

            return ClusterExecutor(self.cluster)
        return WorkPool(
            self.processes if parts is None else min(self.processes, max(1, parts)),
            timeout_s=max(PART_TIMEOUT_S, 2.0 * (limit_s or 0.0)),
            at_once=False,
        )


def in_a_worker(function: Callable[P, R], *args: P.args, **options: P.kwargs) -> R:
    """Call a function that opens a user's files in a process of its own, as one may crash it. Raises MarksError."""
    with WorkerSettings(jobs=1).opened() as executor:
        try:
            return cast(R, executor.submit(partial(function, *args, **options)).result())
        except WorkerLostError as error:
            what = f"a file has crashed the library that opens it ({error})"
            raise MarksError(what, hint="it is damaged; leave it out") from error
