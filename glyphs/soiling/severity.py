"""Severity: one scale, 0 to 1, for all soils, at which a fixed reader (RapidOCR's generic network, on the ideal height
map) loses as much of its mean probability of the true characters as under `workshop`. `python
tests/benchmarks/soil_severity.py --write` measures the amounts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

MANIFEST: Final = Path(__file__).with_name("severity.fit.json")
_FIT: Final = json.loads(MANIFEST.read_text(encoding="utf-8"))
KNOTS: Final[tuple[float, ...]] = tuple(_FIT["knots"])
AMOUNTS: Final[dict[str, tuple[float, ...]]] = {soil: tuple(each) for soil, each in _FIT["amounts"].items()}
"""Amount of each soil at the severities KNOTS; for a soil that is not listed, the amount equals the severity."""


def amount_of(soil: str, severity: float) -> float:
    """Return the amount of a soil, 0 to 1, at a severity."""
    return float(np.interp(severity, KNOTS, AMOUNTS.get(soil, KNOTS)))
