"""Gain and offset of every whisker, from the air and lead-in samples of a scan's own passes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.scan.calibration import Calibration, calibrate_lead_in
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor import SensorError


@dataclass(frozen=True, eq=False, repr=False)
class LeadIn(OneLine):
    """A calibration, and the samples that it is based on and their rms error; without land samples a gain stays 1."""

    calibration: Calibration
    air_samples: NDArray[np.int64]
    land_samples: NDArray[np.int64]
    residual_n_mm: Floats


def calibrate_scan(scan: Scan) -> LeadIn:
    """Calibrate every whisker from the raw signals of a scan. Raises SensorError without usable samples."""
    if all(s.plan.n_lead == 0 for s in scan.sweeps):
        what = "no lead-in on land in the scan (n_lead is 0)"
        raise SensorError(what, hint="begin the passes on land and state n_lead")
    if all(s.air_n_mm.shape[2] == 0 for s in scan.sweeps):
        raise SensorError("no samples in the air", hint="record some with the array lifted before each pass")
    expected = [scan.touches[kind].land_moment_n_mm() for kind in scan.kind]
    gain, offset, residual = np.ones(scan.n_whiskers), np.zeros(scan.n_whiskers), np.zeros(scan.n_whiskers)
    n_air, n_land = np.zeros((2, scan.n_whiskers), dtype=np.int64)
    for whisker in range(scan.n_whiskers):
        air, land = _samples(scan, whisker)
        n_air[whisker], n_land[whisker] = air.size, land.size
        if land.size == 0:
            air = np.concatenate([s.air_n_mm[:, whisker].ravel() for s in scan.sweeps])
            offset[whisker] = float(air.mean(dtype=np.float64))
        else:
            try:
                of_whisker = calibrate_lead_in(
                    air[None], land[None], expected_land_moment_n_mm=expected[whisker]
                )
            except SensorError as error:
                raise SensorError(error.what, where=f"whisker {whisker}", hint=error.hint) from error
            gain[whisker], offset[whisker] = of_whisker.gain[0], of_whisker.offset_n_mm[0]
        over = (np.concatenate([air, land]) - offset[whisker]) / gain[whisker]
        over[air.size :] -= expected[whisker]
        residual[whisker] = np.sqrt(np.mean(over**2))
    if not n_land.any():
        raise SensorError(
            "no whisker runs in on the part's land: every lead-in is flagged as beyond the part or missing",
            hint="begin passes on bare land of the part; for imported traces, correct part_mm and lead_mm",
        )
    calibration = Calibration(gain=gain, offset_n_mm=offset, from_land=True)
    return LeadIn(calibration, n_air, n_land, residual)


def _samples(scan: Scan, whisker: int) -> tuple[Floats, Floats]:
    air, land = [], []
    for sweep in (s for s in scan.sweeps if not s.plan.pushed):  # when pushed, friction acts the other way
        lead = sweep.plan.n_lead
        good = (sweep.flags[:, whisker, :lead] == 0).all(axis=1)
        air.append(sweep.air_n_mm[good, whisker].ravel())
        land.append(sweep.moment_n_mm[good, whisker, :lead].ravel())
    return np.concatenate(air).astype(np.float64), np.concatenate(land).astype(np.float64)
