"""The library asyncua, asked for when it is needed.

It is handled as untyped: its modules do not export their names as strict type checking wants it, and the types of a
companion specification come into being only while a server runs.
"""

from __future__ import annotations

import importlib
from typing import Any

from glyphs.errors import MissingExtraError


def require_asyncua() -> Any:
    """The module asyncua.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return importlib.import_module("asyncua")
    except ImportError as error:
        raise MissingExtraError("OPC UA", "asyncua", "opcua") from error


def ua_types() -> Any:
    """The module asyncua.ua: types of OPC UA, those of loaded specifications included."""
    return require_asyncua().ua
