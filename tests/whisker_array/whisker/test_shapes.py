"""Whiskers: beams and sections, the paper's closed forms against the chain, the default whisker and its limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.support.benches import preload_stress_mpa
from tests.support.paper import (
    l_shaped_compliance,
    l_shaped_moment_arm,
    straight_compliance,
    straight_moment_arm,
)
from whisker_array.whisker.beam import Segment, chain_compliance
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
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
from whisker_array.whisker.shapes import Chain, LShaped, TipModel, straight_whisker
from whisker_array.whisker.validity import (
    deflection_ratio,
    first_bending_frequency_hz,
    land_force_n,
    lumped_whisker,
)

# -------------------------------------------------------------------------------------------------------------- beam

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


# ------------------------------------------------------------------------------------------------------------ shapes

BETAS = (-0.4, 0.0, 0.3, 0.9)
KS = (0.033, 0.117, 0.5)


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("k", KS)
@pytest.mark.parametrize("beta", BETAS)
def test_corrected_eq_20_is_the_chain(beta: float, k: float, section: Section) -> None:
    whisker = LShaped(30.0, 30.0 * k, None, beta, section)
    chain = whisker.tip_model(axial=False).compliance_mm_per_n
    closed = l_shaped_compliance(30.0, 30.0 * k, beta, section, MUSIC_WIRE)
    np.testing.assert_allclose(chain, closed, rtol=1e-9, atol=1e-12 * closed.max())


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("beta", BETAS)
def test_eq_17_and_18_are_the_chain(beta: float, section: Section) -> None:
    whisker = straight_whisker(30.0, beta, section)
    closed = straight_compliance(30.0, beta, section, MUSIC_WIRE)
    along = np.array([math.cos(beta), math.sin(beta), 0.0])
    stretch = 30.0 / (MUSIC_WIRE.e_mpa * section.area_mm2) * np.outer(along, along)
    model = whisker.tip_model()
    np.testing.assert_allclose(
        model.compliance_mm_per_n, closed + stretch, rtol=1e-9, atol=1e-12 * closed.max()
    )
    np.testing.assert_allclose(model.moment_arm_mm, straight_moment_arm(30.0, beta), atol=1e-12)
    np.testing.assert_allclose(l_shaped_compliance(30.0, 0.0, beta, section, MUSIC_WIRE), closed, atol=1e-14)
    with pytest.raises(WhiskerError, match="axial=True"):
        whisker.tip_model(axial=False)


@pytest.mark.parametrize("l3", [None, 0.0, 2.0])
@pytest.mark.parametrize("beta", BETAS)
def test_eq_21_is_the_geometry(beta: float, l3: float | None) -> None:
    whisker = LShaped(30.0, 4.0, l3, beta, Round(0.4))
    expected = l_shaped_moment_arm(30.0, 4.0, 4.0 if l3 is None else l3, beta)
    np.testing.assert_allclose(whisker.tip_model().moment_arm_mm, expected, atol=1e-12)
    # and it is the moment about the lowered sensor, by hand
    sensor = np.array([0.0, -whisker.lowered_mm, 0.0])
    force = np.array([-0.3, 1.1, 0.7])
    by_hand = np.cross(whisker.segments()[-1].end_mm - sensor, force)[2]
    assert expected @ force == pytest.approx(by_hand)


def test_chain_repeats_the_l_and_feels_its_k() -> None:
    ell = LShaped(30.0, 3.5, None, 0.2, Rectangle(0.3, 1.8))
    points = np.array([s.start_mm for s in ell.segments()] + [ell.segments()[-1].end_mm])
    chain = Chain(points, Rectangle(0.3, 1.8), l3_mm=3.5)
    np.testing.assert_allclose(
        chain.tip_model().compliance_mm_per_n, ell.tip_model().compliance_mm_per_n, rtol=1e-12, atol=1e-16
    )
    np.testing.assert_allclose(chain.tip_model().moment_arm_mm, ell.tip_model().moment_arm_mm, atol=1e-12)
    assert chain.k == pytest.approx(ell.k, rel=1e-3)  # the chain's effective k includes the axial term
    straight = Chain(points[:2], Rectangle(0.3, 1.8))
    assert straight.k == pytest.approx(0.0, abs=1e-4)


# --- the default whisker


@pytest.mark.parametrize("height", [2.5, 5.0, 10.0])
def test_default_whisker_keeps_its_promises(height: float) -> None:
    whisker, preload = default_whisker(height), default_preload_mm(height)
    d = whisker.tip_model().compliance_mm_per_n
    assert whisker.l1_mm == pytest.approx(6 * height)
    assert whisker.k == pytest.approx(0.117)
    assert d[1, 1] / d[2, 2] >= 30.0
    assert preload_stress_mpa(whisker, preload_mm=preload, mu=0.5) < 0.1 * MUSIC_WIRE.yield_mpa
    assert deflection_ratio(whisker, preload_mm=preload, mu=0.5) < 0.05


# --- stress, deflection, frequency, validity


def test_land_force_lifts_the_tip_by_the_preload() -> None:
    whisker = default_whisker(5.0)
    force = land_force_n(whisker, preload_mm=1.0, mu=0.2)
    assert (whisker.tip_model().compliance_mm_per_n @ force)[1] == pytest.approx(1.0)
    assert force[0] == pytest.approx(-0.2 * force[1])


@pytest.mark.parametrize(("held", "eigenvalue"), [(False, 3.5160), (True, 15.4182)])
def test_frequency_of_a_cantilever(held: bool, eigenvalue: float) -> None:
    section = Rectangle(0.3, 4.5)
    ei, line_mass = MUSIC_WIRE.e_mpa * section.i_vertical_mm4, 7.8e-9 * section.area_mm2
    expected = eigenvalue / (2 * math.pi * 30.0**2) * math.sqrt(ei / line_mass)
    found = first_bending_frequency_hz(straight_whisker(30.0, 0.0, section), tip_held=held)
    assert found == pytest.approx(expected, rel=4e-3 if held else 2e-3)


WIRE, EYE = Round(0.4), np.eye(3)
TWO_POINTS = np.array([[0.0, 0, 0], [-9, -1, 0]])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: straight_whisker(30.0, 45.0, WIRE), "radians"),
        (lambda: straight_whisker(0.0, 0.0, WIRE), "l1_mm"),
        (lambda: LShaped(30.0, -1.0, None, 0.0, WIRE), "l2_mm"),
        (lambda: LShaped(30.0, 1.0, math.nan, 0.0, WIRE), "l3_mm"),
        (lambda: Chain(np.zeros((1, 3)), WIRE), "at least two"),
        (lambda: Chain(TWO_POINTS, (WIRE, WIRE)), "2 sections for 1"),
        (lambda: Chain(-TWO_POINTS, WIRE), "behind the base"),
        (lambda: Chain(TWO_POINTS[[0, 0, 1]], WIRE), "no length"),
        (lambda: Chain(TWO_POINTS, WIRE, l3_mm=math.inf), "finite"),
        (lambda: TipModel(EYE, np.zeros(2)), "moment_arm_mm has shape"),
        (lambda: TipModel(EYE * np.nan, np.zeros(3)), "finite"),
        (lambda: TipModel(EYE + np.triu(EYE[::-1]), np.zeros(3)), "symmetric"),
        (lambda: TipModel(EYE - 2.0 * EYE[::-1], np.zeros(3)), "not positive definite"),
        (lambda: default_whisker(-5.0), "character_height_mm"),
    ],
)
def test_refused_whiskers_say_what_is_wrong(make: Callable[[], object], said: str) -> None:
    with pytest.raises(WhiskerError, match=said):
        make()
