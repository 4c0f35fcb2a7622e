"""Choices that flags of several commands have, as words: the enums themselves are too heavy for help."""

from __future__ import annotations

from typing import Literal

FaceName = Literal["sharp", "flat", "round", "dotted"]
FidelityName = Literal["pointwise", "contact"]


def listed(text: str) -> tuple[str, ...]:
    """The items of a flag that takes several, separated by commas."""
    return tuple(item.strip() for item in text.split(",") if item.strip())
