"""Lines looked at once, and which of two fits has more to say for itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs import stamp
from glyphs.fonts.glyph import Font
from glyphs.stamping.stamp import StampingVariation
from glyphs.surface.maps import EdgeMap
from recognition.evidence import LineEvidence, PlaceEvidence
from recognition.evidence_cache import OWN_QUANTILE, OWN_SHARE, EvidenceCache
from recognition.reader import Reader
from recognition.reader_settings import ALPHABET
from recognition.search import Hypothesis, LineFit, LineSearch
from recognition.templates import TemplateCache
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import trace_scan
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.touch import Touch

CHARS = "K7B1"
FOUR = (CHARS,) * 4
"""A format of as many places as were stamped."""


@pytest.fixture(scope="module")
def search(calm_edges: EdgeMap, touch: Touch) -> LineSearch:
    return LineSearch(calm_edges, touch, TemplateCache(), chars=CHARS, places=None)


@pytest.fixture(scope="module")
def fit(search: LineSearch, gothic: Font) -> LineFit:
    return search.fit(Hypothesis(gothic, 5.0, 1.0, 0.0))


def nothing_in(fit: LineFit) -> LineFit:
    return replace(fit, placed=(), rows=(), scores=(), value_mm=0.0)


def evidence_of(shares: list[float]) -> LineEvidence:
    """A line whose places reach these shares of their ideal."""
    places = tuple(
        PlaceEvidence(
            evidence=np.array([-100.0, 1000.0 * share, -50.0]),
            ideal=np.array([900.0, 1000.0, 1100.0]),
            u_mm=5.0 * k,
            v_mm=0.0,
            turn_deg=0.0,
            half_width_mm=1.0,
            covered=0.0,
        )
        for k, share in enumerate(shares)
    )
    return LineEvidence(places=places, total=1000.0 * sum(shares), amplitude=1.0, beside=0.0)


def test_a_line_is_looked_at_once(search: LineSearch, fit: LineFit) -> None:
    look = EvidenceCache(search, places=None)
    first = look.at(fit)
    assert first is not None
    assert len(first.places) == 4
    assert look.at(fit) is first
    assert look.at(replace(fit, value_mm=0.0)) is first
    # another height is another line
    other = look.at(replace(fit, hypothesis=replace(fit.hypothesis, height_mm=5.1)))
    assert other is not None
    assert other is not first


def test_the_format_is_kept_to(search: LineSearch, fit: LineFit) -> None:
    found = EvidenceCache(search, places=(CHARS,) * 3).at(fit)
    assert found is not None
    assert len(found.places) == 3
    # four characters in three places: one lies beside them
    assert found.beside > 0.5


def test_a_clean_line_is_of_its_own_shapes(search: LineSearch, fit: LineFit) -> None:
    look = EvidenceCache(search, places=FOUR)
    assert look.own_shapes(fit)
    assert not look.own_shapes(nothing_in(fit))
    # without a format nobody can tell
    assert not EvidenceCache(search, places=None).own_shapes(fit)


def test_of_two_fits_the_one_with_more_evidence(search: LineSearch, fit: LineFit) -> None:
    look = EvidenceCache(search, places=FOUR)
    wrong = search.fit(replace(fit.hypothesis, height_mm=5.9))
    assert wrong.placed
    here, there = look.at(fit), look.at(wrong)
    assert here is not None
    assert there is None or here.total > there.total
    assert look.better(fit, wrong) is fit
    assert look.better(wrong, fit) is fit
    # nothing to say is less than anything
    assert look.better(fit, nothing_in(fit)) is fit
    assert look.better(nothing_in(fit), fit) is fit
    # without a format the later one, which correlation has settled
    assert EvidenceCache(search, places=None).better(fit, wrong) is wrong


@pytest.mark.parametrize(
    "name",
    [
        "timesr",
        pytest.param(
            "futuram",
            marks=pytest.mark.xfail(strict=True, reason="plain letters of one skeleton reach 0.65 to 0.84"),
        ),
    ],
)
def test_another_font_is_not_of_its_own_shapes(
    name: str, touch: Touch, gothic: Font, reader: Callable[..., Reader]
) -> None:
    text = "HS5W3M6G"
    part = stamp(text, font=name, pitch_mm=5.0 / 60, variation=StampingVariation.none(), seed=1)
    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=5.0)
    edges = edge_map(trace_scan(part.height_map, touch=touch, plan=plan))
    search = LineSearch(edges, touch, reader().touch.cache, chars=ALPHABET, places=None)
    look = EvidenceCache(search, places=(ALPHABET,) * len(text))
    found = search.fit(Hypothesis(gothic, 5.0, 1.0, 0.0))
    assert found.placed
    assert not look.own_shapes(found)


def test_a_quarter_of_the_characters_must_stand() -> None:
    assert OWN_QUANTILE == 0.75
    good, bad = OWN_SHARE + 0.1, OWN_SHARE - 0.1
    stands: Callable[[LineEvidence], bool] = EvidenceCache.stands
    assert stands(evidence_of([good] * 5))
    assert not stands(evidence_of([bad] * 5))
    # of five, two: the quantile is that of the second best
    assert stands(evidence_of([bad, good, bad, good, -0.2]))
    assert not stands(evidence_of([bad, good, bad, bad, -0.2]))
    assert not stands(evidence_of([]))


def test_standing_has_no_scale() -> None:
    one = evidence_of([0.7, 0.6, 0.1])
    other = replace(
        one, places=tuple(replace(p, evidence=3.0 * p.evidence, ideal=3.0 * p.ideal) for p in one.places)
    )
    assert EvidenceCache.stands(one) == EvidenceCache.stands(other)
