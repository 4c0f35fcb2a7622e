"""Train the recogniser on strips of known text, by connectionist temporal classification.

    files of strips --rounds--> some 4,000 strips --batches--> similar widths --surroundings, covers--> Batch --> loss

Worker processes prepare the batches. Accuracy is that of the best class of every step, without a format.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rapidfuzz.distance import Levenshtein
from torch import Tensor, nn
from torch.nn import functional as f
from torch.utils.data import IterableDataset, get_worker_info

from recognition.learning.augment import augment
from recognition.learning.covers import cover_rivals
from recognition.learning.network import COLUMNS, Recogniser
from recognition.learning.photo_covers import cover_photos
from recognition.learning.public_start import load_start
from recognition.learning.quantise import quantise
from recognition.learning.surroundings import vary_surroundings
from recognition.learning.training_loop import DEVICE, Task, Training, export, load_batches
from recognition.learning.training_samples import (
    TALL_ROWS,
    WIDE_MARGIN,
    TrainingStrip,
    files_in,
    read_samples,
    rounds,
)
from recognition.recogniser.recogniser import CHARACTERS, widen
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS
from recognition.see.view import LAYERS

_SIZES = (0.003, 0.1)
"""Limits of the root mean square of weights that scales their learning rate."""
_FILES = 12
"""Files read at a time: some 4,000 strips, a gigabyte."""
_SHARES = {"felt": 1.0, "heights": 0.6, "photo": 0.5}
"""Share of the strips of a kind that are used in each round: a part has six photographs and one scan."""


def task(folders: Sequence[Path], held_out: Path, how: Training) -> Task:
    """The recogniser and its training data. The learning rate is relative to the root mean square of the weights of
    each array (default: 1e-3), which differ a hundredfold: a single rate of 1.5e-4 destroyed what the public network
    had learned. Raises MarksError."""
    network = Recogniser(load_start(), CHARACTERS)
    if how.noise:  # to measure the benefit of the public start
        for module in network.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                module.reset_parameters()
    if how.start is not None:
        network.load_state_dict(torch.load(how.start, weights_only=True))
    network = network.to(DEVICE, memory_format=torch.channels_last).train()
    rate = how.rate or 1e-3
    optimiser = torch.optim.Adam(
        [{"params": [p], "lr": rate * _size(p)} for p in network.parameters()], fused=DEVICE == "cuda"
    )
    held = read_samples(TrainingStrip, files_in([held_out]))

    def judge(trained: Recogniser) -> tuple[float, dict[str, Any]]:
        counts = measure(trained, held)
        words = {key: f"{100 * (1 - wrong / n):.2f} % of {n}" for key, (n, wrong, _) in counts.items()}
        return counts["all"][1], words

    def write(out: Path) -> None:
        whole = out.with_suffix(".float.onnx")
        export_float(network, whole)
        # a hundred strips give the ranges of the eight-bit layers
        seen = next(rounds(TrainingStrip, folders, np.random.default_rng(how.seed), files=_FILES))
        quantise(whole, out, [as_read(strip) for strip in seen[:100]])

    def batches_from(step: int) -> Iterator[Batch]:
        return load_batches(Batches(folders, size=how.batch, covers=how.covers, seed=how.seed + step), how)

    return Task(
        network,
        optimiser,
        batches_from,
        lambda batch, draw: _loss(network, batch, draw),
        judge,
        write,
        early=() if how.noise else network.early(),
    )


def export_float(network: Recogniser, out: Path) -> None:
    """Write the network to an ONNX file in floating point, for any number of strips of any length."""
    strip = torch.zeros(1, LAYERS, ROWS, 8 * COLUMNS)
    axes = ({0: "n", 3: "columns"}, {0: "n", 1: "steps"})
    export(network, strip, out, names=("strip", "posteriors"), axes=axes)


def _size(weights: Tensor) -> float:
    return float(weights.detach().square().mean().sqrt().clamp(*_SIZES))


def _loss(network: Recogniser, batch: Batch, draw: torch.Generator, *, empty_length: int = 8) -> Tensor:
    device = draw.device
    with torch.no_grad(), device:
        tall, columns = batch.tall.to(device).float(), batch.columns.to(device)
        normal = network.normalise(augment(tall, columns, rng=draw)).to(memory_format=torch.channels_last)
    with torch.autocast(device.type, torch.bfloat16):
        posteriors = network.read(normal)
    lengths = batch.lengths.to(device)
    steps = torch.full_like(lengths, posteriors.shape[1])
    each = f.ctc_loss(
        posteriors.permute(1, 0, 2),
        batch.classes.to(device),
        steps,
        lengths,
        reduction="none",
        zero_infinity=True,
    )
    return (each / torch.where(lengths > 0, lengths, empty_length)).mean()


def crop_for_reading(strip: TrainingStrip) -> NDArray[np.float32]:
    """Crop a strip to the size used for reading, (LAYERS, ROWS, columns)."""
    tall = strip.layers.astype(np.float32)
    up = (TALL_ROWS - ROWS) // 2
    cut = round((WIDE_MARGIN - MARGIN) * HEIGHT_ROWS)
    return tall[:, up : up + ROWS, cut : tall.shape[2] - cut]


def as_read(strip: TrainingStrip) -> NDArray[np.float32]:
    """Crop, widen and pad a strip to whole steps, as input of the network."""
    return widen(crop_for_reading(strip), multiple=COLUMNS)


def decode(posteriors: NDArray[np.float32]) -> str:
    """Decode the best class of every step, (steps, classes), without repeats and blanks."""
    best = posteriors.argmax(axis=1)
    characters = [k for k, before in zip(best, [0, *best[:-1]], strict=True) if k and k != before]
    return "".join(CHARACTERS[k - 1] for k in characters).strip()


@torch.no_grad()
def measure(network: Recogniser, strips: Sequence[TrainingStrip]) -> dict[str, tuple[int, int, int]]:
    """Count characters, errors and lines by source and severity; spaces are ignored."""
    network.eval()
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0])
    for strip in strips:
        fed = torch.from_numpy(as_read(strip))[None].to(network.normalise.bell.device)
        read = decode(network(fed)[0].cpu().numpy()).replace(" ", "")
        text = strip.text.replace(" ", "")
        level = min(0.9, 0.3 * round(strip.severity / 0.3 + 0.001))
        dirt = "clean" if strip.severity == 0 else f"{level:.1f}"
        counted = (len(text), Levenshtein.distance(text, read), 1)
        for key in (f"{strip.source} {dirt}", strip.source, "all"):
            counts[key] = [a + b for a, b in zip(counts[key], counted, strict=True)]
    network.train()
    return {key: (n, wrong, lines) for key, (n, wrong, lines) in sorted(counts.items())}


def choose_strips(strips: Sequence[TrainingStrip], rng: np.random.Generator) -> list[TrainingStrip]:
    """Draw the strips to learn from in this round: a smaller share of the frequent kinds."""
    return [strip for strip in strips if rng.random() < _share(strip)]


def _share(strip: TrainingStrip, *, unreadable: float = 0.45, unreadable_share: float = 0.6) -> float:
    # unreadable, unreadable_share: severity from which dirt hides most of a photograph, and the share of such
    # photographs that is kept: they teach little
    hidden = strip.source == "photo" and strip.severity >= unreadable
    return _SHARES[strip.source] * (unreadable_share if hidden else 1.0)


def gather(strips: Sequence[TrainingStrip]) -> tuple[Tensor, Tensor]:
    """Stack strips to (n, LAYERS, TALL_ROWS, columns), filled from the left, and (n,) their numbers of columns."""
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
    """Yield strips in random order, in full groups of similar width; a remainder is left out."""
    order, many = rng.permutation(len(strips)), size * 32
    for first in range(0, len(order), many):
        part = sorted(order[first : first + many], key=lambda i: strips[i].layers.shape[2])
        groups = [part[i : i + size] for i in range(0, len(part) - size + 1, size)]
        for k in rng.permutation(len(groups)):
            yield [strips[i] for i in groups[k]]


@dataclass(frozen=True)
class Batch:
    """Strips of one training step, (n, LAYERS, TALL_ROWS, columns) float16, each filled from the left."""

    tall: Tensor
    columns: Tensor
    classes: Tensor
    lengths: Tensor


class Batches(IterableDataset[Batch]):
    """Endless batches; each worker process draws its own."""

    def __init__(self, folders: Sequence[Path], *, size: int, covers: bool, seed: int) -> None:
        self.folders, self.size, self.covers, self.seed = tuple(folders), size, covers, seed

    def __iter__(self) -> Iterator[Batch]:
        worker = get_worker_info()
        seed = self.seed if worker is None else self.seed + 1000 * (worker.id + 1)
        rng, draw = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
        for read in rounds(TrainingStrip, self.folders, rng, files=_FILES):
            chosen = choose_strips(read, rng)
            if len(chosen) < self.size:
                raise ValueError(
                    f"{len(chosen)} strips are fewer than a batch of {self.size}: draw more strips"
                )
            for strips in batches(chosen, self.size, rng):
                strips = vary_surroundings(strips, rng=rng)
                if self.covers:
                    strips = cover_photos(strips, rng=rng)
                tall, columns = gather(strips)
                if self.covers:
                    tall = cover_rivals(tall, [s.text for s in strips], [s.places for s in strips], rng=draw)
                yield Batch(tall.half(), columns, *targets(strips))
