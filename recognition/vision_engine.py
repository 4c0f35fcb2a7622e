"""What anything that reads a line out of a photograph looks like from outside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.lattice import Lattice


class EngineMissingError(MarksError):
    """An engine that is not installed."""


class VisionEngine(Protocol):
    """Reads one line of characters that fills a photograph."""

    @property
    def name(self) -> str:
        """Of the engine."""

    def read_line(self, crop: Photo, *, chars: str, places: Sequence[str] | None) -> Lattice | None:
        """What is believed of every place.

        Args:
            crop: the line, upright, with a narrow margin.
            chars: characters that may occur.
            places: characters allowed at each place of a known format, or None.

        Returns:
            A lattice over `chars`, its boxes in the frame of the crop (pixels times pitch, from its top left;
            a pixel counts as one where the pitch is not known); None where nothing can be read.
        """
