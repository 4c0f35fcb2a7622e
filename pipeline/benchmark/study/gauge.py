"""Gauge R&R by analysis of variance: the shares of gauge and parts in the variation of depth.

    x_ijk = mean + part_i + appraiser_j + (part x appraiser)_ij + repeat_k        all random

AIAG, *Measurement Systems Analysis*, 4th edition (2010), chapter III, section B ("Analysis of Variance Method") and
appendix A. If the interaction is not significant at 5 %, it is pooled with the repeats. With one appraiser there is no
reproducibility, only parts and repeats.

    %GRR below 10: good; 10 to 30: marginal; above: poor. With fewer than 5 categories it hardly distinguishes parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

# significance level of the interaction, as in the manual's example
SIGNIFICANT = 0.05
# distinct categories per ratio of part variation to gauge variation, rounded down
CATEGORIES = 1.41
GOOD, USABLE = 0.10, 0.30
LEAST_CATEGORIES = 5


@dataclass(frozen=True)
class Row:
    """A row of the analysis of variance, mm²: ratio to the tested mean square, and its probability by chance."""

    source: str
    freedom: int
    squares: float
    mean_square: float
    f: float | None = None
    p: float | None = None


@dataclass(frozen=True)
class GaugeRR:
    """Gauge study: standard deviations of repeats by one appraiser, between appraisers (if several) and parts."""

    table: tuple[Row, ...]
    parts: int
    appraisers: int
    trials: int
    pooled: bool  # the interaction is pooled with the repeats; otherwise it counts as reproducibility
    repeatability_mm: float
    reproducibility_mm: float | None
    part_mm: float

    @property
    def gauge_mm(self) -> float:
        return math.hypot(self.repeatability_mm, self.reproducibility_mm or 0.0)

    @property
    def total_mm(self) -> float:
        return math.hypot(self.gauge_mm, self.part_mm)

    @property
    def share(self) -> float:
        """%GRR: the gauge's standard deviation as a share of the total; 0 if nothing varies."""
        return self.of_total(self.gauge_mm)

    def of_total(self, deviation_mm: float) -> float:
        return deviation_mm / self.total_mm if self.total_mm else 0.0

    @property
    def categories(self) -> int | None:
        return math.floor(CATEGORIES * self.part_mm / self.gauge_mm) if self.gauge_mm else None

    @property
    def verdict(self) -> str:
        if self.share > USABLE:
            return "poor"
        few = self.categories is not None and self.categories < LEAST_CATEGORIES
        return "marginal" if self.share > GOOD or few else "good"


def gauge_rr(values_mm: ArrayLike) -> GaugeRR:
    """Compute the study of depths (parts, appraisers, trials), mm, at least 2, 1 and 2. Raises ValueError."""
    x = np.asarray(values_mm, dtype=np.float64)
    if x.ndim != 3 or x.shape[0] < 2 or x.shape[1] < 1 or x.shape[2] < 2:
        raise ValueError(
            f"depths have shape {x.shape}; give parts, appraisers and trials: at least 2, 1 and 2"
        )
    if not np.isfinite(x).all():
        raise ValueError("a depth is not finite; leave parts out whose depth is not known")
    p, o, r = x.shape
    mean = x.mean()
    by_part, by_appraiser, by_cell = x.mean(axis=(1, 2)), x.mean(axis=(0, 2)), x.mean(axis=2)
    cells = by_cell - by_part[:, None] - by_appraiser[None, :] + mean
    repeat = _row("repeatability", p * o * (r - 1), ((x - by_cell[..., None]) ** 2).sum())
    error, between, interaction = repeat, [], []
    cell_mm2, appraiser_mm2, pooled = 0.0, 0.0, False
    if o > 1:
        cell = _row("parts x appraisers", (p - 1) * (o - 1), r * (cells**2).sum(), against=repeat)
        pooled = cell.p is None or cell.p > SIGNIFICANT
        error = (
            _row("pooled", repeat.freedom + cell.freedom, repeat.squares + cell.squares) if pooled else cell
        )
        spread = p * r * ((by_appraiser - mean) ** 2).sum()
        between, interaction = [_row("appraisers", o - 1, spread, against=error)], [cell]
        cell_mm2 = 0.0 if pooled else max(0.0, (cell.mean_square - repeat.mean_square) / r)
        appraiser_mm2 = max(0.0, (between[0].mean_square - error.mean_square) / (p * r))
    part = _row("parts", p - 1, o * r * ((by_part - mean) ** 2).sum(), against=error)
    total = Row("total", x.size - 1, float(((x - mean) ** 2).sum()), float(x.var(ddof=1)))
    return GaugeRR(
        table=(part, *between, *interaction, repeat, *((error,) if pooled else ()), total),
        parts=p,
        appraisers=o,
        trials=r,
        pooled=pooled,
        repeatability_mm=math.sqrt((error if pooled else repeat).mean_square),
        reproducibility_mm=math.sqrt(appraiser_mm2 + cell_mm2) if o > 1 else None,
        part_mm=math.sqrt(max(0.0, (part.mean_square - error.mean_square) / (o * r))),
    )


def _row(source: str, freedom: int, summed: float, *, against: Row | None = None) -> Row:
    squares, mean_square = float(summed), float(summed) / freedom
    if against is None or against.mean_square <= 0.0:
        return Row(source, freedom, squares, mean_square)
    from scipy.stats import f as f_distribution

    f = mean_square / against.mean_square
    return Row(
        source, freedom, squares, mean_square, f, float(f_distribution.sf(f, freedom, against.freedom))
    )
