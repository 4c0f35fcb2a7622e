"""What every test stands on."""

from __future__ import annotations

import contextlib
import gc
import os
import signal

import structlog
from hypothesis import HealthCheck, settings

from tests.support.forked_workers import fork_workers

# before anything imports NumPy: the suite runs in as many processes as there are cores, and threads of theirs that wait
# for each other take several times the time; children take this over
for _library in ("OPENBLAS", "OMP", "MKL", "NUMBA"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")

# no search for garbage among the modules and tests that collection makes: all of them stay
gc.disable()

fork_workers()

# the same examples in every run, and no judgement of time: a busy machine must not fail a test
settings.register_profile(
    "steady", max_examples=50, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("steady")
# nor any of the constants in modules that happen to be imported: with them a test's examples would depend on the tests
# before it, and on every number in the sources
with contextlib.suppress(ImportError):  # Hypothesis has no setting for it, and may rename it
    from hypothesis.internal.conjecture import providers

    if hasattr(providers, "_get_local_constants") and hasattr(providers, "_local_constants"):
        providers._get_local_constants = lambda: providers._local_constants
# plain tracebacks: those with pictures of every variable take seconds each
structlog.configure(
    processors=[
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback),
    ]
)


def pytest_configure() -> None:
    """Take up interrupts: where a shell runs the suite behind its back they are ignored, here and by every child."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Search for garbage again, but not among what is there before the first test."""
    gc.freeze()
    gc.enable()
