"""Findings of a recording's faults: marks at wrong places send the part to review, other faults do not."""

from __future__ import annotations

import pytest

from recognition.decide.decision import BROKEN, bench_faults
from recognition.touch import bench_findings
from whisker_array.estimation.faults import Fault, FaultKind


@pytest.mark.parametrize("kind", FaultKind)
@pytest.mark.parametrize("whisker", [None, 1])
def test_only_channels_at_wrong_places_send_a_part_to_review(kind: FaultKind, whisker: int | None) -> None:
    findings = bench_findings([Fault(kind, "what and where", whisker)])
    assert bench_faults(findings) == ("what and where",)
    assert bool(findings[0].flag & BROKEN) == (kind in (FaultKind.EXCHANGED, FaultKind.DOUBLED))
