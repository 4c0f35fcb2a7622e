"""Posteriors of every place of a line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from recognition.language.box import Box, hull


@dataclass(frozen=True, eq=False, repr=False)
class Lattice(OneLine):
    """Posteriors of the characters at each place, (places, C) natural logarithms of probabilities; the rest of a row to
    1 is the probability that no readable character stands there. Raises ValueError."""

    chars: tuple[str, ...]
    log_belief: NDArray[np.float64]
    boxes: tuple[Box, ...] = ()

    def __post_init__(self) -> None:
        log = np.array(self.log_belief, dtype=np.float64)
        if log.ndim != 2 or log.shape[1] != len(self.chars):
            raise ValueError(f"log_belief {log.shape} does not fit {len(self.chars)} characters")
        if len(set(self.chars)) != len(self.chars):
            raise ValueError("a character stands twice in the lattice")
        if np.isnan(log).any() or (np.exp(log).sum(axis=1) > 1.0 + 1e-6).any():
            raise ValueError("beliefs must be numbers whose probabilities sum to at most 1 at every place")
        if self.boxes and len(self.boxes) != log.shape[0]:
            raise ValueError(f"{len(self.boxes)} boxes for {log.shape[0]} places")
        log.flags.writeable = False
        object.__setattr__(self, "log_belief", log)

    @property
    def n_places(self) -> int:
        return int(self.log_belief.shape[0])

    @property
    def box(self) -> Box | None:
        return hull(self.boxes)

    @property
    def text(self) -> str:
        return "".join(self.chars[k] for k in self.log_belief.argmax(axis=1))

    @property
    def surest(self) -> float:
        return float(np.exp(self.log_belief.max(initial=-np.inf)))
