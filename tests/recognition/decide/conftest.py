"""Thresholds that no fit moves."""

from __future__ import annotations

import pytest

from recognition.decide import risk as room

USUAL = 0.97


@pytest.fixture(autouse=True)
def fixed_threshold(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every sense accepts from the module's THRESHOLD, whatever the risk; None for the thresholds of the fit."""
    threshold = getattr(request.module, "THRESHOLD", USUAL)
    if threshold is not None:
        monkeypatch.setattr(room, "threshold_of", lambda source, risk: threshold)
