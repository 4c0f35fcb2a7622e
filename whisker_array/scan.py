"""A scan: the raw moments of all passes, with everything needed to make sense of them, and its simulation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import HeightMap, MapError, TraceDirection
from whisker_array.array import RasterPlan, SweepPlan
from whisker_array.contact import trace_contact
from whisker_array.defaults import (
    NOMINAL_FRICTION,
    TIP_RADIUS_HEIGHTS,
    default_preload_mm,
    default_whisker,
)
from whisker_array.pointwise import trace_pointwise
from whisker_array.regrid import fit_pitch
from whisker_array.sensor import Calibration, SensorChain, measure
from whisker_array.surface import (
    Friction,
    TouchSurface,
    check_friction,
    orient,
    prepare_surface,
    sample_lines,
)
from whisker_array.traces import Fidelity, SampleFlag, Traces
from whisker_array.whisker import TipModel


@dataclass(frozen=True, eq=False)
class Touch:
    """How a whisker meets the surface.

    Attributes:
        tip: compliance and moment arm at the tip.
        preload_mm: d0, how far below the land the force-free tip runs.
        tip_radius_mm: ball radius.
        friction: nominal Coulomb coefficient, used where no better is known (templates, lag on the land).
        whisker: one line describing the whisker, for people.
    """

    tip: TipModel
    preload_mm: float
    tip_radius_mm: float
    friction: float = NOMINAL_FRICTION
    whisker: str = ""

    def __post_init__(self) -> None:
        if not (self.preload_mm > 0.0 and np.isfinite(self.preload_mm)):
            raise ValueError(f"preload_mm is {self.preload_mm}; it must be positive")
        if not (self.tip_radius_mm >= 0.0 and np.isfinite(self.tip_radius_mm)):
            raise ValueError(f"tip_radius_mm is {self.tip_radius_mm}; it cannot be negative")
        if not 0.0 <= self.friction < 2.0:
            raise ValueError(f"friction is {self.friction}; a Coulomb coefficient lies between 0 and 2")

    def land_moment_n_mm(self) -> float:
        """Moment on flat land at the nominal friction, eq. (14) with alpha = 0."""
        force = np.array([-self.friction, 1.0, 0.0])
        normal = self.preload_mm / float(self.tip.compliance_mm_per_n[1] @ force)
        return normal * float(self.tip.moment_arm_mm @ force)

    def key(self) -> tuple[float, ...]:
        """Numbers that decide what is felt; equal keys feel alike (for caches)."""
        numbers = (*self.tip.compliance_mm_per_n.ravel(), *self.tip.moment_arm_mm)
        return tuple(
            float(f"{v:.6g}") for v in (*numbers, self.preload_mm, self.tip_radius_mm, self.friction)
        )


def default_touch(character_height_mm: float, *, friction: float = NOMINAL_FRICTION) -> Touch:
    """The default ribbon whisker, scaled to the character height, pressed on by 0.2 of it."""
    whisker = default_whisker(character_height_mm)
    return Touch(
        tip=whisker.tip_model(),
        preload_mm=default_preload_mm(character_height_mm),
        tip_radius_mm=TIP_RADIUS_HEIGHTS * character_height_mm,
        friction=friction,
        whisker=whisker.describe(),
    )


@dataclass(frozen=True, eq=False)
class Sweep:
    """The raw moments of all passes in one direction.

    Attributes:
        plan: where the passes ran.
        moment_n_mm: (passes, whiskers, samples) float32, raw: sensor gain, offset and drift still in it.
        flags: same shape, uint8 of SampleFlag.
        air_n_mm: (passes, whiskers, air samples) float32, moments with the array lifted before each pass.
    """

    plan: SweepPlan
    moment_n_mm: NDArray[np.float32]
    flags: NDArray[np.uint8]
    air_n_mm: NDArray[np.float32]

    def __post_init__(self) -> None:
        shape = (*self.plan.line_mm.shape, self.plan.n_samples)
        if self.moment_n_mm.shape != shape or self.flags.shape != shape:
            raise MapError(
                f"moments {self.moment_n_mm.shape} and flags {self.flags.shape} do not fit the plan {shape}"
            )
        if self.air_n_mm.shape[:2] != shape[:2]:
            raise MapError(f"air samples {self.air_n_mm.shape} do not fit the plan {shape}")


@dataclass(frozen=True, eq=False)
class Scan:
    """All passes over one part.

    Attributes:
        sweeps: one a trace direction.
        touch: whisker, preload, tip, nominal friction.
        line_pitch_mm: distance of neighbouring lines once the passes are interlaced.
        sample_rate_hz: converter rate.
        calibration: gain and offset of each whisker, as far as known; `None` is unit gain and no offset.
        part_id: what the part is called.
        start_time: ISO 8601 with zone, or empty.
        fidelity: "pointwise", "contact" or "measured".
    """

    sweeps: tuple[Sweep, ...]
    touch: Touch
    line_pitch_mm: float
    sample_rate_hz: float
    calibration: Calibration | None = None
    part_id: str = ""
    start_time: str = ""
    fidelity: str = "measured"
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        if not self.sweeps:
            raise MapError("a scan has at least one sweep")
        directions = [s.plan.direction for s in self.sweeps]
        if len(set(directions)) != len(directions):
            raise MapError("each trace direction may stand once in a scan")
        if not (self.line_pitch_mm > 0.0 and np.isfinite(self.line_pitch_mm)):
            raise MapError(f"line_pitch_mm is {self.line_pitch_mm}; it must be positive")
        if not (self.sample_rate_hz > 0.0 and np.isfinite(self.sample_rate_hz)):
            raise MapError(f"sample_rate_hz is {self.sample_rate_hz}; it must be positive")

    @property
    def n_whiskers(self) -> int:
        """Whiskers of the array."""
        return int(self.sweeps[0].moment_n_mm.shape[1])

    @property
    def n_samples(self) -> int:
        """Touching samples of all passes."""
        return sum(s.moment_n_mm.size for s in self.sweeps)

    @property
    def directions(self) -> tuple[TraceDirection, ...]:
        """Trace directions, in the order of the sweeps."""
        return tuple(s.plan.direction for s in self.sweeps)


def trace_scan(
    height_map: HeightMap,
    *,
    touch: Touch,
    plan: RasterPlan,
    fidelity: Fidelity = Fidelity.CONTACT,
    friction: Friction | None = None,
    sensor: SensorChain | None = None,
    rng: np.random.Generator | None = None,
    part_id: str = "",
) -> Scan:
    """Run the virtual array over a height map.

    Args:
        height_map: the surface; its land should lie about level at zero, as a stage would mount the part.
        touch: whisker, preload, tip.
        plan: passes and directions.
        fidelity: pointwise formula or frictional contact.
        friction: true friction of the surface, a number or a (rows, cols) map; the nominal one unless given.
        sensor: gains, noise, converter; an ideal sensor unless given.
        rng: needed with a sensor that has noise.
        part_id: what the part is called.

    Raises:
        MapError: a friction map that does not fit.
        ValueError: a sensor without `rng`, or for another number of whiskers.
    """
    if sensor is not None and rng is None:
        raise ValueError(
            "a sensor chain draws noise: give it a random generator, rng=numpy.random.default_rng(seed)"
        )
    mu = check_friction(touch.friction if friction is None else friction, height_map.shape)
    # pad so that lead-in and outermost lines stand on replicated rim, then make the grid as fine as the steps
    pad = int(np.ceil((plan.lead_mm + 2.0 * plan.line_pitch_mm) / height_map.pitch_mm)) + 1
    padded = HeightMap(np.pad(height_map.z_mm, pad, mode="edge"), height_map.pitch_mm)
    if isinstance(mu, np.ndarray):
        mu = np.pad(mu, pad, mode="edge")
    fitted, mu = fit_pitch(padded, mu, target_mm=plan.sample_pitch_mm)
    surface = prepare_surface(fitted, tip_radius_mm=touch.tip_radius_mm, friction=mu)
    origin = -pad * height_map.pitch_mm
    size = height_map.size_mm
    sweeps = []
    for sweep in plan.sweeps():
        traces = _trace_sweep(surface, sweep, touch=touch, fidelity=fidelity, origin_mm=origin, size_mm=size)
        shape = (*sweep.line_mm.shape, sweep.n_samples)
        moment, flags = traces.moment_n_mm.reshape(shape), traces.flags.reshape(shape)
        air = np.zeros((*shape[:2], plan.air_samples), dtype=np.float32)
        if sensor is not None and rng is not None:
            raw, saturated = measure(
                np.concatenate([air, moment], axis=2),
                chain=sensor,
                sample_rate_hz=plan.sample_rate_hz,
                rng=rng,
            )
            air, moment = raw[..., : plan.air_samples], raw[..., plan.air_samples :]
            flags = flags | np.where(
                saturated[..., plan.air_samples :], np.uint8(SampleFlag.OUT_OF_RANGE), np.uint8(0)
            )
        sweeps.append(Sweep(plan=sweep, moment_n_mm=moment, flags=flags, air_n_mm=air))
    return Scan(
        sweeps=tuple(sweeps),
        touch=touch,
        line_pitch_mm=plan.line_pitch_mm,
        sample_rate_hz=plan.sample_rate_hz,
        part_id=part_id,
        fidelity=fidelity.value,
    )


def _trace_sweep(
    surface: TouchSurface,
    sweep: SweepPlan,
    *,
    touch: Touch,
    fidelity: Fidelity,
    origin_mm: float,
    size_mm: tuple[float, float],
) -> Traces:
    """Trace one sweep; `origin_mm` is the plate coordinate of the padded surface's first sample, both axes.

    Lead-in and lead-out may run on the replicated rim; any other sample beyond the part is OUTSIDE.
    """
    oriented = orient(surface, sweep.direction)
    length = (oriented.shape[1] - 1) * surface.pitch_mm
    start = sweep.start_mm - origin_mm
    if sweep.direction.backward:
        start = length - start
    lines = sweep.line_mm.ravel() - origin_mm
    # half a thousandth of a step: places that rounding puts beyond the rim still stand on it
    slack = 5e-4 * sweep.step_mm
    reach_along, reach_across = size_mm if sweep.direction.along_x else size_mm[::-1]
    across, along = sweep.line_mm.ravel(), sweep.position_mm()
    on_part = (across >= -slack) & (across <= reach_across + slack)
    beyond = (along < -slack) | (along > reach_along + slack)
    beyond[: sweep.n_lead] = beyond[sweep.n_samples - sweep.n_lead :] = False
    heights, mu, dropout = sample_lines(
        oriented, lines_mm=lines[on_part], start_mm=start, step_mm=sweep.step_mm, n_samples=sweep.n_samples
    )
    if fidelity is Fidelity.POINTWISE:
        some = trace_pointwise(
            heights, touch.tip, step_mm=sweep.step_mm, preload_mm=touch.preload_mm, friction=mu
        )
    else:
        some = trace_contact(
            oriented,
            touch.tip,
            lines_mm=lines[on_part],
            start_mm=start,
            step_mm=sweep.step_mm,
            n_samples=sweep.n_samples,
            preload_mm=touch.preload_mm,
            nominal_friction=touch.friction,
        )
    moment = np.zeros((lines.size, sweep.n_samples), dtype=np.float32)
    flags = np.full(moment.shape, np.uint8(SampleFlag.OUTSIDE))
    moment[on_part] = some.moment_n_mm
    flags[on_part] = some.flags | np.where(dropout, np.uint8(SampleFlag.DROPOUT), np.uint8(0))
    flags[:, beyond] |= np.uint8(SampleFlag.OUTSIDE)
    return Traces(moment_n_mm=moment, flags=flags)


def with_calibration(scan: Scan, calibration: Calibration) -> Scan:
    """The same scan with gains and offsets of its whiskers."""
    if calibration.gain.size != scan.n_whiskers:
        raise ValueError(f"calibration of {calibration.gain.size} whiskers for a scan of {scan.n_whiskers}")
    return replace(scan, calibration=calibration)
