"""A real stage or camera: a driver of the integrator's own, found by name.

stage_driver = "press_hall.stage:open_stage"        open_stage() gives what has `open`, `feel` or both
                                                    (`pipeline.service.stage`)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from glyphs.named import load_named
from pipeline.common.settings import SettingsError


def load_driver(named: str, *, verbs: Sequence[str]) -> Any:
    """What the callable of that name gives.

    Args:
        named: module and callable, "module:callable"; called without arguments.
        verbs: methods of which it must have one: open, feel, take.

    Raises:
        SettingsError: no such module or callable, or what it gives has none of the methods.
    """
    made = load_named(named, what="driver", error=SettingsError)()
    if not any(callable(getattr(made, verb, None)) for verb in verbs):
        wanted = " or ".join(map(repr, verbs))
        raise SettingsError(f"what {named!r} gives has no method {wanted}", hint="see pipeline.service.stage")
    return made
