"""Compliance against PyNiteFEA, a frame program written by others: random chains, and the paper's A11 and A33.

Its members are Euler-Bernoulli beams as ours are, so nothing but rounding may differ. Pynite's local z axis is
horizontal (in the global xz plane) unless the member is rotated about itself; each member is rotated here until
its z axis is the lateral axis of `Segment.axes`, so that Iz is the vertical bending constant and Iy the lateral.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("Pynite", reason="an independent frame program: pip install 'tactile-marks[proof]'")

from Pynite import FEModel3D

from tests.support.paper import l_shaped_compliance
from whisker_array.whisker.beam import Segment, chain_compliance
from whisker_array.whisker.sections import Material, Rectangle, Round, Section, Tube
from whisker_array.whisker.shapes import LShaped

Matrix = NDArray[np.float64]
LOADS = ("FX", "FY", "FZ", "MX", "MY", "MZ")
SECTIONS: tuple[Section, ...] = (
    Round(0.4), Round(0.9), Tube(0.6, 0.4), Rectangle(0.3, 1.8), Rectangle(1.8, 0.3), Rectangle(0.5, 4.5),
)  # fmt: skip
MATERIALS = (Material("steel", 200_000.0, 0.29, 7.8, 2000.0), Material("bronze", 110_000.0, 0.34, 8.8, 500.0))
ROUNDING = 1e-8
"""Of the greatest term of each block. A frame matrix of six slender members has a condition number up to 1e8
(EA/L against EI/L^3), of which the solution keeps eight digits at the worst."""
CHAINS = 15


def random_chain(rng: np.random.Generator) -> list[Segment]:
    """2 to 6 segments, every other chain in the plane of the trace, sections and materials mixed."""
    steps = rng.uniform(-10.0, 10.0, (int(rng.integers(2, 7)), 3))
    if rng.random() < 0.5:
        steps[:, 2] = 0.0
    steps *= rng.uniform(2.0, 12.0, (len(steps), 1)) / np.linalg.norm(steps, axis=1, keepdims=True)
    points = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return [
        Segment(a, b, SECTIONS[rng.integers(len(SECTIONS))], MATERIALS[rng.integers(len(MATERIALS))])
        for a, b in pairwise(points)
    ]


def frame(segments: Sequence[Segment]) -> FEModel3D:
    """The chain as a Pynite cantilever with one load case for each unit force and moment at the tip."""
    model = FEModel3D()
    points = [segments[0].start_mm, *(s.end_mm for s in segments)]
    for n, point in enumerate(points):
        model.add_node(f"N{n}", *(float(v) for v in point))
    for n, segment in enumerate(segments):
        section, material = segment.section_at(0.0), segment.material
        model.add_material(
            f"mat{n}", material.e_mpa, material.g_mpa, material.poisson, material.density_t_mm3
        )
        model.add_section(
            f"sec{n}", section.area_mm2, section.i_lateral_mm4, section.i_vertical_mm4, section.j_mm4
        )
        name = f"M{n}"
        model.add_member(name, f"N{n}", f"N{n + 1}", f"mat{n}", f"sec{n}")
        _, y, z = np.asarray(model.members[name].T(), dtype=np.float64)[:3, :3]
        lateral = segment.axes[1]
        # a right-hand turn about the member carries z to z cos - y sin
        model.members[name].rotation = math.degrees(math.atan2(-float(y @ lateral), float(z @ lateral)))
    model.def_support("N0", *(True,) * 6)
    for load in LOADS:
        model.add_node_load(f"N{len(segments)}", load, 1.0, case=load)
        model.add_load_combo(load, {load: 1.0})
    return model


def frame_compliance(segments: Sequence[Segment]) -> Matrix:
    """(6, 6) [delta; theta] at the tip under unit forces and moments, column by column."""
    model = frame(segments)
    model.analyze_linear()
    tip = model.nodes[f"N{len(segments)}"]
    moved = (tip.DX, tip.DY, tip.DZ, tip.RX, tip.RY, tip.RZ)
    return np.array([[float(of[load]) for load in LOADS] for of in moved])


def deviation(ours: Matrix, theirs: Matrix) -> float:
    """Worst of the 36 terms, each against the greatest of its 3 x 3 block (the blocks have their own units)."""
    blocks = (np.s_[:3, :3], np.s_[:3, 3:], np.s_[3:, :3], np.s_[3:, 3:])
    return max(float(np.abs(ours[b] - theirs[b]).max() / np.abs(theirs[b]).max()) for b in blocks)


@pytest.mark.parametrize("seed", range(CHAINS))
def test_all_36_terms_of_a_random_chain(seed: int) -> None:
    segments = random_chain(np.random.default_rng(seed))
    assert deviation(chain_compliance(segments, axial=True), frame_compliance(segments)) < ROUNDING


def test_the_comparison_sees_a_section_laid_on_its_side() -> None:
    """A check of the check: with the lateral axis a quarter turn off, a ribbon must not agree."""
    points = np.array([[0.0, 0.0, 0.0], [-9.0, -3.0, 4.0], [-12.0, -8.0, 5.0]])
    flat, upright = (
        [Segment(a, b, section, MATERIALS[0]) for a, b in pairwise(points)]
        for section in (Rectangle(0.3, 1.8), Rectangle(1.8, 0.3))
    )
    assert deviation(chain_compliance(flat), frame_compliance(flat)) < ROUNDING
    assert deviation(chain_compliance(flat), frame_compliance(upright)) > 0.1


@pytest.mark.parametrize("section", [Round(0.4), Rectangle(0.3, 1.8)], ids=["wire", "ribbon"])
@pytest.mark.parametrize("beta", [0.0, 0.4, -0.2, 1.2])
@pytest.mark.parametrize("k", [0.033, 0.117, 0.6])
def test_the_corrected_closed_form_is_what_a_frame_gives_and_the_printed_is_not(
    k: float, beta: float, section: Section
) -> None:
    """Eq. (20): A11 and A33 of physics.md against FEA, and the printed ones, which no beam can have."""
    l1, material = 30.0, MATERIALS[0]
    whisker = LShaped(l1, k * l1, None, beta, section, material)
    d11 = frame_compliance(whisker.segments())[:3, :3]
    for segment in whisker.segments():  # the closed forms are inextensible
        along = segment.axes[0]
        d11 -= segment.length_mm / (material.e_mpa * section.area_mm2) * np.outer(along, along)
    closed = l_shaped_compliance(l1, k * l1, beta, section, material)
    # FEA's rounding against the greatest term
    np.testing.assert_allclose(closed, d11, rtol=0, atol=ROUNDING * np.abs(d11).max())

    unit = l1**3 / (3.0 * material.e_mpa * section.i_vertical_mm4)
    s, c = math.sin(beta), math.cos(beta)
    a11, a33 = d11[0, 0] / unit, d11[2, 2] / unit
    printed_a11 = s * s + 1.5 * k * s + k**3
    torsion = 3.0 * k * k * c * c * material.e_mpa * section.i_vertical_mm4 / (material.g_mpa * section.j_mm4)
    printed_a33 = section.i_vertical_mm4 / section.i_lateral_mm4 * (1.0 + k**3) + torsion
    missing = 1.5 * k * s + 3.0 * k * k
    assert a11 - printed_a11 == pytest.approx(missing, rel=1e-5)
    assert abs(missing) > 3e-3
    if beta != 0.0:
        left_out = section.i_vertical_mm4 / section.i_lateral_mm4 * 3.0 * k * s * (1.0 + k * s)
        assert a33 - printed_a33 == pytest.approx(left_out, rel=1e-5)
        assert abs(left_out) > 1e-4
