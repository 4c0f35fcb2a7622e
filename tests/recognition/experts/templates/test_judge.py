"""Templates at places that others have found: which font it is, how it was struck, and what they believe."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.die import Face
from glyphs.stamping.stamp import StampedPart
from recognition.experts.templates.judge import JudgedLine, judged
from recognition.experts.templates.placed_line import TouchedPart
from recognition.experts.templates.predicted import TemplateCache
from recognition.language.lattice import Lattice
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.touch import Touch

CHARS = "K7B19"
CACHE = TemplateCache()


def judge(
    part: StampedPart, touch: Touch, fonts: list[Font], *, named: bool = True, sag_mm: float = 0.0
) -> JudgedLine | None:
    """What templates say where the characters stand, of beliefs that hardly know which they are."""
    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=part.height_mm)
    edges = edge_map(trace_scan(part.height_map, touch=touch, plan=plan))
    boxes = np.array(part.boxes_mm)
    x, y = 0.5 * (boxes[:, 0] + boxes[:, 2]), float(np.median(0.5 * (boxes[:, 1] + boxes[:, 3])))
    ends = np.array([(boxes[0, 0], y), (x.mean(), y + sag_mm), (boxes[-1, 2], y)])
    line = TextLine(ends if sag_mm else ends[[0, 2]], part.height_mm)
    columns = ((x - boxes[0, 0]) / part.height_mm + MARGIN) * HEIGHT_ROWS - 0.5
    belief = np.full((len(part.text), len(CHARS)), 0.15)
    belief[np.arange(len(part.text)), [CHARS.index(c) for c in part.text]] = 0.4
    return judged(
        TouchedPart(edges, touch, CACHE, chars=CHARS), fonts, line, Lattice(tuple(CHARS), np.log(belief)), columns,
        named=named,
    )  # fmt: skip


@pytest.mark.parametrize("raised", [False, True])
def test_the_text_is_judged_and_how_it_was_struck(
    raised: bool, make_part: Callable[..., StampedPart], touch: Touch, gothic: Font
) -> None:
    part = make_part("K7B1", raised=raised)
    found = judge(part, touch, [load_font("timesr"), gothic])
    assert found is not None
    assert (found.line.font.name, found.line.raised) == ("gothic", raised)
    assert found.lattice is not None
    assert "".join(CHARS[k] for k in found.lattice.log_belief.argmax(axis=1)) == part.text
    assert np.exp(found.lattice.log_belief.max(axis=1)).min() > 0.5
    assert len(found.cells) == len(part.text)


def test_dots_are_judged_by_dots(make_part: Callable[..., StampedPart], touch: Touch, gothic: Font) -> None:
    found = judge(make_part("K7B1", face="dotted"), touch, [gothic])
    assert found is not None
    assert found.line.face is Face.DOTTED


def test_a_bent_line_and_no_line_are_not_judged(
    make_part: Callable[..., StampedPart], touch: Touch, gothic: Font
) -> None:
    assert judge(make_part("K7B1"), touch, [gothic], sag_mm=2.0) is None


def test_a_font_that_nobody_named_has_no_say_where_it_does_not_fit(
    make_part: Callable[..., StampedPart], touch: Touch
) -> None:
    found = judge(make_part("K7B1"), touch, [load_font("timesr")], named=False)
    assert found is None or found.lattice is None
