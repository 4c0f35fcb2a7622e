"""From scores to beliefs and decisions, on lines put together by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from glyphs.fonts.glyph import Font
from recognition.acceptance import beliefs, decide, trimmed, word_gaps
from recognition.decode import Placed
from recognition.frames import LineImage
from recognition.reading import Decision, Reading, ReadingFlag
from recognition.refine import Cell
from recognition.search import Hypothesis, LineFit
from recognition.templates import TemplateSet

CHARS = ("A", "4", "H", "8")
HEIGHT = 5.0
scores_of = hnp.arrays(np.float64, st.integers(1, 12), elements=st.floats(-1.0, 1.0, allow_subnormal=False))


@dataclass(frozen=True)
class Rules:
    accept_confidence: float = 0.9
    accept_margin: float = 0.3


def cell(*scores: float, u_mm: float = 0.0, half_width_mm: float = 1.5) -> Cell:
    return Cell(np.array(scores), u_mm, 0.0, 0.0, half_width_mm)


def line(font: Font, cells: list[Cell], chars: tuple[str, ...] = CHARS, **hypothesis: object) -> tuple:
    image = LineImage(np.zeros((1, 3, 3), dtype=np.float32), 0.1, 0.1, (0.0, 0.0), 0.0, (10.0, 5.0))
    templates = TemplateSet(
        font.name, chars, np.zeros((len(chars), 1, 3, 3), dtype=np.float32), np.full(len(chars), 0.3)
    )
    fit = LineFit(
        hypothesis=Hypothesis(font, HEIGHT, 1.0, 0.0, **hypothesis),  # type: ignore[arg-type]
        raised=False,
        value_mm=10.0,
        placed=tuple(Placed(0, 0, 1.0) for _ in cells),
        rows=tuple(0 for _ in cells),
        scores=tuple(float(c.scores.max()) for c in cells),
        image=image,
        templates=templates,
    )
    return fit, templates, tuple(cells)


def judge(judged: list[tuple], rules: Rules | None = None, **options: object) -> Reading:
    given_ = {"places": None, "gaps": frozenset(), **options}
    return decide(judged, settings=rules if rules is not None else Rules(), **given_)[0]  # type: ignore[arg-type]


def three(*scores: float) -> list[Cell]:
    return [cell(*scores, u_mm=4.0 * k) for k in range(3)]


@given(scores_of)
def test_beliefs_are_probabilities_in_the_order_of_the_scores(scores: np.ndarray) -> None:
    belief = beliefs(scores)
    assert belief.sum() == pytest.approx(1.0)
    assert (belief >= 0.0).all()
    order = np.argsort(scores, kind="stable")
    assert (np.diff(belief[order]) >= 0.0).all()


@given(scores_of, st.randoms(use_true_random=False))
def test_beliefs_do_not_depend_on_the_order_of_candidates(scores: np.ndarray, random: object) -> None:
    order = list(range(scores.size))
    random.shuffle(order)  # type: ignore[attr-defined]
    np.testing.assert_allclose(beliefs(scores[order]), beliefs(scores)[order], rtol=1e-12)


@given(st.floats(0.3, 0.99), st.integers(2, 8))
def test_equal_scores_share_belief_evenly(score: float, n: int) -> None:
    np.testing.assert_allclose(beliefs(np.full(n, score)), 1.0 / n)


def test_the_odds_of_two_are_the_likelihood_ratio() -> None:
    a, b = 0.9, 0.8
    belief = beliefs(np.array([a, b]))
    # 40 independent residuals of variance 1 - r^2
    assert belief[0] / belief[1] == pytest.approx(((1.0 - b**2) / (1.0 - a**2)) ** 20.0)


def test_a_clear_line_is_accepted(gothic: Font) -> None:
    reading = judge([line(gothic, three(0.95, 0.7, 0.6, 0.5))])
    assert reading.text == "AAA"
    assert reading.decision is Decision.ACCEPT
    assert reading.flags is ReadingFlag.NONE
    for character in reading.characters:
        shares = [c.probability for c in character.candidates]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) <= 1.0 + 1e-12
    assert reading.confidence == pytest.approx(np.prod([c.confidence for c in reading.characters]))


def test_acceptance_needs_confidence(gothic: Font) -> None:
    judged = [line(gothic, three(0.95, 0.7, 0.6, 0.5))]
    sure = judge(judged).confidence
    enough = judge(judged, Rules(accept_confidence=sure, accept_margin=0.0))
    short = judge(judged, Rules(accept_confidence=np.nextafter(sure, 1.0), accept_margin=0.0))
    assert enough.decision is Decision.ACCEPT
    assert short.decision is Decision.REVIEW
    assert short.flags is ReadingFlag.LOW_CONFIDENCE


def test_acceptance_needs_every_margin(gothic: Font) -> None:
    cells = three(0.95, 0.7, 0.6, 0.5)
    cells[1] = cell(0.95, 0.945, 0.6, 0.5, u_mm=4.0)
    judged = [line(gothic, cells)]
    least = min(c.margin for c in judge(judged).characters)
    enough = judge(judged, Rules(accept_confidence=0.0, accept_margin=least))
    short = judge(judged, Rules(accept_confidence=0.0, accept_margin=float(np.nextafter(least, 1.0))))
    assert enough.decision is Decision.ACCEPT
    assert short.decision is Decision.REVIEW
    assert short.flags is ReadingFlag.AMBIGUOUS


@pytest.mark.parametrize("shape", [{"soften": 0.03, "grow": 0.02}, {"free_widths": True}])
def test_foreign_shapes_are_never_accepted(shape: dict[str, object], gothic: Font) -> None:
    reading = judge([line(gothic, three(0.99, 0.1, 0.1, 0.1), **shape)], Rules(0.0, 0.0))
    assert reading.text == "AAA"
    assert reading.decision is Decision.REVIEW
    assert ReadingFlag.FOREIGN_SHAPES in reading.flags


@pytest.mark.parametrize("worst", [0.65, 0.7])
def test_one_ill_fitting_character_keeps_a_line_from_acceptance(worst: float, gothic: Font) -> None:
    cells = [cell(0.97, 0.1, 0.1, 0.1, u_mm=4.0 * k) for k in range(5)]
    cells[2] = cell(worst, 0.1, 0.1, 0.1, u_mm=8.0)
    reading = judge([line(gothic, cells)], Rules(0.0, 0.0))
    assert reading.decision is Decision.REVIEW
    assert ReadingFlag.FOREIGN_SHAPES in reading.flags


def test_a_line_that_hardly_fits_is_no_text(gothic: Font) -> None:
    reading = judge([line(gothic, three(0.5, 0.4, 0.3, 0.2))], flags=ReadingFlag.DROPOUTS)
    assert reading.characters == ()
    assert reading.decision is Decision.REJECT
    assert reading.confidence == 0.0
    # what was known of the scan is still said
    assert reading.flags == ReadingFlag.NO_CHARACTERS | ReadingFlag.DROPOUTS


def test_a_format_leaves_only_what_it_allows(gothic: Font) -> None:
    cells = three(0.95, 0.93, 0.9, 0.6)
    reading = judge([line(gothic, cells)], places=["AH", "48", "AH48"], gaps=frozenset({0}))
    assert reading.text == "A 4A"
    assert [{c.char for c in place.candidates} for place in reading.characters[:2]] == [
        {"A", "H"},
        {"4", "8"},
    ]


def test_copies_of_a_character_do_not_compete(gothic: Font) -> None:
    twice = line(gothic, three(0.8, 0.7, 0.6, 0.5, 0.95, 0.7, 0.6, 0.5), chars=CHARS * 2)
    once = line(gothic, three(0.95, 0.7, 0.6, 0.5))
    assert judge([twice]).characters == judge([once]).characters


def test_of_two_lines_the_better_supported_is_read(gothic: Font) -> None:
    good, poor = line(gothic, three(0.95, 0.3, 0.3, 0.3)), line(gothic, three(0.2, 0.3, 0.8, 0.3))
    assert judge([good, poor]) == judge([poor, good])
    assert judge([poor, good]).text == "AAA"


def test_boxes_are_those_of_the_cells_in_the_plate_frame(gothic: Font) -> None:
    reading = judge([line(gothic, three(0.95, 0.3, 0.3, 0.3))])
    second = reading.characters[1].box
    # the image's centre is at (10, 5) of the plate, the second cell 4 mm to the right of it
    assert (second.x0_mm, second.x1_mm) == pytest.approx((12.5, 15.5))
    assert (second.y0_mm, second.y1_mm) == pytest.approx((2.5, 7.5))
    assert reading.box is not None
    assert (reading.box.x0_mm, reading.box.x1_mm) == pytest.approx((8.5, 19.5))


def test_things_beside_the_line_are_trimmed() -> None:
    good, bad = cell(0.9), cell(0.5)
    assert trimmed((bad, good, good, good, bad, bad), share=0.72) == (good, good, good)
    # what lies within is the line's own
    assert trimmed((good, bad, good), share=0.72) == (good, bad, good)
    assert trimmed((bad,), share=0.72) == (bad,)
    assert trimmed((), share=0.72) == ()


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8), st.floats(0.5, 1.0))
def test_trimming_keeps_a_middle_and_is_settled(scores: list[float], share: float) -> None:
    cells = tuple(cell(s) for s in scores)
    kept = trimmed(cells, share=share)
    assert kept
    first = cells.index(kept[0])
    assert any(cells[k : k + len(kept)] == kept for k in range(first, len(cells)))
    assert trimmed(kept, share=share) == kept


def test_a_word_gap_stands_out() -> None:
    at = [0.0, 4.0, 8.0, 16.0, 20.0]
    cells = [cell(0.9, u_mm=u) for u in at]
    assert word_gaps(cells, HEIGHT) == {2}
    # gaps of 1 mm and of 5 mm: the latter is 0.6 heights or more while characters are under 8.3 mm tall
    assert word_gaps(cells, 8.0) == {2}
    assert word_gaps(cells, 9.0) == frozenset()


def test_an_evenly_spaced_line_has_no_word_gap() -> None:
    # far apart, but alike
    assert word_gaps([cell(0.9, u_mm=10.0 * k) for k in range(5)], HEIGHT) == frozenset()
    assert word_gaps([cell(0.9)], HEIGHT) == frozenset()
    assert word_gaps([], HEIGHT) == frozenset()
