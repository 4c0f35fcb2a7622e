"""Builders of what tests of several rooms need."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.designed_parts import DesignedParts
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.touch import Touch


def extruded(profile_mm: ArrayLike, *, rows: int, pitch_mm: float) -> HeightMap:
    """A surface with one profile along x, alike over all rows."""
    return HeightMap(np.tile(np.asarray(profile_mm), (rows, 1)).astype(np.float32), pitch_mm)


def ideal_chain(n_whiskers: int) -> SensorChain:
    """Sensors that hand every moment on as it is."""
    return SensorChain(np.ones(n_whiskers), np.zeros(n_whiskers))


def scanned(
    surface: HeightMap,
    plan: RasterPlan,
    *,
    touch: Touch,
    others: tuple[Touch, ...] = (),
    fidelity: Fidelity = Fidelity.POINTWISE,
    friction: float | None = None,
    gain_sd: float | None = 0.03,
    chain: SensorChain | None = None,
    **more: Any,
) -> Scan:
    """A scan with sensors as from the bench, drawn from seed 3; `gain_sd` None: ideal ones."""
    rng = np.random.default_rng(3)
    if chain is None and gain_sd is not None:
        n = plan.array.n_whiskers * plan.array.kinds
        chain = draw_sensor_chain(n, rng=rng, gain_sd=gain_sd)
    return trace_scan(
        surface, touch=touch, others=others, plan=plan, fidelity=fidelity, friction=friction, sensor=chain,
        rng=rng, **more,
    )  # fmt: skip


def designed_parts(
    *,
    severities: tuple[float, ...] = (0.3,),
    formats: tuple[str, ...] = ("A9",),
    parts: int = 1,
    seed: int = 1,
    given: tuple[str, ...] = ("font,height,format",),
    **more: Any,
) -> DesignedParts:
    """Parts of every format and severity, the same stamped parts in all of them."""
    return DesignedParts(
        Design.of(
            seed=seed,
            parts_a_cell=parts,
            cross=("font", "format", "severity"),
            alike=True,
            part={"font": "gothic", "format": formats, "severity": severities, "height_mm": 5.0, **more},
            given=given,
        )
    )
