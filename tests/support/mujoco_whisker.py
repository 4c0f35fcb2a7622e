r"""A whisker as a chain of rigid links and springs in MuJoCo, dragged over a wedge: contact by another's solver.

    base  o--o--o--o--o--o   each segment cut into equal pieces, a joint in the middle of each: its spring has
    ->                   |   the piece's bending stiffness EI/dl, so that the tip's compliance is the midpoint
                         o   rule for the beam's integral, right to 1/(4 n^2)
    land ________________|   The ball stands on the end of the tip arm; the base is first lowered by d0, then
                     (_) \   driven in +x at a constant, slow speed.
                        alpha\________

What is quasi-static does not depend on mass, so the mass is chosen to be solved well: next to none in the links,
and an armature k (dt / 0.3)^2 on the joint of stiffness k. All modes of the free chain then have one
frequency, 0.3 rad a step, and with critical damping it settles within a few dozen steps whatever the number
of links. Nothing of the program under test is used but the whisker's dimensions.

MuJoCo's contact is soft and its sliding lifts the tip a little; SOFTNESS and SPEED keep both below 0.4 % of d0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from whisker_array.whisker.beam import Segment
from whisker_array.whisker.shapes import LShaped

STEP_S = 1e-3
PHASE_PER_STEP_RAD = 0.3
SOFTNESS = 0.99
"""solimp d: nearer to 1 is stiffer, but then the lift by sliding breaks the contact and the tip hops."""
SPEED_D0_PER_STEP = 5e-5
LOWERING_STEPS = 500
CHUNK_STEPS = 20
"""Steps between readings, 1e-3 d0 of travel."""
LINKS_MM = 2.0
"""Length of a link, at most."""
MIN_LINKS = 4


@dataclass(frozen=True)
class Wedge:
    """Land at height 0 up to x = 0, then a plane; both tilted by `bank` across the trace (z).

    Attributes:
        slope: dh/dx beyond x = 0.
        friction: Coulomb coefficient.
        bank: dh/dz, everywhere.
    """

    slope: float
    friction: float
    bank: float = 0.0


@dataclass(frozen=True, eq=False)
class Drag:
    """What MuJoCo makes of a drag, reading by reading.

    Attributes:
        free_tip_x_mm: where the tip would be without its force, (n,), mm.
        moment_n_mm: about the lateral axis through the sensor, (n,), N mm.
        force_n: on the tip, (n, 3), N.
        tip_mm: lowest point of the ball, (n, 3), mm.
    """

    free_tip_x_mm: NDArray[np.float64]
    moment_n_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    tip_mm: NDArray[np.float64]


def _joints(segment: Segment, pieces: int, spatial: bool) -> str:
    """The springs in the middle of a piece: up and down, and if `spatial` sideways and twist."""
    section, material = segment.section_at(0.0), segment.material
    along, lateral, up = segment.axes
    springs = [(lateral, material.e_mpa * section.i_vertical_mm4)]
    if spatial:
        springs += [(up, material.e_mpa * section.i_lateral_mm4), (along, material.g_mpa * section.j_mm4)]
    text = ""
    for axis, rigidity in springs:
        k = rigidity * pieces / segment.length_mm
        inertia = k * (STEP_S / PHASE_PER_STEP_RAD) ** 2
        text += (
            f'<joint type="hinge" axis="{_numbers(axis)}" stiffness="{k!r}" armature="{inertia!r}" '
            f'damping="{2.0 * math.sqrt(k * inertia)!r}"/>'
        )
    return text


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(v)) for v in values)


def _chain(segments: tuple[Segment, ...], radius_mm: float, spatial: bool) -> str:
    """Nested bodies base to tip; each body's frame is the middle of its piece."""
    text, last, depth = "", np.zeros(3), 0
    for segment in segments:
        pieces = max(MIN_LINKS, math.ceil(segment.length_mm / LINKS_MM))
        for i in range(pieces):
            here = segment.start_mm + (i + 0.5) / pieces * (segment.end_mm - segment.start_mm)
            text += f'<body pos="{_numbers(here - last)}">{_joints(segment, pieces, spatial)}'
            text += '<inertial pos="0 0 0" mass="1e-10" diaginertia="1e-10 1e-10 1e-10"/>'
            last, depth = here, depth + 1
    ball = segments[-1].end_mm + np.array([0.0, radius_mm, 0.0]) - last
    text += f'<geom name="ball" type="sphere" size="{radius_mm!r}" pos="{_numbers(ball)}" mass="1e-10"/>'
    return text + "</body>" * depth


