"""What the tests of recognition share: one font, one touch, one reader a setting, parts made once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.die import Face, default_die
from glyphs.stamping.stamp import StampedPart, StampingVariation, stamp_line
from glyphs.surface.maps import EdgeMap
from recognition.experts.templates.placed_line import PlacedLine, TouchedPart
from recognition.experts.templates.predicted import (
    TemplateCache,
    TemplateSet,
    predict_templates,
    template_key,
)
from recognition.reader import Reader
from recognition.senses.settings import ReaderSettings
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.whisker.array import ALL_DIRECTIONS, default_plan
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
        given = {"pitch_mm": height_mm / 60, **dict(options)}
        die = default_die(height_mm, font=gothic, **({"face": face} if face else {}))
        return stamp_line(
            text,
            gothic,
            die,
            height_mm=height_mm,
            variation=StampingVariation.none() if calm else None,
            rng=np.random.default_rng(seed),
            **given,
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
    size = calm_part.height_map.size_mm
    plan = default_plan((0.0, 0.0, *size), character_height_mm=HEIGHT_MM)
    return edge_map(trace_scan(calm_part.height_map, touch=touch, plan=plan))


@pytest.fixture(scope="session")
def place_line(gothic: Font, touch: Touch) -> Callable[..., PlacedLine]:
    """Lines whose characters are believed where they were stamped, by the part and its edge map."""
    cache = TemplateCache()

    def place(
        part: StampedPart,
        edges: EdgeMap,
        *,
        text: str | None = None,
        chars: str = CHARS,
        height_mm: float = HEIGHT_MM,
        face: Face = Face.FLAT,
        raised: bool = False,
    ) -> PlacedLine:
        touched = TouchedPart(edges, touch, cache, chars=chars)
        templates = touched.templates(gothic, height_mm=height_mm, rotation_deg=0.0, face=face, raised=raised)
        boxes = np.array([b for b, c in zip(part.boxes_mm, part.text, strict=True) if c != " "])
        image = touched.image(0.0)
        u_mm, v_mm = image.from_plate(0.5 * (boxes[:, :2] + boxes[:, 2:])).T
        believed = [templates.chars.index(c) for c in (text or part.text).replace(" ", "")]
        return PlacedLine(gothic, face, raised, height_mm, image, templates, np.array(believed), u_mm, v_mm)

    return place


@pytest.fixture(scope="session")
def templates(gothic: Font, touch: Touch) -> TemplateSet:
    """Sunk, upright templates of CHARS."""
    return predict_templates(gothic, CHARS, template_key(gothic, touch, ALL_DIRECTIONS, height_mm=HEIGHT_MM))


@pytest.fixture(scope="session")
def reader() -> Callable[..., Reader]:
    """Readers by their settings, kept with their templates; of gothic unless another is named."""

    @cache
    def made(options: tuple) -> Reader:
        return Reader(ReaderSettings(**dict(options)))

    def make(**options: object) -> Reader:
        return made(tuple(sorted({"fonts": ("gothic",), **options}.items())))

    return make
