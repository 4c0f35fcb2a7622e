"""Trace all lines of a sweep over the surface, by either fidelity, in the trace frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from whisker_array.simulation.at_speed import added_at_speed
from whisker_array.simulation.contact import trace_contact
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.soft import sunken_heights
from whisker_array.simulation.surface import TouchSurface, sample_lines
from whisker_array.simulation.traces import Fidelity, SampleFlag, Traces
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.touch import Touch


def trace_sweep(
    oriented: TouchSurface,
    sweep: SweepPlan,
    *,
    touch: Touch,
    fidelity: Fidelity,
    origin_mm: float,
    size_mm: tuple[float, float],
    commanded: SweepPlan,
    sample_rate_hz: float | None = None,
) -> Traces:
    """Trace one sweep over a padded surface in its trace frame; (passes, whiskers, samples). Samples whose `commanded`
    positions are beyond the part, but for lead-in and lead-out, are OUTSIDE. With a sample rate, whiskers ring."""
    length = (oriented.shape[1] - 1) * oriented.pitch_mm
    start = sweep.start_mm - origin_mm
    if sweep.direction.backward:
        start = length - start
    lines = sweep.line_mm - origin_mm
    # half a thousandth of a step, so that rounding puts no position beyond the edge
    slack = 5e-4 * commanded.step_mm
    reach_along, reach_across = size_mm if sweep.direction.along_x else size_mm[::-1]
    across, along = commanded.line_mm, commanded.position_mm()
    on_part = (across >= -slack) & (across <= reach_across + slack)
    beyond = (along < -slack) | (along > reach_along + slack)
    beyond[: sweep.n_lead] = beyond[sweep.n_samples - sweep.n_lead :] = False
    traced = replace(sweep, line_mm=lines[on_part], start_mm=start)
    dropout, by_heights = None, fidelity is Fidelity.POINTWISE or sample_rate_hz is not None
    tip, step = touch.tip.pushed() if sweep.pushed else touch.tip, sweep.step_mm
    if by_heights or oriented.dropout.any():
        heights, mu, dropout = sample_lines(oriented, traced)
        if by_heights and oriented.yielding is not None:
            top, stiffness, _ = sample_lines(replace(oriented, fields=oriented.yielding), traced)
            heights = sunken_heights(
                top, heights, stiffness, tip, step_mm=step, preload_mm=touch.preload_mm, friction=mu
            )
    if fidelity is Fidelity.POINTWISE:
        some = trace_pointwise(heights, tip, step_mm=step, preload_mm=touch.preload_mm, friction=mu)
    else:
        some = trace_contact(oriented, touch, traced)
    moment = np.zeros((*lines.shape, sweep.n_samples), dtype=np.float32)
    flags = np.full(moment.shape, np.uint8(SampleFlag.OUTSIDE))
    moment[on_part] = some.moment_n_mm
    if sample_rate_hz is not None:
        moment[on_part] += (some.flags == 0) * added_at_speed(heights, touch, sample_rate_hz=sample_rate_hz)
    flags[on_part] = some.flags
    if dropout is not None:
        flags[on_part] |= np.where(dropout, np.uint8(SampleFlag.DROPOUT), np.uint8(0))
    flags[..., beyond] |= np.uint8(SampleFlag.OUTSIDE)
    return Traces(moment_n_mm=moment, flags=flags)
