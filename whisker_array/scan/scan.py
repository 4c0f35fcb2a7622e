"""A scan: the raw moments of all passes, with everything needed to make sense of them, and its simulation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.soil import Soil
from glyphs.surface.display import one_line, picture_html
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from whisker_array.scan.sensor import Calibration, SensorChain, measure
from whisker_array.simulation.regrid import fit_pitch, fit_soil, pad_soil
from whisker_array.simulation.surface import (
    Friction,
    TouchSurface,
    check_friction,
    check_soil,
    prepare_surface,
)
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.simulation.tracing import trace_sweep
from whisker_array.whisker.array import RasterPlan, SweepPlan
from whisker_array.whisker.touch import Touch


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

    __repr__ = one_line

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
        sweeps: one a trace direction and way (dragged or pushed).
        touch: whisker, preload, tip, nominal friction; of the first kind where the array has several.
        line_pitch_mm: distance of neighbouring lines once the passes are interlaced.
        sample_rate_hz: converter rate.
        calibration: gain and offset of each whisker, as far as known; `None` is unit gain and no offset.
        part_id: what the part is called.
        start_time: ISO 8601 with zone, or empty.
        fidelity: "pointwise", "contact" or "measured".
        others: touches of the array's other kinds of whisker.
        kind: kind of each whisker, 0 for `touch`, 1 for the first of the others ...; empty: all are of kind 0.
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
    others: tuple[Touch, ...] = ()
    kind: tuple[int, ...] = ()

    __repr__ = one_line

    def _repr_html_(self) -> str:
        return picture_html(self, _overview(self))

    def __post_init__(self) -> None:
        if not self.sweeps:
            raise MapError("a scan has at least one sweep")
        ways = [(s.plan.direction, s.plan.pushed) for s in self.sweeps]
        if len(set(ways)) != len(ways):
            raise MapError("each trace direction may stand once in a scan, and once pushed")
        kinds = self.kind or (0,) * self.n_whiskers
        if len(kinds) != self.n_whiskers or not set(kinds) <= set(range(1 + len(self.others))):
            raise MapError(
                f"kinds {self.kind} do not fit {self.n_whiskers} whiskers of {1 + len(self.others)} kinds"
            )
        object.__setattr__(self, "kind", kinds)
        if self.calibration is not None and self.calibration.gain.size != self.n_whiskers:
            raise MapError(
                f"a calibration of {self.calibration.gain.size} whiskers for a scan of {self.n_whiskers}"
            )
        if not (self.line_pitch_mm > 0.0 and np.isfinite(self.line_pitch_mm)):
            raise MapError(f"line_pitch_mm is {self.line_pitch_mm}", hint="it must be positive")
        if not (self.sample_rate_hz > 0.0 and np.isfinite(self.sample_rate_hz)):
            raise MapError(f"sample_rate_hz is {self.sample_rate_hz}", hint="it must be positive")

    @property
    def n_whiskers(self) -> int:
        """Whiskers of the array."""
        return int(self.sweeps[0].moment_n_mm.shape[1])

    @property
    def n_samples(self) -> int:
        """Touching samples of all passes."""
        return sum(s.moment_n_mm.size for s in self.sweeps)

    @property
    def touches(self) -> tuple[Touch, ...]:
        """The touch of every kind of whisker."""
        return (self.touch, *self.others)

    @property
    def directions(self) -> tuple[TraceDirection, ...]:
        """Trace directions, in the order of the sweeps."""
        return tuple(s.plan.direction for s in self.sweeps)


def _overview(scan: Scan) -> NDArray[np.float32]:
    """Moments of the first sweep as they lie on the plate, each line about its median, less of them darker."""
    plan, moment = scan.sweeps[0].plan, scan.sweeps[0].moment_n_mm
    lines = -moment.reshape(-1, plan.n_samples)[np.argsort(plan.line_mm, axis=None)]
    lines = lines - np.nanmedian(lines, axis=1, keepdims=True)
    lines = np.repeat(lines, max(1, round(scan.line_pitch_mm / plan.step_mm)), axis=0)
    lines = lines[:, ::-1] if plan.direction.backward else lines
    return lines if plan.direction.along_x else lines.T


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
    others: tuple[Touch, ...] = (),
    soil: Soil | None = None,
) -> Scan:
    """Run the virtual array over a height map.

    Args:
        height_map: the surface; its land should lie about level at zero, as a stage would mount the part. Of a
            soiled part it is the top of the dirt.
        touch: whisker, preload, tip.
        plan: passes and directions.
        fidelity: pointwise formula or frictional contact.
        friction: true friction of the surface, a number or a (rows, cols) map; that of the soil unless given, and
            the nominal one without soil.
        sensor: gains, noise, converter; an ideal sensor unless given.
        rng: needed with a sensor that has noise.
        part_id: what the part is called.
        others: touches of the further rows of the plan's array.
        soil: friction of the part, and dirt that yields (`whisker_array.simulation.soft`); none unless given.

    Raises:
        MapError: a friction map or soil that does not fit.
        ValueError: a sensor without `rng`, or for another number of whiskers; a touch missing for a row.
    """
    if len(others) != plan.array.rows - 1:
        raise ValueError(
            f"the array has {plan.array.rows} rows of whiskers, but {1 + len(others)} touches are given"
        )
    if sensor is not None and rng is None:
        raise ValueError(
            "a sensor chain draws noise: give it a random generator, rng=numpy.random.default_rng(seed)"
        )
    if friction is None:
        friction = touch.friction if soil is None else soil.friction
    mu = check_friction(friction, height_map.shape)
    # pad so that lead-in and outermost lines stand on replicated rim, then make the grid as fine as the steps
    pad = int(np.ceil((plan.lead_mm + 2.0 * plan.line_pitch_mm) / height_map.pitch_mm)) + 1
    padded = HeightMap(np.pad(height_map.z_mm, pad, mode="edge"), height_map.pitch_mm)
    if isinstance(mu, np.ndarray):
        mu = np.pad(mu, pad, mode="edge")
    fitted, mu = fit_pitch(padded, mu, target_mm=plan.sample_pitch_mm)
    if soil is not None:
        check_soil(soil, height_map.shape)
        soil = fit_soil(pad_soil(soil, pad), padded, fitted, target_mm=plan.sample_pitch_mm)
    origin = -pad * height_map.pitch_mm
    size = height_map.size_mm
    touches = (touch, *others)
    surfaces: dict[float, TouchSurface] = {}
    for each in touches:
        if each.tip_radius_mm not in surfaces:
            surfaces[each.tip_radius_mm] = prepare_surface(
                fitted, tip_radius_mm=each.tip_radius_mm, friction=mu, soil=soil
            )
    n = plan.array.n_whiskers
    sweeps = []
    for sweep in plan.sweeps():
        rows = []
        for i, each in enumerate(touches):
            own = replace(sweep, line_mm=sweep.line_mm[:, i * n : (i + 1) * n])
            surface = surfaces[each.tip_radius_mm]
            traces = trace_sweep(surface, own, touch=each, fidelity=fidelity, origin_mm=origin, size_mm=size)
            shape = (*own.line_mm.shape, own.n_samples)
            moment, flags = traces.moment_n_mm.reshape(shape), traces.flags.reshape(shape)
            air = np.zeros((*shape[:2], plan.air_samples), dtype=np.float32)
            if sensor is not None and rng is not None:
                # row by row: they come to a place one after the other, so the base does not shake them alike
                whiskers = range(i * n, (i + 1) * n) if others else range(sensor.n_whiskers)
                raw, saturated = measure(
                    np.concatenate([air, moment], axis=2),
                    chain=sensor.of(whiskers),
                    sample_rate_hz=plan.sample_rate_hz,
                    rng=rng,
                )
                air, moment = raw[..., : plan.air_samples], raw[..., plan.air_samples :]
                flags = flags | np.where(
                    saturated[..., plan.air_samples :], np.uint8(SampleFlag.OUT_OF_RANGE), np.uint8(0)
                )
            rows.append((moment, flags, air))
        moment, flags, air = (np.concatenate(parts, axis=1) for parts in zip(*rows, strict=True))
        sweeps.append(Sweep(plan=sweep, moment_n_mm=moment, flags=flags, air_n_mm=air))
    return Scan(
        sweeps=tuple(sweeps),
        touch=touch,
        line_pitch_mm=plan.line_pitch_mm,
        sample_rate_hz=plan.sample_rate_hz,
        part_id=part_id,
        fidelity=fidelity.value,
        others=others,
        kind=tuple(int(i) for i in np.repeat(np.arange(len(touches)), n)),
    )


def only(scan: Scan, *, kind: int = 0, pushed: bool | None = False) -> Scan:
    """The scan as one kind of whisker felt it, dragged (or pushed; None: both ways).

    Raises:
        MapError: no such kind of whisker, or no such sweep.
    """
    sweeps = tuple(s for s in scan.sweeps if pushed is None or s.plan.pushed == pushed)
    columns = np.flatnonzero(np.asarray(scan.kind) == kind)
    if not sweeps or not columns.size:
        raise MapError(
            f"the scan has no {'pushed' if pushed else 'dragged'} sweep of whiskers of kind {kind}"
        )
    if columns.size == scan.n_whiskers:
        return replace(scan, sweeps=sweeps)
    calibration = scan.calibration
    if calibration is not None:
        calibration = replace(
            calibration, gain=calibration.gain[columns], offset_n_mm=calibration.offset_n_mm[columns]
        )
    return replace(
        scan,
        sweeps=tuple(
            Sweep(
                plan=replace(s.plan, line_mm=s.plan.line_mm[:, columns]),
                moment_n_mm=s.moment_n_mm[:, columns],
                flags=s.flags[:, columns],
                air_n_mm=s.air_n_mm[:, columns],
            )
            for s in sweeps
        ),
        touch=scan.touches[kind],
        calibration=calibration,
        others=(),
        kind=(),
    )
