"""Files of a folder that no part is made of: counted and named, so that none vanishes without a word."""

from __future__ import annotations

import os
from collections import Counter

from glyphs.plain_text import visible
from pipeline.formats.kinds import PHOTO_SUFFIXES, READ_NAMES, TABLE_SUFFIXES, UNREAD_PICTURE_SUFFIXES
from pipeline.formats.listed import split_name

_MOST_NAMES = 20
_HINTS = (
    (PHOTO_SUFFIXES, "lone photographs are read with --mode auto, heights in pictures with --height-image"),
    (UNREAD_PICTURE_SUFFIXES, f"photographs must be {READ_NAMES}"),
    (TABLE_SUFFIXES, "tables of heights are read where they are named"),
)


class PassedOver:
    """Counts by suffix, and the first names; memory does not grow with the folder."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.names: list[str] = []

    def add(self, file: str) -> None:
        """Count a file."""
        name = split_name(file)[1]
        self.counts[os.path.splitext(name)[1].lower()[:20] or "no suffix"] += 1
        if len(self.names) < _MOST_NAMES:
            self.names.append(name)

    def describe(self) -> str:
        """One line for a person; empty where nothing was passed over."""
        total = self.counts.total()
        if not total:
            return ""
        kinds = ", ".join(f"{n} {suffix}" for suffix, n in sorted(self.counts.items()))
        more = f" and {total - len(self.names):,} more" if total > len(self.names) else ""
        hints = [hint for suffixes, hint in _HINTS if not self.counts.keys().isdisjoint(suffixes)]
        files = "1 file" if total == 1 else f"{total:,} files"
        return visible("; ".join([f"passed over {files} ({kinds}): {', '.join(self.names)}{more}", *hints]))
