"""A real stage or camera: a driver of the integrator's own, found by name.

stage_driver = "press_hall.stage:open_stage"        open_stage() gives what has `feel` (`pipeline.service.stage.Stage`)
"""

from __future__ import annotations

from typing import Any

from glyphs.named import load_named
from pipeline.common.settings import SettingsError


def load_driver(named: str, *, verb: str) -> Any:
    """What the callable of that name gives.

    Args:
        named: module and callable, "module:callable"; called without arguments.
        verb: method that it must have: feel or take.

    Raises:
        SettingsError: no such module or callable, or what it gives has no such method.
    """
    made = load_named(named, what="driver", error=SettingsError)()
    if not callable(getattr(made, verb, None)):
        raise SettingsError(f"what {named!r} gives has no method {verb!r}", hint="see pipeline.service.stage")
    return made
