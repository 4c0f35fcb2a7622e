"""Whether two texts are the same serial."""

from __future__ import annotations


def same_text(one: str, other: str) -> bool:
    """Whether two serials are the same; spaces are not stamped."""
    return "".join(one.split()) == "".join(other.split())
