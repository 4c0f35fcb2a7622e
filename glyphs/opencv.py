"""OpenCV with a check of its installation: `from glyphs.opencv import cv2` in place of `import cv2`. Removing one of
two OpenCV packages deletes files of the other, and the rest imports as an empty folder."""

from __future__ import annotations

from typing import Final

from glyphs.errors import MarksError

__all__ = ["cv2"]

PACKAGE: Final = "opencv-contrib-python-headless"


_TOO_LITTLE_MEMORY: Final = ("failed to map segment", "cannot allocate memory")
"""Messages of Linux's loader if a library does not fit into the memory limit of a process."""


def _damage_error(reason: str) -> MarksError:
    return MarksError(
        f"OpenCV is damaged ({reason}), as happens when one of two OpenCV packages is removed",
        hint=f"install it again: pip install --force-reinstall --no-deps {PACKAGE}",
    )


try:
    import cv2
except ImportError as error:
    if any(words in str(error).lower() for words in _TOO_LITTLE_MEMORY):
        raise MarksError(
            "too little memory to load OpenCV", hint="let the program use more memory"
        ) from error
    raise _damage_error(str(error)) from error
if not hasattr(cv2, "GaussianBlur"):
    raise _damage_error("its functions are missing")
