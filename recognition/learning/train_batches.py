"""Strips of a folder in batches: of alike widths, in another order each time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from recognition.experts.recogniser import CHARACTERS
from recognition.learning.training_strips import TALL_ROWS, TrainingStrip, read_strips
from recognition.views.view import LAYERS

_SORTED_BATCHES = 32
"""Batches' worth of strips that are sorted by width."""


@dataclass(eq=False)
class Strips:
    """The strips of a folder, to which others may be added while it is read."""

    folder: Path
    strips: list[TrainingStrip] = field(default_factory=list)
    files: set[Path] = field(default_factory=set)

    def read(self) -> list[TrainingStrip]:
        """All there are by now."""
        new = sorted(p for p in self.folder.glob("*.npz") if ".tmp" not in p.name and p not in self.files)
        self.files.update(new)
        self.strips += read_strips(new)
        return self.strips


def is_easy(strip: TrainingStrip) -> bool:
    """Whether a beginner can learn from it."""
    return strip.severity < 0.35 and (strip.source != "photo" or strip.severity < 0.1)


def drawn_again(strips: Sequence[TrainingStrip], rng: np.random.Generator) -> list[TrainingStrip]:
    """All strips but most photographs that dirt has made unreadable: they teach little."""
    return [s for s in strips if s.source != "photo" or s.severity < 0.45 or rng.random() < 0.35]


def gathered(strips: Sequence[TrainingStrip]) -> tuple[Tensor, Tensor]:
    """(n, LAYERS, TALL_ROWS, columns) filled from the left, and (n,) how many columns are each strip's own."""
    columns = torch.tensor([s.layers.shape[2] for s in strips])
    tall = torch.zeros(len(strips), LAYERS, TALL_ROWS, int(columns.max()))
    for row, strip in enumerate(strips):
        tall[row, :, :, : strip.layers.shape[2]] = torch.from_numpy(strip.layers.astype(np.float32))
    return tall, columns


def targets(strips: Sequence[TrainingStrip]) -> tuple[Tensor, Tensor]:
    """Classes of all texts, one after the other, and (n,) their lengths."""
    codes = [[CHARACTERS.index(c) + 1 for c in s.text] for s in strips]
    return torch.tensor([c for code in codes for c in code]), torch.tensor([len(c) for c in codes])


def batches(
    strips: Sequence[TrainingStrip], size: int, rng: np.random.Generator
) -> Iterator[list[TrainingStrip]]:
    """All strips in another order each time, those of alike widths together."""
    order, many = rng.permutation(len(strips)), size * _SORTED_BATCHES
    for first in range(0, len(order), many):
        part = sorted(order[first : first + many], key=lambda i: strips[i].layers.shape[2])
        groups = [part[i : i + size] for i in range(0, len(part) - size + 1, size)]
        for k in rng.permutation(len(groups)):
            yield [strips[i] for i in groups[k]]
