"""Load a user's own object named `module:function`: a soil, a reader, the driver of a stage."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError


def load_named(name: str, *, what: str, error: type[MarksError] = MarksError) -> Any:
    """Load a `what`, such as "soil", by `module:function`, also from the working folder; otherwise raises `error`."""
    module, colon, attribute = name.partition(":")
    if not colon or not module or not attribute:
        raise error(f"the {what} {name!r} is not in the form module:name", hint="write it as module:name")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as fault:
        raise error(
            f"the {what} {name!r} cannot be found ({fault})", hint="install it, or correct the name"
        ) from fault