def _plate(name: str, wedge: Wedge, slope: float, reach_mm: tuple[float, float], thick_mm: float) -> str:
    """A box with the upper face y = slope x + bank z; reach_mm is measured in it from the seam at x = 0."""
    normal = np.array([-slope, 1.0, -wedge.bank])
    normal /= np.linalg.norm(normal)
    seam = np.array([0.0, wedge.bank, 1.0]) / math.hypot(1.0, wedge.bank)
    along = np.cross(normal, seam)  # so that the faces of land and ramp meet in the seam
    first, last = reach_mm
    centre = along * (first + last) / 2.0 - normal * thick_mm / 2.0
    size = np.array([(last - first) / 2.0, thick_mm / 2.0, thick_mm])
    return (
        f'<geom name="{name}" type="box" size="{_numbers(size)}" pos="{_numbers(centre)}" '
        f'xyaxes="{_numbers(along)} {_numbers(normal)}"/>'
    )


def whisker_model(
    whisker: LShaped, wedge: Wedge, *, start_mm: float, radius_mm: float, spatial: bool = False
) -> mujoco.MjModel:
    """The MuJoCo model: whisker with its tip at (start_mm, 0, 0) just touching, wedge, contact pairs."""
    segments = whisker.segments()
    base = np.array([start_mm, 0.0, 0.0]) - segments[-1].end_mm
    size = 100.0 * radius_mm
    land = _plate("land", wedge, 0.0, (-size, size if wedge.slope > 0.0 else 0.0), size)
    ramp = _plate("ramp", wedge, wedge.slope, (0.0, size), size)
    mu = f"{wedge.friction!r} {wedge.friction!r} 0 0 0"
    pairs = "".join(
        f'<pair geom1="{plate}" geom2="ball" condim="3" friction="{mu}" solref="{2 * STEP_S!r} 1" '
        f'solimp="{SOFTNESS} {SOFTNESS} 0.001"/>'
        for plate in ("land", "ramp")
    )
    # explicit damping, so that the contact's forces and the step are of one and the same mass
    return mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="{STEP_S}" gravity="0 0 0" integrator="Euler" cone="elliptic" impratio="100" solver="Newton"
    tolerance="1e-12" iterations="50"><flag eulerdamp="disable"/></option>
  <worldbody>
    {land}{ramp}
    <body pos="{_numbers(base)}">
      <joint type="slide" axis="1 0 0" armature="1e6"/><joint type="slide" axis="0 1 0" armature="1e6"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      {_chain(segments, radius_mm, spatial)}
    </body>
  </worldbody>
  <contact>{pairs}</contact>
</mujoco>""")


def drag(
    whisker: LShaped,
    wedge: Wedge,
    *,
    preload_mm: float,
    start_mm: float,
    travel_mm: float,
    radius_mm: float,
    spatial: bool = False,
) -> Drag:
    """Lower the base by the preload, drag it, and read force and moment every CHUNK_STEPS."""
    model = whisker_model(whisker, wedge, start_mm=start_mm, radius_mm=radius_mm, spatial=spatial)
    data = mujoco.MjData(model)
    ball = model.geom("ball").id
    sensor = np.array([start_mm, 0.0, 0.0]) - whisker.segments()[-1].end_mm
    sensor[1] -= preload_mm + whisker.lowered_mm
    speed = SPEED_D0_PER_STEP * preload_mm / STEP_S
    readings = math.ceil(travel_mm / (speed * STEP_S * CHUNK_STEPS))
    moment, force, tip, free = np.zeros(readings), np.zeros((readings, 3)), np.zeros((readings, 3)), []
    wrench = np.zeros(6)
    data.qvel[:2] = speed, -preload_mm / (LOWERING_STEPS * STEP_S)
    mujoco.mj_step(model, data, LOWERING_STEPS)
    for i in range(readings):
        # the base weighs so much that the whisker cannot slow it; set all the same, so that nothing adds up
        data.qvel[:2] = speed, 0.0
        data.qpos[1] = -preload_mm
        mujoco.mj_step(model, data, CHUNK_STEPS)
        for c in range(data.ncon):
            contact = data.contact[c]
            mujoco.mj_contactForce(model, data, c, wrench)
            f = contact.frame.reshape(3, 3).T @ wrench[:3]  # on the second geom of the pair
            f = f if contact.geom2 == ball else -f
            force[i] += f
            moment[i] += np.cross(contact.pos - sensor - [data.qpos[0], 0.0, 0.0], f)[2]
        tip[i] = data.geom_xpos[ball] - [0.0, radius_mm, 0.0]
        free.append(start_mm + data.qpos[0])
    return Drag(np.array(free), moment, force, tip)
