"""A real stage or camera: a driver of the integrator's own, found by name.

stage_driver = "press_hall.stage:open_stage"        open_stage() gives what has `feel` (`pipeline.service.stage.Stage`)
"""

from __future__ import annotations

import importlib
from typing import Any

from pipeline.common.settings import SettingsError


def load_driver(named: str, *, verb: str) -> Any:
    """What the callable of that name gives.

    Args:
        named: module and callable, "module:callable"; called without arguments.
        verb: method that it must have: feel or take.

    Raises:
        SettingsError: no such module or callable, or what it gives has no such method.
    """
    module, _, name = named.partition(":")
    if not module or not name:
        raise SettingsError(f"the driver {named!r} is not a module:callable", hint="write it so")
    try:
        make = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise SettingsError(
            f"the driver {named!r} cannot be found ({error})", hint="install it, or correct the name"
        ) from error
    made = make()
    if not callable(getattr(made, verb, None)):
        raise SettingsError(f"what {named!r} gives has no method {verb!r}", hint="see pipeline.service.stage")
    return made
