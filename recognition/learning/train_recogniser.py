"""The recogniser's training: strips of known text, by connectionist temporal classification."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as f

from recognition.experts.recogniser import CHARACTERS
from recognition.learning.augment import augment
from recognition.learning.network import COLUMNS, Recogniser
from recognition.learning.public_start import load_start
from recognition.learning.quantise import quantise
from recognition.learning.train_batches import Batch, ready_batches, rounds
from recognition.learning.train_measure import measure, plain, shares
from recognition.learning.training_loop import Task, Training, export
from recognition.learning.training_samples import TrainingStrip, read_samples
from recognition.views.text_line import ROWS
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
    if how.noise:
        _forget(network)
    if how.start is not None:
        network.load_state_dict(torch.load(how.start, weights_only=True))
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = network.to(device, memory_format=torch.channels_last).train()
    rate = 1e-3 if how.rate is None else how.rate
    optimiser = torch.optim.Adam(
        [{"params": [p], "lr": rate * _size(p)} for p in network.parameters()], fused=device == "cuda"
    )
    held = read_samples(TrainingStrip, sorted(held_out.glob("*.npz")))

    def judge(one: Recogniser) -> tuple[float, dict[str, Any]]:
        found = measure(one, held)
        return found["all"][1], shares(found, 2)

    return Task(
        network,
        optimiser,
        ready_batches(folders, size=how.batch or 16, covers=how.covers, seed=how.seed, workers=how.workers),
        lambda batch, draw: _loss(network, batch, draw),
        judge,
        early=() if how.noise or how.start else network.early(),
    )


def write(
    network: nn.Module, folders: Sequence[Path], how: Training, out: Path, *, ranged: int = 100
) -> None:
    """Write ONNX for any number of strips of any length, in floating point and in eight bits.

    Args:
        network: a recogniser.
        folders: of strips, of which so many `ranged` ones give the ranges of the eight-bit layers.
        how: it was trained.
        out: file in eight bits.
    """
    whole = out.with_suffix(".float.onnx")
    strip = torch.zeros(1, LAYERS, ROWS, 8 * COLUMNS)
    axes = ({0: "n", 3: "columns"}, {0: "n", 1: "steps"})
    export(network, strip, whole, names=("strip", "posteriors"), axes=axes)
    seen = next(rounds(folders, np.random.default_rng(how.seed)))
    quantise(whole, out, [plain(one) for one in seen[:ranged]])


def _size(weights: Tensor) -> float:
    """Root mean square of weights, within bounds."""
    return float(weights.detach().square().mean().sqrt().clamp(*_SIZES))


def _forget(network: Recogniser) -> None:
    """Draw every weight anew: what training is worth without the public start."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            module.reset_parameters()


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
