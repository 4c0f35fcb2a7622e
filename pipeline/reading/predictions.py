"""Figures of a whisker and their uncertainty, by first-order propagation.

sd^2 = g^T C g,     g_i = (f(p + sd_i) - f(p - sd_i)) / (2 sd_i)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from whisker_array.identification.bench import Unknown, first_order_sd, nominal_bench
from whisker_array.identification.knowledge import Knowledge
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

Quantity = Callable[[LShaped, Touch], float]


@dataclass(frozen=True)
class Prediction:
    """A figure of a whisker: for the nominal one (NaN if it jams), and its standard deviation."""

    what: str
    value: float
    sd: float


def predictions(
    whisker: LShaped, touch: Touch, known: Knowledge, *, more: Mapping[str, Quantity] | None = None
) -> tuple[Prediction, ...]:
    """Figures of an identified whisker: land, edges, the steepest wall, and `more` by name (NaN if it has none)."""
    bench = nominal_bench(whisker, touch, n_whiskers=1)

    def of(quantity: Quantity, name: Unknown | None = None, off: float = 0.0) -> float:
        moved = bench if name is None else bench.with_values(**{name.value: bench[name] + off})
        try:
            return quantity(moved.whisker(whisker), moved.touch(whisker))
        except WhiskerError:
            return math.nan

    figures = []
    for what, quantity in {**_ALWAYS, **(more or {})}.items():
        sd = first_order_sd(lambda i, off: of(quantity, known.names[i], off), known.sd, known.covariance)  # noqa: B023
        figures.append(Prediction(what, of(quantity), sd))
    return tuple(figures)


def _factor(alpha_deg: float) -> Quantity:
    """F of (16) at a wall of slope angle `alpha_deg`, positive for a falling wall."""
    slope = -math.tan(math.radians(alpha_deg))
    return lambda _, touch: float(moment_ratio(slope, touch.friction, touch.tip))


def _steepest_deg(_: LShaped, touch: Touch) -> float:
    """The steepest rising wall that does not jam: where e_y.D11 R'a of (16) vanishes."""
    row, mu = touch.tip.compliance_mm_per_n[1], touch.friction
    against = float(row[0] + mu * row[1])
    return math.degrees(math.atan2(float(row[1] - mu * row[0]), against)) if against > 0.0 else 90.0


_ALWAYS: dict[str, Quantity] = {
    "moment of the land, N mm": lambda _, touch: abs(touch.land_moment_n_mm()),
    "the same per mm of depth, N mm": lambda _, touch: abs(touch.land_moment_n_mm()) / touch.preload_mm,
    "F of a wall falling at 45 deg": _factor(45.0),
    "F of a wall rising at 45 deg": _factor(-45.0),
    "steepest wall it climbs, deg": _steepest_deg,
}
