"""Raw moments of passes in one direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from glyphs.surface.maps import MapError
from whisker_array.whisker.passes import SweepPlan


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(OneLine):
    """The raw moments (passes, whiskers, samples) of all passes in one direction, and those in air before each."""

    plan: SweepPlan
    moment_n_mm: NDArray[np.float32]
    flags: NDArray[np.uint8]
    air_n_mm: NDArray[np.float32]

    def __post_init__(self) -> None:
        shape = (*self.plan.line_mm.shape, self.plan.n_samples)
        if self.moment_n_mm.shape != shape or self.flags.shape != shape:
            raise MapError(
                f"moments {self.moment_n_mm.shape} and flags {self.flags.shape} do not fit the plan {shape}"
            )
        if self.air_n_mm.shape[:2] != shape[:2]:
            raise MapError(f"air samples {self.air_n_mm.shape} do not fit the plan {shape}")

    def of(self, whiskers: NDArray[np.intp]) -> Sweep:
        moment, air = self.moment_n_mm[:, whiskers], self.air_n_mm[:, whiskers]
        return Sweep(self.plan.of(whiskers), moment, self.flags[:, whiskers], air)


def fill_air(air_n_mm: NDArray[np.floating]) -> NDArray[np.float32]:
    """Replace missing air samples (passes, whiskers, samples) by the median of their pass, which leaves its offset."""
    air = np.ascontiguousarray(air_n_mm, dtype=np.float32)
    missing = np.isnan(air)
    some = missing.any(axis=-1) & ~missing.all(axis=-1)
    middle = np.zeros(some.shape, dtype=np.float32)
    middle[some] = np.nanmedian(air[some], axis=-1)
    return np.where(missing, middle[..., None], air)
