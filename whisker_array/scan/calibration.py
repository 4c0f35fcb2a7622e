"""Gain and offset of every whisker, and the moment computed from a raw signal.

    raw --- offset, / gain ---> moment in N mm                                               (apply_calibration)

One lead-in before each scan gives the calibration: the whiskers first hang in air (no moment), then run over
clean land (the moment that the whisker model expects)::

    raw |             ________________          raw_air  = offset
        |            /   land                   raw_land = offset + gain * expected land moment
        |  _air_____/
        +------------------------------> sample

The axis of whiskers is the last but one, the axis of samples the last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from whisker_array.scan.sensor import Gauges, SensorError, check_signal

MIN_LEAD_IN_SAMPLES = 16
"""Fewest samples in air, and on land, for a calibration."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Gauges):
    """Gain and offset of every whisker from a lead-in; gains `from_land` do not show the true friction."""

    from_land: bool = False


def apply_calibration(raw: NDArray[np.floating], calibration: Calibration) -> NDArray[np.float32]:
    """The moment, N mm, from the raw signal (..., whiskers, samples). Raises SensorError for another shape."""
    check_signal("raw", raw, calibration.gain.size)
    scale = (1.0 / calibration.gain).astype(np.float32)[:, None]
    offset = calibration.offset_n_mm.astype(np.float32)[:, None]
    return np.asarray((raw.astype(np.float32) - offset) * scale, dtype=np.float32)


def calibrate_lead_in(
    air: NDArray[np.floating],
    land: NDArray[np.floating],
    *,
    expected_land_moment_n_mm: float,
    max_gain_uncertainty: float = 0.01,
) -> Calibration:
    """Gain and offset of every whisker from its lead-in: first air, then land. An error in the expected land moment
    changes all gains equally and leaves m / m_land - 1 unchanged. Raises SensorError: lead-in too short, not finite or
    too noisy; a moment on land that does not stand out from air."""
    air64, land64 = np.asarray(air, dtype=np.float64), np.asarray(land, dtype=np.float64)
    if air64.ndim != 2 or land64.ndim != 2 or air64.shape[0] != land64.shape[0]:
        raise SensorError(f"air {air64.shape} and land {land64.shape} must both be (whiskers, samples)")
    if not math.isfinite(expected_land_moment_n_mm) or expected_land_moment_n_mm == 0.0:
        raise SensorError(
            f"expected_land_moment_n_mm is {expected_land_moment_n_mm}", hint="it must not be 0"
        )
    for name, signal in (("air", air64), ("land", land64)):
        if signal.shape[1] < MIN_LEAD_IN_SAMPLES:
            raise SensorError(
                f"the lead-in has {signal.shape[1]} samples of {name}",
                hint=f"it needs {MIN_LEAD_IN_SAMPLES} or more",
            )
        if not np.isfinite(signal).all():
            raise SensorError(
                f"the lead-in in {name} is not finite", hint="begin the scan on the part, clear of marks"
            )
    offset = air64.mean(axis=1)
    rise = land64.mean(axis=1) - offset
    error = np.sqrt(air64.var(axis=1, ddof=1) / air64.shape[1] + land64.var(axis=1, ddof=1) / land64.shape[1])
    floor = 1e-6 * abs(expected_land_moment_n_mm)
    wrong = (
        (
            np.abs(rise) <= np.maximum(10.0 * error, floor),
            "the moment on land does not stand out from air",
            "broken whisker or gauge, no preload, or the tip beyond the part",
        ),
        (
            np.sign(rise) != np.sign(expected_land_moment_n_mm),
            "the land moment has the wrong sign",
            "gauge wired the other way round, or air and land exchanged",
        ),
        (
            error > max_gain_uncertainty * np.abs(rise),
            f"the lead-in is too noisy for a gain within {max_gain_uncertainty:.1%}",
            "take a longer lead-in or more preload",
        ),
    )
    for bad, what, hint in wrong:
        if bad.any():
            numbers = np.flatnonzero(bad)
            listed = ", ".join(map(str, numbers[:8])) + (", ..." if numbers.size > 8 else "")
            raise SensorError(what, where=f"whiskers {listed}", hint=hint)
    return Calibration(gain=rise / expected_land_moment_n_mm, offset_n_mm=offset, from_land=True)
