"""Names of fonts: built-in ones and files. The module that loads them is separate, because it is slow to import."""

from __future__ import annotations

from pathlib import Path

_SUFFIXES = {".ttf", ".otf", ".ttc", ".otc", ".woff", ".woff2"}


def is_font_file(name: str | Path) -> bool:
    """Check whether a font is named by its file, not by a built-in name."""
    path = Path(name)
    return path.suffix.lower() in _SUFFIXES or path.name != str(name)
