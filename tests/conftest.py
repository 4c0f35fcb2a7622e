"""What every test stands on."""

from __future__ import annotations

import signal


def pytest_configure() -> None:
    """Take up interrupts: where a shell runs the suite behind its back they are ignored, here and by every child."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
