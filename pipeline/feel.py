"""A height map under the virtual array: mounted level, scanned whole, with sensors as from the bench."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from glyphs.maps import HeightMap
from recognition.mounting import first_look, level
from whisker_array.array import RasterPlan, default_plan
from whisker_array.scan import Scan, default_touch, trace_scan
from whisker_array.sensor import draw_sensor_chain
from whisker_array.traces import Fidelity

_RANGE_LAND_MOMENTS = 3.0


def plan_for(height_map: HeightMap, *, height_mm: float | None) -> tuple[RasterPlan, float]:
    """The raster over the whole map, and the character height that it is made for.

    Raises:
        ValueError: no height given, and none to be seen in the map.
    """
    if height_mm is None:
        heights = first_look(level(height_map)).heights_mm
        if not heights:
            raise ValueError("no characters to be seen, so the scale is unknown; give --height-mm")
        height_mm = float(f"{heights[0]:.3g}")
    return default_plan((0.0, 0.0, *height_map.size_mm), character_height_mm=height_mm), height_mm


def feel(
    height_map: HeightMap,
    *,
    plan: RasterPlan,
    height_mm: float,
    fidelity: Fidelity = Fidelity.CONTACT,
    noise: bool = True,
    sensor_seed: int = 0,
    part_id: str = "",
) -> Scan:
    """Scan the map; with noise the sensors have gains, offsets, drift, vibration and a 16 bit converter.

    Raises:
        MapError: a map that cannot be scanned.
    """
    touch = default_touch(height_mm)
    rng = np.random.default_rng(sensor_seed)
    full_scale = _RANGE_LAND_MOMENTS * abs(touch.land_moment_n_mm())
    chain = draw_sensor_chain(plan.array.n_whiskers, rng=rng, full_scale_n_mm=full_scale) if noise else None
    scan = trace_scan(
        level(height_map),
        touch=touch,
        plan=plan,
        fidelity=fidelity,
        sensor=chain,
        rng=rng if noise else None,
        part_id=part_id,
    )
    return replace(scan, start_time=datetime.now(UTC).isoformat(timespec="seconds"))
