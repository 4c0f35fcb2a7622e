"""Strips of a folder in batches: of alike widths, in another order each time, made ready by worker processes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from recognition.experts.recogniser import CHARACTERS
from recognition.learning.covers import cover_rivals
from recognition.learning.surroundings import vary_surroundings
from recognition.learning.training_samples import TALL_ROWS, TrainingStrip, files_in, read_samples
from recognition.views.view import LAYERS

_FILES = 12
"""Read at a time: some 4,000 strips, a gigabyte."""
_SHARES = {"felt": 1.0, "heights": 0.6, "photo": 0.5}
"""Share of the strips of a kind that are used each time: of a part there are three photographs and one scan."""


def rounds(folders: Sequence[Path], rng: np.random.Generator) -> Iterator[list[TrainingStrip]]:
    """Strips of a few files at a time, for ever; files that are put into the folders meanwhile are read as well.

    Raises:
        ValueError: there are no files.
    """
    waiting: list[Path] = []
    while True:
        if not waiting:
            files = files_in(folders)
            waiting = [files[k] for k in rng.permutation(len(files))]
        now, waiting = waiting[:_FILES], waiting[_FILES:]
        yield [strip for strip in read_samples(TrainingStrip, now) if rng.random() < _share(strip)]


def _share(strip: TrainingStrip, *, unreadable: float = 0.45, unreadable_share: float = 0.3) -> float:
    # unreadable, unreadable_share: severity from which dirt hides most of a photograph, and the share of these that
    # is kept: they teach little.
    hidden = strip.source == "photo" and strip.severity >= unreadable
    return _SHARES[strip.source] * (unreadable_share if hidden else 1.0)


def gather(strips: Sequence[TrainingStrip]) -> tuple[Tensor, Tensor]:
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
    order, many = rng.permutation(len(strips)), size * 32
    for first in range(0, len(order), many):
        part = sorted(order[first : first + many], key=lambda i: strips[i].layers.shape[2])
        groups = [part[i : i + size] for i in range(0, len(part) - size + 1, size)]
        for k in rng.permutation(len(groups)):
            yield [strips[i] for i in groups[k]]


@dataclass(frozen=True)
class Batch:
    """Strips to learn from at once.

    Attributes:
        tall: (n, LAYERS, TALL_ROWS, columns) float16, each filled from the left.
        columns: (n,) how many of them are its own.
        classes: of all texts, one after the other.
        lengths: (n,) of the texts.
    """

    tall: Tensor
    columns: Tensor
    classes: Tensor
    lengths: Tensor


class Batches(IterableDataset[Batch]):
    """Batches for ever; each worker process draws its own.

    Args:
        folders: of files of strips.
        size: strips to a batch.
        covers: lay covers over the strokes that tell characters apart.
        seed: of order, surroundings and covers.
    """

    def __init__(self, folders: Sequence[Path], *, size: int, covers: bool, seed: int) -> None:
        self.folders, self.size, self.covers, self.seed = tuple(folders), size, covers, seed

    def __iter__(self) -> Iterator[Batch]:
        """Yield batches.

        Raises:
            ValueError: no strips, or fewer than a batch has.
        """
        worker = get_worker_info()
        seed = self.seed if worker is None else self.seed + 1000 * (worker.id + 1)
        rng, draw = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
        for chosen in rounds(self.folders, rng):
            if len(chosen) < self.size:
                raise ValueError(
                    f"{len(chosen)} strips are fewer than a batch of {self.size}: draw more of them"
                )
            for strips in batches(chosen, self.size, rng):
                strips = vary_surroundings(strips, rng=rng)
                tall, columns = gather(strips)
                if self.covers:
                    tall = cover_rivals(tall, [s.text for s in strips], [s.places for s in strips], rng=draw)
                yield Batch(tall.half(), columns, *targets(strips))
