"""A part on the stage, scanned pass by pass: the protocol, and the scan of all passes so far.

    stage.open(part) --> session --feel(pass)--> Sweep of that pass
                                 --feel(pass)--> Sweep ...          scan_of(sweeps) --> Scan
                                 --close()

The stage may fail between two passes: `feel` raises a `StageError`, and earlier passes stay valid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.array import SAFE_SPEED_MM_S
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.passes import Pass
from whisker_array.whisker.touch import Touch

Part = TypeVar("Part", contravariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Fitting(OneLine):
    """Whiskers mounted on a stage, which reach (x0, y0, x1, y1) of the plate, their calibration, and their speed."""

    touch: Touch
    array: WhiskerArray
    height_mm: float
    field_mm: tuple[float, float, float, float]
    calibration: Calibration | None = None
    fidelity: str = "measured"
    part_id: str = ""
    speed_mm_s: float = SAFE_SPEED_MM_S


class StageSession(Protocol):
    """One part under the whiskers, from its mounting to its removal."""

    @property
    def fitting(self) -> Fitting:
        """Whiskers, field and calibration; the same for all passes."""

    def feel(self, order: Pass) -> Sweep:
        """Feel one pass: a sweep of raw moments. Raises StageError if it failed; earlier passes stay valid."""

    def close(self) -> None:
        """Lift the whiskers and release the part; closing again does nothing."""


class SessionStage(Protocol[Part]):
    """A stage that scans pass by pass."""

    def open(self, part: Part) -> StageSession:
        """Mount a part and level it. Raises StageError: the part cannot be mounted, and what to do."""


def gather_sweeps(passes: Sequence[Sweep]) -> tuple[Sweep, ...]:
    """Merge sweeps of single passes into one per direction and way, in the order of their first passes, on one grid. A
    pass is flagged OUTSIDE where it was not run. Raises ValueError: they do not share one step and grid."""
    groups: dict[tuple[int, bool], list[Sweep]] = {}
    for sweep in passes:
        groups.setdefault((int(sweep.plan.direction), sweep.plan.pushed), []).append(sweep)
    return tuple(group[0] if len(group) == 1 else _together(group) for group in groups.values())


def _together(sweeps: Sequence[Sweep]) -> Sweep:
    first = sweeps[0].plan
    if any(abs(s.plan.step_mm - first.step_mm) > 1e-9 for s in sweeps):
        raise ValueError("passes of one direction were sampled at different steps")
    step_mm = first.direction.sign * first.step_mm
    begin = [round((s.plan.start_mm - first.start_mm) / step_mm) for s in sweeps]
    earliest = min(begin)
    n = max(b + s.plan.n_samples for b, s in zip(begin, sweeps, strict=True)) - earliest
    air = min(s.air_n_mm.shape[2] for s in sweeps)
    moment, flags, outside = [], [], np.uint8(SampleFlag.OUTSIDE)
    for b, sweep in zip(begin, sweeps, strict=True):
        lead, before = sweep.plan.n_lead, b - earliest
        after = n - before - sweep.plan.n_samples
        padded = sweep.flags.copy()
        # lead-in and lead-out of a pass within the line do not count
        if before:
            padded[..., :lead] |= outside
        if after:
            padded[..., sweep.plan.n_samples - lead :] |= outside
        around = ((0, 0), (0, 0), (before, after))
        moment.append(np.pad(sweep.moment_n_mm, around))
        flags.append(np.pad(padded, around, constant_values=outside))
    plan = replace(
        first,
        line_mm=np.concatenate([s.plan.line_mm for s in sweeps]),
        start_mm=first.start_mm + step_mm * earliest,
        n_samples=n,
        n_lead=min(s.plan.n_lead for s in sweeps),
    )
    return Sweep(
        plan=plan,
        moment_n_mm=np.concatenate(moment),
        flags=np.concatenate(flags),
        air_n_mm=np.concatenate([s.air_n_mm[..., :air] for s in sweeps]),
    )
