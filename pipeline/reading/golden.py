"""Measure gain, zero, tip radius, friction and preload from a golden part's scan, by contact simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.common.golden_record import GoldenMeasure, Measured
from pipeline.errors import naming
from pipeline.formats.touch_file import read_scan
from pipeline.reading.sender_names import sender_names


def measure_sent(scan: Path, called: str, relief: Path) -> dict[GoldenMeasure, Measured]:
    """Call `measure_golden` for a file that was sent; errors name it as its sender does. Raises FileError: the scan
    cannot be used. OwnFileError: the relief, or another own file, cannot. FaultError: a fault of this program."""
    with sender_names(scan.parent, {str(scan): called}):
        return measure_golden(scan, relief.absolute())


def measure_golden(scan: Path, relief: Path) -> dict[GoldenMeasure, Measured]:
    """Measure the state of the whiskers from a recording (.h5) of a part of known relief, a height map or the TOML of a
    test piece, whose corner is the origin of the scan's frame. Raises FileError."""
    # imported here: the service itself does not measure, its workers do
    from pipeline.formats.whisker_file import heights_of_piece
    from whisker_array.identification.bench import WORN_TIP, Unknown
    from whisker_array.identification.fit import identify

    recording = read_scan(scan)
    heights = heights_of_piece(relief)
    with naming(scan):
        fitted = identify(recording, heights, whisker=recording.touch, tip_sd=WORN_TIP)
    whiskers = np.array(fitted.whiskers)
    gains = len(Unknown) + whiskers
    mean = np.zeros(fitted.before.size)
    mean[gains] = 1.0 / gains.size
    land = abs(recording.touch.land_moment_n_mm())
    air = [
        sweep.air_n_mm.mean(axis=2)[:, whiskers] / land for sweep in recording.sweeps if sweep.air_n_mm.size
    ]
    measures = {
        GoldenMeasure.GAIN: Measured(
            float(fitted.bench.gain[whiskers].mean()), float(np.sqrt(mean @ fitted.repeated @ mean))
        )
    }
    if air:
        zeros = np.concatenate(air)
        # the largest of the whiskers' zeros: in their mean, shifts in opposite directions would cancel
        worst = int(np.argmax(np.abs(zeros.mean(axis=0))))
        measures[GoldenMeasure.ZERO] = Measured(
            float(zeros[:, worst].mean()), float(zeros[:, worst].std() / np.sqrt(len(zeros)))
        )
    sd = dict(zip(Unknown, np.sqrt(np.diag(fitted.repeated)), strict=False))
    for name in (GoldenMeasure.RADIUS, GoldenMeasure.FRICTION, GoldenMeasure.PRELOAD):
        unknown = Unknown(name.value)
        measures[name] = Measured(fitted.bench[unknown], float(sd[unknown]))
    return measures
