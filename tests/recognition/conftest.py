"""What the tests of recognition share: one font, one touch, one reader a setting, parts made once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from glyphs.stamping.stamp import StampedPart, stamp_line
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.maps import EdgeMap
from recognition.glyph_match.predicted import TemplateSet, predict_templates, template_key
from recognition.reader import Reader
from recognition.see.view import View, felt_view
from recognition.settings import ReaderSettings
from tests.support.felt import felt
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.relief import relief_from_edges
from whisker_array.whisker.touch import Touch, default_touch

CHARS = "K7B1"
HEIGHT_MM = 5.0


@pytest.fixture(scope="session")
def gothic() -> Font:
    return load_font("gothic")


@pytest.fixture(scope="session")
def touch() -> Touch:
    return default_touch(HEIGHT_MM)


@pytest.fixture(scope="session")
def make_part(gothic: Font) -> Callable[..., StampedPart]:
    """Parts by options: seed, face, and what `stamp` takes; faultless on a perfect plate where `calm`."""

    @cache
    def made(text: str, height_mm: float, seed: int, calm: bool, face: str, options: tuple) -> StampedPart:
        spec = {"pitch_mm": height_mm / 60, **dict(options)}
        die = default_die(height_mm, font=gothic, **({"face": face} if face else {}))
        return stamp_line(
            text,
            gothic,
            die,
            height_mm=height_mm,
            variation=StampingVariation.none() if calm else None,
            rng=np.random.default_rng(seed),
            **spec,
        )

    def make(
        text: str = "K7B29",
        *,
        height_mm: float = HEIGHT_MM,
        seed: int = 1,
        calm: bool = False,
        face: str = "",
        **options: float,
    ) -> StampedPart:
        return made(text, height_mm, seed, calm, face, tuple(sorted(options.items())))

    return make


@pytest.fixture(scope="session")
def calm_part(make_part: Callable[..., StampedPart]) -> StampedPart:
    return make_part("K71B", calm=True)


@pytest.fixture(scope="session")
def calm_edges(calm_part: StampedPart, touch: Touch) -> EdgeMap:
    """The edge map of a faultless line on a perfect plate."""
    return edge_map(felt(calm_part.height_map, touch=touch))


@pytest.fixture(scope="session")
def calm_view(calm_edges: EdgeMap, touch: Touch) -> View:
    """The faultless line as it was felt."""
    return felt_view(calm_edges, relief_from_edges(calm_edges, touch), touch)


@pytest.fixture(scope="session")
def templates(gothic: Font, touch: Touch) -> TemplateSet:
    """Sunk templates of CHARS."""
    return predict_templates(gothic, CHARS, template_key(gothic, touch, height_mm=HEIGHT_MM))


@pytest.fixture(scope="session")
def reader() -> Callable[..., Reader]:
    """Readers by their settings, kept with their templates; of gothic unless another is named."""

    @cache
    def made(options: tuple) -> Reader:
        return Reader(ReaderSettings(**dict(options)))

    def make(**options: object) -> Reader:
        return made(tuple(sorted({"fonts": ("gothic",), **options}.items())))

    return make
