"""A line of characters where they are believed to stand, and the templates that answer there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.stamping.die import Face
from glyphs.surface.maps import EdgeMap
from recognition.experts.templates.frames import LineImage, line_image, turned
from recognition.experts.templates.predicted import TemplateCache, TemplateSet, template_key
from whisker_array.whisker.touch import Touch


@dataclass(frozen=True, eq=False)
class PlacedLine:
    """Characters of one font along a line.

    Attributes:
        font: whose shapes they are.
        face: of its die.
        raised: whether they stand out.
        height_mm: of the characters.
        image: the edge map in the frame of the line.
        templates: of the font.
        template: (places,) index of the character believed.
        u_mm, v_mm: (places,) where it is believed to stand, frame of the image.
    """

    font: Font
    face: Face
    raised: bool
    height_mm: float
    image: LineImage
    templates: TemplateSet
    template: NDArray[np.int64]
    u_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]


class TouchedPart:
    """An edge map, and what is derived of it for lines at any turn and fonts of any face."""

    def __init__(self, edges: EdgeMap, touch: Touch, cache: TemplateCache, *, chars: str) -> None:
        """Prepare.

        Args:
            edges: the map to be read.
            touch: how it was felt.
            cache: of template sets.
            chars: characters that may occur.
        """
        self.edges, self.touch, self.cache, self.chars = edges, touch, cache, chars
        self._images: dict[float, LineImage] = {}

    def image(self, rotation_deg: float) -> LineImage:
        """The channels in the frame of a line so rotated."""
        key = round(rotation_deg, 2)
        if key not in self._images:
            self._images[key] = (
                turned(self.image(0.0), rotation_deg=key) if key else line_image(self.edges, rotation_deg=0.0)
            )
        return self._images[key]

    def templates(
        self,
        font: Font,
        *,
        height_mm: float,
        rotation_deg: float,
        face: Face = Face.FLAT,
        raised: bool = False,
        rough: bool = False,
    ) -> TemplateSet:
        """The templates of a font, felt as the part was, or roughly so."""
        key = template_key(
            font, self.touch, self.edges.directions,
            height_mm=height_mm, rotation_deg=rotation_deg, raised=raised, face=face, rough=rough,
        )  # fmt: skip
        return self.cache.get(font, "".join(c for c in self.chars if c in font.glyphs), key)
