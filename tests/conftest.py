"""What every test stands on."""

from __future__ import annotations

import signal

from hypothesis import HealthCheck, settings

# the same examples in every run, and no judgement of time: a busy machine must not fail a test
settings.register_profile(
    "steady", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("steady")


def pytest_configure() -> None:
    """Take up interrupts: where a shell runs the suite behind its back they are ignored, here and by every child."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
