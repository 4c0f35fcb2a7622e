"""Which executor: as a command line asks for it, for so many tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, ParamSpec, TypeVar

from glyphs.errors import MarksError
from pipeline.workers.executors import PART_TIMEOUT_S, Executor, InlineExecutor, PoolExecutor, cores

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class ExecutorOptions:
    """Who works.

    Attributes:
        jobs: Worker processes; one for each core unless given. Files are opened by workers alone: one that crashes the
            library that opens it then costs its own part, and not the run.
        cluster: Address of a Dask scheduler (tcp://HOST:8786), whose workers work instead. Needs the extra cluster.
        part_timeout_s: Seconds after which a process of this machine gives a part up.
    """

    jobs: int | None = None
    cluster: str | None = None
    part_timeout_s: float = PART_TIMEOUT_S

    @contextmanager
    def opened(self, parts: int, modules: Sequence[str] = ()) -> Iterator[Executor]:
        """The executor for so many parts.

        Args:
            parts: how many.
            modules: that processes of this machine import before their first part.

        Raises:
            ClusterError: no cluster, or none that can be used.
            SettingsError: a number of jobs that cannot be.
        """
        if self.cluster is not None:
            from pipeline.workers.cluster import ClusterExecutor

            with ClusterExecutor(self.cluster) as cluster:
                yield cluster
            return
        if parts == 0:
            yield InlineExecutor()
            return
        jobs = min(cores() if self.jobs is None else self.jobs, max(1, parts))
        with PoolExecutor(jobs, timeout_s=self.part_timeout_s, modules=modules) as pool:
            yield pool


def in_a_worker(function: Callable[P, R], *args: P.args, **options: P.kwargs) -> R:
    """What a function returns that opens somebody's files: called in a process that may crash over them.

    Raises:
        MarksError: it has crashed.
        Exception: whatever the function raises.
    """
    from pipeline.workers.pool import WorkerLostError

    with ExecutorOptions(jobs=1).opened(1) as executor:
        (outcome,) = executor.calls(_called, partial(function, *args, **options), [None])
    if isinstance(outcome.error, WorkerLostError):
        what = f"a file has crashed the library that opens it ({outcome.error})"
        raise MarksError(what, hint="it is damaged; leave it out") from outcome.error
    if outcome.error is not None:
        raise outcome.error
    result: R = outcome.result  # type: ignore[assignment]
    return result


def _called(function: Callable[[], Any], _: None) -> Any:
    return function()
