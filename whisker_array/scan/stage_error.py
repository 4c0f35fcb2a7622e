"""Errors of a stage or a camera."""

from __future__ import annotations

from glyphs.errors import MarksError


class StageError(MarksError):
    """A stage or camera could not carry out a command; the hint says what to do."""

    is_usage = False
    later = False

    def __init__(self, what: str, hint: str = "") -> None:
        super().__init__(what, hint=hint)
