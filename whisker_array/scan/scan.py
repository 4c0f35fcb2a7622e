"""A scan: the raw moments of all passes with the data to interpret them, and its simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Unpack

import numpy as np

from glyphs.ranges import Positive, Validated
from glyphs.signatures import lists_options
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from whisker_array.arrays import Floats, Mask
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.mounting import Mounted, VirtualBench
from whisker_array.scan.pass_log import PassLog
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.touch import Touch


@dataclass(frozen=True, eq=False, repr=False)
class Scan(OneLine, Validated, error=MapError):
    """All passes over one part: a sweep per trace direction and way (dragged or pushed). `kind` numbers each whisker's
    touch: 0 for `touch`, 1 for the first of the others; empty: all 0. `log` has the single passes."""

    sweeps: tuple[Sweep, ...]
    touch: Touch
    line_pitch_mm: Positive
    sample_rate_hz: Positive
    calibration: Calibration | None = None
    part_id: str = ""
    start_time: str = ""
    fidelity: str = "measured"
    notes: tuple[str, ...] = field(default=())
    others: tuple[Touch, ...] = ()
    kind: tuple[int, ...] = ()
    log: PassLog | None = None

    def __post_init__(self) -> None:
        if not self.sweeps:
            raise MapError("a scan has at least one sweep")
        ways = [(s.plan.direction, s.plan.pushed) for s in self.sweeps]
        if len(set(ways)) != len(ways):
            raise MapError("a scan has each trace direction at most once dragged and once pushed")
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
        super().__post_init__()

    @property
    def n_whiskers(self) -> int:
        return int(self.sweeps[0].moment_n_mm.shape[1])

    @property
    def n_samples(self) -> int:
        return sum(s.moment_n_mm.size for s in self.sweeps)

    @property
    def touches(self) -> tuple[Touch, ...]:
        return (self.touch, *self.others)

    @property
    def directions(self) -> tuple[TraceDirection, ...]:
        return tuple(s.plan.direction for s in self.sweeps)


@lists_options(Mounted, VirtualBench.__annotations__)
def trace_scan(
    height_map: HeightMap,
    *,
    touch: Touch,
    plan: RasterPlan,
    part_id: str = "",
    others: tuple[Touch, ...] = (),
    **bench: Unpack[VirtualBench],
) -> Scan:
    """Run the virtual array over a height map. Raises MapError or ValueError.

    `bench` is as in `Mounted`: fidelity, true friction (a number or a (rows, cols) map; default: that of the soil, or
    the nominal one), soil, sensor and stage (default: ideal), at_speed (whether whiskers ring at the speed of the plan;
    default: as on a slow stage), rng (needed with a sensor or a stage).
    """
    if len(others) != plan.array.kinds - 1:
        raise ValueError(
            f"the array has {plan.array.kinds} kinds of whiskers, but {1 + len(others)} touches are given"
        )
    touches = (touch, *others)
    part = Mounted(
        height_map,
        touches=touches,
        sample_pitch_mm=plan.sample_pitch_mm,
        beyond_mm=plan.lead_mm + 2.0 * plan.line_pitch_mm,
        **bench,
    )
    rate, pause = plan.sample_rate_hz, plan.turnaround_s
    sweeps = [
        part.feel(sweep, air_samples=plan.air_samples, sample_rate_hz=rate, pause_s=pause)
        for sweep in plan.sweeps()
    ]
    return Scan(
        sweeps=tuple(sweeps),
        touch=touch,
        line_pitch_mm=plan.line_pitch_mm,
        sample_rate_hz=plan.sample_rate_hz,
        part_id=part_id,
        fidelity=part.fidelity.value,
        others=others,
        kind=tuple(int(i) for i in np.repeat(np.arange(len(touches)), plan.array.n_whiskers)),
    )


def only(scan: Scan, *, kind: int = 0, pushed: bool | None = False) -> Scan:
    """Select the samples of one kind of whisker; dragged, pushed, or both (None). Raises MapError if there are none."""
    sweeps = tuple(s for s in scan.sweeps if pushed is None or s.plan.pushed == pushed)
    columns = np.flatnonzero(np.asarray(scan.kind) == kind)
    if not sweeps or not columns.size:
        raise MapError(
            f"the scan has no {'pushed' if pushed else 'dragged'} sweep of whiskers of kind {kind}"
        )
    if columns.size == scan.n_whiskers:
        return scan if sweeps == scan.sweeps else replace(scan, sweeps=sweeps, log=None)
    calibration = None if scan.calibration is None else scan.calibration.of(columns.tolist())
    return replace(
        scan,
        sweeps=tuple(s.of(columns) for s in sweeps),
        touch=scan.touches[kind],
        calibration=calibration,
        others=(),
        kind=(),
        log=None,
    )


def add_flags(scan: Scan, flag: SampleFlag, masks: Mapping[TraceDirection, Mask]) -> Scan:
    """Flag samples (passes, whiskers, samples) of the first kind of whisker in dragged sweeps."""
    if not any(mask.any() for mask in masks.values()):
        return scan
    columns, sweeps = np.flatnonzero(np.asarray(scan.kind) == 0), []
    for sweep in scan.sweeps:
        flags = sweep.flags.copy()
        if not sweep.plan.pushed and sweep.plan.direction in masks:
            flags[:, columns] |= masks[sweep.plan.direction] * np.uint8(flag)
        sweeps.append(replace(sweep, flags=flags))
    return replace(scan, sweeps=tuple(sweeps))


def positions_mm(scan: Scan, flag: SampleFlag) -> Floats:
    """(n, 2) plate x, y of the samples with a flag."""
    places = [np.empty((0, 2))]
    for sweep in scan.sweeps:
        run, whisker, sample = np.nonzero(sweep.flags & np.uint8(flag))
        pair = (sweep.plan.position_mm()[sample], sweep.plan.line_mm[run, whisker])
        places.append(np.column_stack(pair if sweep.plan.direction.along_x else pair[::-1]))
    return np.concatenate(places)
