"""OpenCV, checked to be whole: `from glyphs.opencv import cv2` in place of `import cv2`.

All its packages write the same folder `cv2`, and the extra `vision` brings a second one. Installed in either order,
the last is complete and works; but whichever is removed takes files of the other along, and what is left imports
as an empty folder.
"""

from __future__ import annotations

from typing import Final

from glyphs.errors import MarksError

__all__ = ["cv2"]

PACKAGE: Final = "opencv-contrib-python-headless"


class OpenCvError(MarksError):
    """OpenCV is damaged."""


def _damaged(reason: str) -> OpenCvError:
    return OpenCvError(
        f"OpenCV is damaged ({reason}), as happens when one of two packages of it is removed",
        hint=f"install it again: pip install --force-reinstall --no-deps {PACKAGE}",
    )


try:
    import cv2
except ImportError as error:
    raise _damaged(str(error)) from error
if not hasattr(cv2, "GaussianBlur"):
    raise _damaged("its functions are missing")
