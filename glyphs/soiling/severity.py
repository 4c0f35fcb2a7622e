"""Severity: one scale, 0 to 1, for all soils.

At the same severity every soil costs a fixed reference reader as many characters as the workshop's dirt does: the
generic recognition network of RapidOCR, on the ideal height map. `python -m pipeline.benchmark.soil_severity` measures
that and prints this table.
"""

from __future__ import annotations

from typing import Final

import numpy as np

KNOTS: Final = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)
AMOUNTS: Final[dict[str, tuple[float, ...]]] = {}
"""Amount of each soil at those severities; a soil that is not listed has its severity as its amount."""


def amount_of(soil: str, severity: float) -> float:
    """How much of a soil makes that severity, 0 to 1."""
    return float(np.interp(severity, KNOTS, AMOUNTS.get(soil, KNOTS)))
