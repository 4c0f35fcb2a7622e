"""Parallel lines over a surface, given by numbers, in the trace frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from whisker_array.simulation import contact, surface
from whisker_array.simulation.contact import SurfacePose
from whisker_array.simulation.surface import TouchSurface
from whisker_array.simulation.traces import Traces
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch


def _plan(lines_mm: NDArray[np.float64], start_mm: float, step_mm: float, n_samples: int) -> SweepPlan:
    return SweepPlan(TraceDirection.FORWARD_X, lines_mm, start_mm, step_mm, n_samples, n_lead=0)


def trace_contact(
    surface: TouchSurface,
    tip: TipModel,
    *,
    preload_mm: float,
    nominal_friction: float,
    pose: SurfacePose | None = None,
    **lines: Any,
) -> Traces:
    touch = Touch(tip, preload_mm, tip_radius_mm=0.0, friction=nominal_friction)
    return contact.trace_contact(surface, touch, _plan(**lines), pose=pose)


def sample_lines(
    touched: TouchSurface, **lines: Any
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    return surface.sample_lines(touched, _plan(**lines))
