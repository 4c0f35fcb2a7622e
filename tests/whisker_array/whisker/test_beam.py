"""Sections and the compliance of chains, against closed forms; tests/proof has finite elements."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from whisker_array.whisker.beam import Segment, chain_compliance
from whisker_array.whisker.sections import (
    MUSIC_WIRE,
    Material,
    Rectangle,
    Round,
    Section,
    Taper,
    Tube,
    WhiskerError,
)
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.validity import lumped_whisker

E, G = MUSIC_WIRE.e_mpa, MUSIC_WIRE.g_mpa
SECTIONS: tuple[Section, ...] = (Round(0.4), Tube(0.6, 0.4), Rectangle(0.3, 1.8), Rectangle(1.8, 0.3))


@pytest.mark.parametrize("section", SECTIONS)
def test_closed_cantilever(section: Section) -> None:
    length = 25.0
    d = chain_compliance([Segment(np.zeros(3), np.array([-length, 0, 0]), section, MUSIC_WIRE)])
    ei, ei_lateral, gj = E * section.i_vertical_mm4, E * section.i_lateral_mm4, G * section.j_mm4
    expected = np.zeros((6, 6))
    expected[0, 0] = length / (E * section.area_mm2)
    expected[1, 1] = length**3 / (3 * ei)
    expected[2, 2] = length**3 / (3 * ei_lateral)
    expected[3, 3] = length / gj
    expected[4, 4] = length / ei_lateral
    expected[5, 5] = length / ei
    expected[1, 5] = expected[5, 1] = -(length**2) / (2 * ei)
    expected[2, 4] = expected[4, 2] = length**2 / (2 * ei_lateral)
    np.testing.assert_allclose(d, expected, rtol=1e-12, atol=1e-15)


def test_axial_term_is_the_only_difference() -> None:
    segment = Segment(np.zeros(3), np.array([-20.0, -5.0, 2.0]), Round(0.4), MUSIC_WIRE)
    along = segment.axes[0]
    gap = chain_compliance([segment]) - chain_compliance([segment], axial=False)
    expected = segment.length_mm / (E * Round(0.4).area_mm2) * np.outer(along, along)
    np.testing.assert_allclose(gap[:3, :3], expected, rtol=1e-6, atol=1e-12)
    assert not gap[3:].any()


@pytest.mark.parametrize(
    "taper",
    [
        Taper(Round(0.6), Round(0.2)),
        Taper(Tube(0.8, 0.5), Tube(0.4, 0.2)),
        Taper(Rectangle(0.4, 2.0), Rectangle(0.2, 1.0)),
    ],
)
def test_taper_is_the_limit_of_many_constant_segments(taper: Taper) -> None:
    segment = Segment(np.zeros(3), np.array([-20.0, -8.0, 0.0]), taper, MUSIC_WIRE)
    exact = chain_compliance([segment])

    def split(n: int) -> list[Segment]:
        at = np.linspace(0.0, 1.0, n + 1)
        ends = segment.points_mm(at)
        sections = [segment.section_at(float(t)) for t in at]
        return [
            replace(segment, start_mm=ends[i], end_mm=ends[i + 1], section=Taper(*sections[i : i + 2]))
            for i in range(n)
        ]

    def steps_error(n: int) -> float:
        stepped = [replace(p, section=p.section_at(0.5)) for p in split(n)]
        return float(np.abs(chain_compliance(stepped) - exact)[:3, :3].max() / exact[:3, :3].max())

    coarse, fine = steps_error(16), steps_error(32)
    assert fine < 2e-3
    assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.05)  # the midpoint rule's order
    np.testing.assert_allclose(chain_compliance(split(5)), exact, rtol=1e-10, atol=1e-14)


def test_linear_cone_closed_form() -> None:
    # d(u) = d1 (base) to d2 (tip): delta = 64 F L^3 / (3 pi E d1^3 d2), the tapered-leaf formula
    d1, d2, length = 0.6, 0.15, 30.0
    segment = Segment(np.zeros(3), np.array([-length, 0, 0]), Taper(Round(d1), Round(d2)), MUSIC_WIRE)
    expected = 64.0 * length**3 / (3.0 * math.pi * E * d1**3 * d2)
    assert chain_compliance([segment])[1, 1] == pytest.approx(expected, rel=1e-10)


def test_segment_along_the_lateral_axis_has_axes() -> None:
    axes = Segment(np.zeros(3), np.array([0.0, 0.0, 3.0]), Round(0.3), MUSIC_WIRE).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)


# --- sections


def test_section_constants() -> None:
    assert Round(2.0).area_mm2 == pytest.approx(math.pi)
    assert Round(2.0).i_vertical_mm4 == pytest.approx(math.pi / 4)
    assert Round(2.0).j_mm4 == pytest.approx(math.pi / 2)
    assert Tube(2.0, 0.0).i_lateral_mm4 == pytest.approx(Round(2.0).i_lateral_mm4)
    ribbon = Rectangle(0.5, 3.0)
    assert (ribbon.i_vertical_mm4, ribbon.i_lateral_mm4) == pytest.approx((0.03125, 1.125))
    assert (ribbon.c_vertical_mm, ribbon.c_lateral_mm) == (0.25, 1.5)


@pytest.mark.parametrize(("ratio", "beta"), [(1.0, 0.14058), (2.0, 0.22868), (4.0, 0.28081), (10.0, 0.31232)])
def test_rectangle_torsion_is_the_handbook_table(ratio: float, beta: float) -> None:
    # Timoshenko and Goodier, art. 109: J = beta a b^3
    assert Rectangle(1.0, ratio).j_mm4 == pytest.approx(beta * ratio, rel=5e-5)
    assert Rectangle(ratio, 1.0).j_mm4 == Rectangle(1.0, ratio).j_mm4


@pytest.mark.parametrize("section", SECTIONS)
def test_blending_mixes_the_dimensions(section: Section) -> None:
    twice = type(section)(*(2.0 * side for side in section.dimensions_mm))
    assert section.blend(twice, 0.0) == section
    assert section.blend(twice, 0.5).area_mm2 == pytest.approx(2.25 * section.area_mm2)


ASLANT = Segment(np.zeros(3), -np.ones(3), Round(0.3), MUSIC_WIRE)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Round(-1.0), "diameter_mm is -1"),
        (lambda: Tube(0.3, 0.3), "inner_mm is"),
        (lambda: Taper(Round(0.3), Rectangle(0.3, 0.3)), "same kind"),
        (lambda: Tube(1.0, 0.5).blend(Round(1.0), 0.5), "same kind"),
        (lambda: Rectangle(1.0, 1.0).blend(Round(1.0), 0.5), "same kind"),
        (lambda: Material("jelly", 1.0, 0.5, 1.0, 1.0), "poisson"),
        (lambda: chain_compliance([]), "at least one segment"),
        (lambda: replace(ASLANT, end_mm=np.zeros(3)), "no length"),
        (lambda: replace(ASLANT, start_mm=np.array([0.0, np.nan, 0.0])), "must be finite"),
        (lambda: chain_compliance([ASLANT, ASLANT]), "list them base to tip"),
        (lambda: lumped_whisker(straight_whisker(30.0, 0.2, Round(0.3)), parts=0), "at least 1"),
        (lambda: chain_compliance([replace(ASLANT, section=Taper(Round(1.0), Round(1e-9)))]), "too steep"),
    ],
)
def test_refusals_say_what_is_wrong(make: Callable[[], object], said: str) -> None:
    with pytest.raises(WhiskerError, match=said):
        make()
