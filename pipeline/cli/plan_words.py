"""A raster plan in words."""

from __future__ import annotations

from whisker_array.whisker.array import RasterPlan, WhiskerArray


def describe_plan(plan: RasterPlan) -> str:
    """Describe region, array, passes and time on one line."""
    x0, y0, x1, y1 = plan.region_mm
    ways = "/".join(f"{int(d)}°" for d in plan.directions) + (" and back" if plan.two_way else "")
    return (
        f"{x1 - x0:.1f} x {y1 - y0:.1f} mm, {_describe_array(plan.array)}, "
        f"lines {plan.line_pitch_mm:.3f} mm, {ways}, {plan.n_passes} passes, {plan.n_samples:,} samples, "
        f"{plan.scan_time_s:.0f} s at {plan.speed_mm_s:g} mm/s"
    )


def _describe_array(array: WhiskerArray) -> str:
    combs = f"{array.kinds} kinds of " if array.kinds > 1 else ""
    words = f"{combs}{array.n_whiskers} whiskers {array.pitch_mm:.2f} mm apart"
    if array.rows * array.kinds > 1 and array.stagger_mm > 0.0:
        words += f", {array.rows * array.kinds} rows {array.stagger_mm:.2f} mm behind each other"
    return words + (f", {array.mass_g:.2g} g" if array.body is not None else "")
