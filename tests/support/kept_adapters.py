"""FastAPI prepares a type for every route that takes or gives it, in every app anew; in tests each is prepared once.

A service has some hundred routes with the same few records: a third of a second for every service of a test.
"""

from __future__ import annotations

import contextlib
from typing import Any

from pydantic import TypeAdapter

KEPT: dict[tuple[object, str], TypeAdapter[Any]] = {}


def kept(annotation: Any, *, config: Any = None) -> TypeAdapter[Any]:
    """The adapter of a type; it is not changed by those who use it."""
    key = (getattr(annotation, "__origin__", annotation), f"{annotation} {config}")
    if key not in KEPT:
        KEPT[key] = TypeAdapter(annotation, config=config)
    return KEPT[key]


def keep_adapters() -> None:
    """Have all apps of this process share their adapters; another FastAPI may make them elsewhere, and takes longer."""
    with contextlib.suppress(ImportError):
        from fastapi._compat import v2

        if hasattr(v2, "TypeAdapter"):
            v2.TypeAdapter = kept  # type: ignore[assignment,misc]
