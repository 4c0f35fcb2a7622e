"""Severity: one scale, 0 to 1, for all soils.

At the same severity every soil costs a fixed reference reader as much belief in the true characters as the workshop's
dirt does: the generic recognition network of RapidOCR, on the ideal height map.
`python tests/benchmarks/soil_severity.py` measures that and prints this table.
"""

from __future__ import annotations

from typing import Final

import numpy as np

KNOTS: Final = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)
AMOUNTS: Final[dict[str, tuple[float, ...]]] = {
    "caked": (0.0, 0.1632, 0.2397, 0.3569, 0.3821, 0.4277, 0.4688, 0.4912),
    "rust": (0.0, 0.2086, 0.2884, 0.3784, 0.4429, 0.533, 0.591, 0.6227),
    "paint": (0.0, 0.1615, 0.2133, 0.2875, 0.3705, 0.4386, 0.5, 0.5408),
    "weld": (0.0, 0.131, 0.2051, 0.2776, 0.3708, 0.453, 0.5228, 0.557),
    "mud": (0.0, 0.2068, 0.2306, 0.3282, 0.3981, 0.4972, 0.552, 0.5813),
    "wear": (0.0, 0.1804, 0.241, 0.3648, 0.4282, 0.5351, 0.6194, 0.662),
    "casting": (0.0, 0.2391, 0.3492, 0.4059, 0.502, 0.5438, 0.5815, 0.6021),
}
"""Amount of each soil at those severities; a soil that is not listed has its severity as its amount."""


def amount_of(soil: str, severity: float) -> float:
    """Return the amount of a soil, 0 to 1, at a severity."""
    return float(np.interp(severity, KNOTS, AMOUNTS.get(soil, KNOTS)))
