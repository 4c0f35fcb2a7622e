"""A recording without what cannot be used: lines of dead and noisy whiskers, single spiked samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from whisker_array.estimation import fault_measures as measures
from whisker_array.estimation.faults import SPIKE, UNUSABLE, Fault, FaultKind
from whisker_array.scan.scan import Scan, only
from whisker_array.simulation.traces import SampleFlag


def without_faulty(scan: Scan, faults: Sequence[Fault]) -> Scan:
    """The scan, what faults make useless flagged `SampleFlag.FAULTY`; the scan itself where there is nothing of that.

    Args:
        scan: as recorded.
        faults: found in it.
    """
    whiskers = sorted({f.whisker for f in faults if f.kind in UNUSABLE and f.whisker is not None})
    spiked = any(f.kind is FaultKind.SPIKES for f in faults)
    if not whiskers and not spiked:
        return scan
    bad, columns = np.uint8(SampleFlag.FAULTY), np.flatnonzero(np.asarray(scan.kind) == 0)
    spikes = (
        {f.sweep.plan.direction: measures.spikes(f, least=SPIKE) for f in measures.felt_shares(only(scan))}
        if spiked
        else {}
    )
    sweeps = []
    for sweep in scan.sweeps:
        flags = sweep.flags.copy()
        flags[:, whiskers] |= bad
        if not sweep.plan.pushed and sweep.plan.direction in spikes:
            flags[:, columns] |= np.where(spikes[sweep.plan.direction], bad, np.uint8(0))
        sweeps.append(replace(sweep, flags=flags))
    return replace(scan, sweeps=tuple(sweeps))
