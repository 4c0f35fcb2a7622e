"""Train the recogniser, and write it as ONNX::

    python -m recognition.learning.train --strips FOLDER --held-out FOLDER --minutes 70 --out recogniser.onnx --log LOG

Strips that are put into the folder while it trains are learned from as well. A line of JSON a report goes to the log.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
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
from recognition.learning.training_strips import TrainingStrip, read_strips
from recognition.views.text_line import ROWS
from recognition.views.view import LAYERS

_LEAST_RATE = 1e-6
_FIRST_SHARE = 0.03
"""Share of the time in which the rate rises; then it falls."""
_AVERAGE_STEPS, _AVERAGE_SHARE = 8, 0.01
"""Steps between two looks of the running average at the weights, and what a look counts."""
_REPORT_STEPS, _MEASURE_S = 50, 1500.0
"""Steps from one report to the next, and seconds after which one holds what is read of the held-out strips."""
_SIZES = (0.003, 0.1)
"""Least and greatest size of weights by which their rate is measured."""
_RANGED = 100
"""Strips that give the ranges of the eight-bit layers."""
_OF_NOTHING = 8
"""Characters as which a strip counts that says nothing."""
_LOSSES = 100
"""Losses of which a report gives the mean."""


@dataclass(frozen=True)
class Training:
    """Settings of a training.

    Attributes:
        minutes: by the clock.
        seed: of weights, batches and what happens to strips.
        batch: strips to a step.
        rate: of learning, at most: how far a step moves a weight, of the usual size of the weights it stands among.
            Folded into its convolutions are normalisations, so their weights differ in size a hundredfold; one rate
            for all, of 1.5e-4, destroyed what the public network knows.
        frozen_share: of the time in which the early layers stay as they were: a step costs a third less then.
        start: weights to go on from.
        noise: begin from noise instead of public weights.
        covers: lay covers over the strokes that tell characters apart.
        workers: processes that make batches ready.
    """

    minutes: float
    seed: int = 0
    batch: int = 16
    rate: float = 1e-3
    frozen_share: float = 0.35
    start: Path | None = None
    noise: bool = False
    covers: bool = True
    workers: int = 0


class Average:
    """The running mean of a network's weights."""

    def __init__(self, network: Recogniser) -> None:
        self.weights = {name: value.clone() for name, value in network.state_dict().items()}

    def add(self, network: Recogniser) -> None:
        """Take in the weights as they are."""
        for name, value in network.state_dict().items():
            counted = value.dtype.is_floating_point
            self.weights[name] = self.weights[name].lerp(value, _AVERAGE_SHARE) if counted else value.clone()


def _size(weights: Tensor) -> float:
    """Root mean square of weights, within bounds."""
    return float(weights.detach().square().mean().sqrt().clamp(*_SIZES))


def _rate(most: float, share: float) -> float:
    """Return the learning rate when this share of the time is gone."""
    if share < _FIRST_SHARE:
        return max(most * share / _FIRST_SHARE, _LEAST_RATE)
    fallen = (share - _FIRST_SHARE) / (1 - _FIRST_SHARE)
    return max(most * 0.5 * (1 + float(np.cos(np.pi * fallen))), _LEAST_RATE)


def _step(
    network: Recogniser, optimiser: torch.optim.Optimizer, batch: Batch, draw: torch.Generator
) -> Tensor:
    """Learn from a batch; its loss."""
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
    loss = (each / torch.where(lengths > 0, lengths, _OF_NOTHING)).mean()
    optimiser.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
    optimiser.step()
    return loss.detach()


class _Reports:
    """Reports of the training, a line of JSON each."""

    def __init__(self, log: Path) -> None:
        self.log = log
        self.begun = self.measured = time.monotonic()

    def minutes(self) -> float:
        return (time.monotonic() - self.begun) / 60.0

    def due(self, steps: int) -> bool:
        return steps % _REPORT_STEPS == 0

    def measuring(self) -> bool:
        """Whether it is time to read the held-out strips."""
        if time.monotonic() - self.measured < _MEASURE_S:
            return False
        self.measured = time.monotonic()
        return True

    def write(self, line: dict[str, Any]) -> None:
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with self.log.open("a") as stream:
            stream.write(json.dumps(line) + "\n")


def train(folders: Sequence[Path], held_out: Path, how: Training, *, out: Path, log: Path) -> None:
    """Train on the strips of folders, and write the better of the last weights and their running mean.

    Args:
        folders: of strips to learn from.
        held_out: folder of strips to measure on.
        how: for how long, from which seed.
        out: ONNX file, in eight bits; the same in floating point and the weights as torch has them lie beside it.
        log: reports are added to it.

    Raises:
        MarksError: the public network to start from is not there.
        ValueError: no strips, or fewer than a batch has.
    """
    torch.manual_seed(how.seed)
    torch.set_flush_denormal(True)
    network = Recogniser(load_start(), CHARACTERS)
    if how.noise:
        _forget(network)
    if how.start is not None:
        network.load_state_dict(torch.load(how.start, weights_only=True))
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = network.to(device, memory_format=torch.channels_last).train()
    held = read_strips(sorted(held_out.glob("*.npz")))
    reports, average = _Reports(log), Average(network)
    done = _learn(network, average, folders, held, how, reports=reports, out=out)
    _keep_better(network, average, held, reports=reports, out=out, strips=done)
    whole = out.with_suffix(".float.onnx")
    export(network, whole)
    seen = next(rounds(folders, np.random.default_rng(how.seed)))
    quantise(whole, out, [plain(strip) for strip in seen[:_RANGED]])


