"""What a reader is told before it reads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.depth_rules import DepthRule
from recognition.grammar import Grammar
from whisker_array.simulation.traces import Fidelity


@dataclass(frozen=True)
class ReaderSettings:
    """What a reader is told.

    Attributes:
        fonts: names of built-in fonts or paths of TTF/OTF files; empty for all built-ins.
        mask: format of the serial (`A` letter, `9` digit, `*` either, others themselves; blanks are word gaps).
        height_mm: character height, if known.
        fidelity: how the virtual array feels a height map.
        accept_confidence: readings at least so sure, and with every margin above `accept_margin`, are accepted.
        accept_margin: least lead of the first over the second candidate for acceptance.
        depth_rules: what the mark must meet; a mark that does not is flagged, read all the same.
        grammar: what the serial obeys; the mask's grammar unless given.
    """

    fonts: tuple[str, ...] = ()
    mask: str | None = None
    height_mm: float | None = None
    fidelity: Fidelity = Fidelity.CONTACT
    accept_confidence: float = 0.9
    accept_margin: float = 0.3
    depth_rules: tuple[DepthRule, ...] = ()
    grammar: Grammar | None = None

    def __post_init__(self) -> None:
        if self.height_mm is not None and not (np.isfinite(self.height_mm) and self.height_mm > 0.0):
            raise ValueError(f"height_mm is {self.height_mm}; a character height is a positive number of mm")
        for name in ("accept_confidence", "accept_margin"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it lies between 0 and 1")
