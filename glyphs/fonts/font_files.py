"""Tell font files from built-in fonts by name, without the module that loads them, which is slow to import."""

from __future__ import annotations

from pathlib import Path

_SUFFIXES = {".ttf", ".otf", ".ttc", ".otc", ".woff", ".woff2"}


def is_font_file(name: str | Path) -> bool:
    """Check whether a name is that of a font file, not of a built-in font."""
    path = Path(name)
    return path.suffix.lower() in _SUFFIXES or path.name != str(name)
