"""What answers depend on, in plain JSON values: a key for it, and how two of them differ, in words."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_MOST_SHOWN = 4
_MOST_CHARACTERS = 60


def key_of(description: Mapping[str, Any]) -> str:
    """Hash of what is tried; equal descriptions have equal keys whatever the order of their entries."""
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()[:16]


def file_sha256(path: Path) -> str:
    """Hash of what a file holds, hexadecimal.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def differences(was: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """The first entries that differ: "height_mm was 5.0, now 4.0"."""
    wanted = json.loads(json.dumps(dict(now)))
    differ = sorted(k for k in {*was, *wanted} if was.get(k) != wanted.get(k))
    return "; ".join(
        f"{k} was {in_short(was.get(k))}, now {in_short(wanted.get(k))}" for k in differ[:_MOST_SHOWN]
    )


def in_short(value: object) -> str:
    """A value in a few characters."""
    text = json.dumps(value)
    return text if len(text) <= _MOST_CHARACTERS else text[: _MOST_CHARACTERS - 3] + "..."
