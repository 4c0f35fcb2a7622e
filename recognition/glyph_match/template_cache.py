"""Cache of the template sets last used, as many as memory allows."""

from __future__ import annotations

from functools import lru_cache

from recognition.glyph_match.predicted import predict_templates

MOST_SETS = 26
"""Most template sets: each takes some 15 MB with its derived values, so that a reader stays below 1 GB."""


class TemplateCache:
    """Template sets last used; a reader owns one. Looking up a set costs nothing, loading it from the disk 10 ms, to
    predict it 0.5 s.

    Attributes:
        get: the set of a font, characters and a key, as `predict_templates`; predicted on first use.
    """

    def __init__(self, *, most_sets: int = MOST_SETS) -> None:
        self.get = lru_cache(maxsize=most_sets)(predict_templates)