def _forget(network: Recogniser) -> None:
    """Every weight drawn anew: what training is worth without the public start."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            module.reset_parameters()


def _learn(
    network: Recogniser,
    average: Average,
    folders: Sequence[Path],
    held: Sequence[TrainingStrip],
    how: Training,
    *,
    reports: _Reports,
    out: Path,
) -> int:
    """Learn until the time is over; the number of strips learned from."""
    device = next(network.parameters()).device
    draw = torch.Generator(device).manual_seed(how.seed)
    early = [] if how.noise or how.start else network.early()
    optimiser = torch.optim.Adam(
        [{"params": [p], "size": _size(p)} for p in network.parameters()], fused=device.type == "cuda"
    )
    losses: list[Tensor] = []
    for batch in ready_batches(
        folders, size=how.batch, covers=how.covers, seed=how.seed, workers=how.workers
    ):
        share = reports.minutes() / how.minutes
        if share >= 1.0:
            break
        for group in optimiser.param_groups:
            group["lr"] = _rate(how.rate, share) * group["size"]
        for weights in early:
            weights.requires_grad_(share >= how.frozen_share)
        losses.append(_step(network, optimiser, batch, draw))
        if len(losses) % _AVERAGE_STEPS == 0:
            average.add(network)
        if reports.due(len(losses)):
            _report(network, average, held, how.batch * len(losses), losses, reports=reports, out=out)
    return how.batch * len(losses)


def _report(
    network: Recogniser,
    average: Average,
    held: Sequence[TrainingStrip],
    done: int,
    losses: Sequence[Tensor],
    *,
    reports: _Reports,
    out: Path,
) -> None:
    """Write how far it is; now and then what is read of held-out fonts, and keep the running mean."""
    line: dict[str, Any] = {
        "minutes": round(reports.minutes(), 1),
        "strips": done,
        "loss": round(float(torch.stack(list(losses[-_LOSSES:])).mean()), 4),
    }
    if reports.measuring():
        line["held out"] = shares(measure(network, held), 1)
        out.parent.mkdir(parents=True, exist_ok=True)
        torch.save(average.weights, out.with_suffix(".pt"))
    reports.write(line)


def _keep_better(
    network: Recogniser,
    average: Average,
    held: Sequence[TrainingStrip],
    *,
    reports: _Reports,
    out: Path,
    strips: int,
) -> None:
    """Give the network the running mean of its weights, if that reads held-out fonts better, and save them."""
    last = measure(network, held)
    own = {name: value.clone() for name, value in network.state_dict().items()}
    network.load_state_dict(average.weights)
    smooth = measure(network, held)
    if last["all"][1] <= smooth["all"][1]:
        network.load_state_dict(own)
    out.parent.mkdir(parents=True, exist_ok=True)
    torch.save(network.state_dict(), out.with_suffix(".pt"))
    for name, result in (("last", last), ("average", smooth)):
        reports.write({name: shares(result, 2), "strips": strips})


def export(network: Recogniser, out: Path) -> None:
    """Write ONNX for any number of strips of any length."""
    network.eval().to("cpu", memory_format=torch.contiguous_format)
    strip = torch.zeros(1, LAYERS, ROWS, 8 * COLUMNS)
    torch.onnx.export(
        network, (strip,), str(out), input_names=["strip"], output_names=["posteriors"],
        dynamic_axes={"strip": {0: "n", 3: "columns"}, "posteriors": {0: "n", 1: "steps"}}, dynamo=False,
    )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Train as the command line says."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument(
        "--strips", type=Path, required=True, nargs="+", help="folders of files of strips to learn from"
    )
    asked.add_argument("--held-out", type=Path, required=True, help="folder of those of fonts held out")
    asked.add_argument("--minutes", type=float, default=70.0)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--rate", type=float, default=Training.rate, help="of learning, at most")
    asked.add_argument("--batch", type=int, default=Training.batch, help="strips to a step")
    asked.add_argument("--workers", type=int, default=0, help="processes that make batches ready")
    asked.add_argument("--threads", type=int, default=2)
    asked.add_argument("--start", type=Path, help="weights (.pt) to go on from")
    asked.add_argument("--noise", action="store_true", help="begin from noise, not from public weights")
    asked.add_argument("--no-covers", action="store_true", help="lay no covers over deciding strokes")
    asked.add_argument("--out", type=Path, required=True, help="ONNX file")
    asked.add_argument("--log", type=Path, required=True, help="reports are added to it")
    given = asked.parse_args(arguments)
    torch.set_num_threads(given.threads)
    how = Training(
        minutes=given.minutes,
        seed=given.seed,
        rate=given.rate,
        start=given.start,
        noise=given.noise,
        covers=not given.no_covers,
        batch=given.batch,
        workers=given.workers,
    )
    train(given.strips, given.held_out, how, out=given.out, log=given.log)


if __name__ == "__main__":
    main()
