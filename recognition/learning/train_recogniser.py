"""The recogniser's training: strips of known text, by connectionist temporal classification.

Its accuracy is that of the best class of every step, without any format.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rapidfuzz.distance import Levenshtein
from torch import Tensor, nn
from torch.nn import functional as f
from torch.utils.data import DataLoader

from recognition.experts.recogniser import CHARACTERS
from recognition.learning.augment import augment
from recognition.learning.network import COLUMNS, Recogniser
from recognition.learning.public_start import load_start
from recognition.learning.quantise import quantise
from recognition.learning.train_batches import Batch, Batches, rounds
from recognition.learning.training_loop import Task, Training, export
from recognition.learning.training_samples import (
    TALL_ROWS,
    WIDE_MARGIN,
    TrainingStrip,
    files_in,
    read_samples,
)
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, ROWS
from recognition.views.view import LAYERS

_SIZES = (0.003, 0.1)
"""Least and greatest size of weights by which their rate is measured."""


def task(folders: Sequence[Path], held_out: Path, how: Training) -> Task:
    """The recogniser and what it learns.

    A rate says how far a step moves a weight, of the usual size of the weights it stands among (default: 1e-3). Folded
    into its convolutions are normalisations, so their weights differ in size a hundredfold; one rate for all, of
    1.5e-4, destroyed what the public network knows.

    Args:
        folders: of strips to learn from.
        held_out: folder of strips to measure on.
        how: as asked.

    Raises:
        MarksError: the public network to start from is not there.
    """
    network = Recogniser(load_start(), CHARACTERS)
    if how.noise:  # what training is worth without the public start
        for module in network.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                module.reset_parameters()
    if how.start is not None:
        network.load_state_dict(torch.load(how.start, weights_only=True))
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = network.to(device, memory_format=torch.channels_last).train()
    rate = how.rate or 1e-3
    optimiser = torch.optim.Adam(
        [{"params": [p], "lr": rate * _size(p)} for p in network.parameters()], fused=device == "cuda"
    )
    held = read_samples(TrainingStrip, files_in([held_out]))

    def judge(one: Recogniser) -> tuple[float, dict[str, Any]]:
        found = measure(one, held)
        words = {key: f"{100 * (1 - wrong / n):.2f} % of {n}" for key, (n, wrong, _) in found.items()}
        return found["all"][1], words

    def write(out: Path) -> None:
        """Write ONNX for any number of strips of any length, in floating point and in eight bits."""
        whole = out.with_suffix(".float.onnx")
        strip = torch.zeros(1, LAYERS, ROWS, 8 * COLUMNS)
        axes = ({0: "n", 3: "columns"}, {0: "n", 1: "steps"})
        export(network, strip, whole, names=("strip", "posteriors"), axes=axes)
        # a hundred strips give the ranges of the eight-bit layers
        seen = next(rounds(folders, np.random.default_rng(how.seed)))
        quantise(whole, out, [plain(one) for one in seen[:100]])

    made = Batches(folders, size=how.batch or 16, covers=how.covers, seed=how.seed)
    ahead = 4 if how.workers else None
    return Task(
        network,
        optimiser,
        DataLoader(made, batch_size=None, num_workers=how.workers, prefetch_factor=ahead),
        lambda batch, draw: _loss(network, batch, draw),
        judge,
        write,
        early=() if how.noise or how.start else network.early(),
    )


def _size(weights: Tensor) -> float:
    """Root mean square of weights, within bounds."""
    return float(weights.detach().square().mean().sqrt().clamp(*_SIZES))


def _loss(network: Recogniser, batch: Batch, draw: torch.Generator, *, of_nothing: int = 8) -> Tensor:
    """Return the loss a character; a strip that says nothing counts as so many."""
    device = draw.device
    with torch.no_grad(), device:
        tall, columns = batch.tall.to(device).float(), batch.columns.to(device)
        drawn = network.drawn(augment(tall, columns, rng=draw)).to(memory_format=torch.channels_last)
    with torch.autocast(device.type, torch.bfloat16):
        posteriors = network.read(drawn)
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
    return (each / torch.where(lengths > 0, lengths, of_nothing)).mean()


def plain(strip: TrainingStrip) -> NDArray[np.float32]:
    """A strip as it is cut for reading, (LAYERS, ROWS, columns)."""
    tall = strip.layers.astype(np.float32)
    up = (TALL_ROWS - ROWS) // 2
    cut = round((WIDE_MARGIN - MARGIN) * HEIGHT_ROWS)
    tall = tall[:, up : up + ROWS, cut : tall.shape[2] - cut]
    return np.pad(tall, ((0, 0), (0, 0), (0, -tall.shape[2] % COLUMNS)))


def decode(beliefs: NDArray[np.float32]) -> str:
    """The best class of every step, (steps, classes), repeats and blanks left out."""
    best = beliefs.argmax(axis=1)
    kept = [k for k, before in zip(best, [0, *best[:-1]], strict=True) if k and k != before]
    return "".join(CHARACTERS[k - 1] for k in kept).strip()


@torch.no_grad()
def measure(network: Recogniser, strips: Sequence[TrainingStrip]) -> dict[str, tuple[int, int, int]]:
    """Characters, mistakes and lines by source and severity; spaces do not count."""
    network.eval()
    found: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0])
    for strip in strips:
        fed = torch.from_numpy(plain(strip))[None].to(network.drawn.bell.device)
        said = decode(network(fed)[0].cpu().numpy()).replace(" ", "")
        text = strip.text.replace(" ", "")
        level = min(0.9, 0.3 * round(strip.severity / 0.3 + 0.001))
        dirt = "clean" if strip.severity == 0 else f"{level:.1f}"
        counted = (len(text), Levenshtein.distance(text, said), 1)
        for key in (f"{strip.source} {dirt}", strip.source, "all"):
            found[key] = [a + b for a, b in zip(found[key], counted, strict=True)]
    network.train()
    return {key: (n, wrong, lines) for key, (n, wrong, lines) in sorted(found.items())}
