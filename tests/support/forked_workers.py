"""Workers of what runs in this process, forked from a server that is warm.

A worker that is spawned loads libraries and kernels anew: two seconds of processor time, a hundred times in a run of
the suite. Commands and services in processes of their own are not touched by this, and spawn theirs as for users.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable
from multiprocessing import forkserver, popen_forkserver
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any
from unittest import mock

ROOT = Path(__file__).parents[2]
SERVER = forkserver.ForkServer()
"""Beside the one of this process, which loads what others ask of it."""
SERVER.set_forkserver_preload(["tests.support.warm_server"])
LOCK = threading.Lock()


class Forked(popen_forkserver.Popen):
    """A process that SERVER has forked."""

    def _launch(self, process_obj: Any) -> None:
        with LOCK, mock.patch.object(forkserver, "connect_to_new_process", SERVER.connect_to_new_process):
            _start_server()
            super()._launch(process_obj)  # type: ignore[misc]


def _start_server() -> None:
    """Start SERVER, unless it runs, so that it finds its module whatever the folder it starts in."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), before)))
    try:
        SERVER.ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before


class ForkedProcess(ForkServerProcess):
    """A process as the context "spawn" has them, in the environment of this moment."""

    def __init__(
        self, group: None = None, target: Any = None, name: Any = None, args: Any = (), **options: Any
    ) -> None:
        super().__init__(group, _called, name, (dict(os.environ), target, args), **options)

    @staticmethod
    def _Popen(process_obj: Any) -> Any:
        return Forked(process_obj)


def _called(environment: dict[str, str], target: Callable[..., object], args: tuple[Any, ...]) -> None:
    os.environ.clear()
    os.environ.update(environment)
    target(*args)


def fork_workers() -> None:
    """Have the context "spawn" of this process fork."""
    if sys.platform == "linux":
        multiprocessing.get_context("spawn").Process = ForkedProcess  # type: ignore[misc,assignment]
