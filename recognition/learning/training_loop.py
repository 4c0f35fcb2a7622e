"""Train a network for a set time, with reports, and keep the better of its last weights and their running mean."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.lr_scheduler import LambdaLR
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader, IterableDataset

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


@dataclass(frozen=True)
class Training:
    """Settings of a training run.

    Attributes:
        minutes: minutes of wall-clock time.
        seed: seed of weights, batches and augmentation.
        batch: samples per step (default: the network's own).
        rate: peak of the learning rate (default: the network's own).
        frozen_share: share of the time, at its start, in which early layers are frozen; a step then takes two thirds
            of the time.
        start: file of weights to start from.
        noise: whether to start the recogniser from random instead of public weights.
        covers: whether to cover strokes that distinguish characters.
        workers: processes that prepare batches.
        times: number of times that a batch is used, augmented anew each time.
    """

    minutes: float
    seed: int = 0
    batch: int | None = None
    rate: float | None = None
    frozen_share: float = 0.35
    start: Path | None = None
    noise: bool = False
    covers: bool = True
    workers: int = 0
    times: int = 1


@dataclass(frozen=True, eq=False)
class Task:
    """A network and its training data.

    Attributes:
        network: network to be trained.
        optimiser: optimiser of its weights; the learning rate of each group is its peak.
        batches: endless batches to learn from.
        loss: loss of a batch; the generator, on the network's device, is the only source of randomness.
        measure: returns a figure on held-out samples (lower is better), and the result in words.
        write: writes the network to an ONNX file.
        early: weights that are frozen at first (`Training.frozen_share`).
    """

    network: nn.Module
    optimiser: torch.optim.Optimizer
    batches: Iterable[Any]
    loss: Callable[[Any, torch.Generator], Tensor]
    measure: Callable[[Any], tuple[float, dict[str, Any]]]
    write: Callable[[Path], None]
    early: Sequence[nn.Parameter] = ()


def load_batches(batches: IterableDataset[Any], how: Training) -> Iterator[Any]:
    """Load batches that worker processes prepare, each `how.times` times."""
    ahead = 4 if how.workers else None
    for batch in DataLoader(batches, batch_size=None, num_workers=how.workers, prefetch_factor=ahead):
        yield from repeat(batch, how.times)


def fit(
    task: Task,
    how: Training,
    *,
    out: Path,
    log: Path,
    average_steps: int = 8,
    average_share: float = 0.01,
    report_steps: int = 50,
    measure_s: float = 1500.0,
) -> None:
    """Train until the time is over, and write the better of the last weights and their running mean.

    Args:
        task: task of the network.
        how: settings.
        out: ONNX file; the torch weights are written beside it.
        log: file to which each report adds a line of JSON.
        average_steps, average_share: steps between two updates of the running mean, and the weight of an update.
        report_steps, measure_s: steps between two reports, and seconds between two reports with a measurement.
    """
    network, weights_at = task.network, out.with_suffix(".pt")
    for path in (out, log):
        path.parent.mkdir(parents=True, exist_ok=True)
    draw = torch.Generator(next(network.parameters()).device).manual_seed(how.seed)
    average = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(1.0 - average_share))
    begun = measured = time.monotonic()
    share = 0.0
    rates = LambdaLR(task.optimiser, lambda _: _rate(share))
    losses: list[Tensor] = []
    for batch in task.batches:
        share = (time.monotonic() - begun) / (60.0 * how.minutes)
        if share >= 1.0:
            break
        for weights in task.early:
            weights.requires_grad_(share >= how.frozen_share)
        loss = task.loss(batch, draw)
        task.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 2.0)
        task.optimiser.step()
        rates.step()
        losses.append(loss.detach())
        if len(losses) % average_steps == 0:
            average.update_parameters(network)
        if len(losses) % report_steps == 0:
            mean = float(torch.stack(losses[-2 * report_steps :]).mean())
            line: dict[str, Any] = {
                "minutes": round(share * how.minutes, 1),
                "steps": len(losses),
                "loss": round(mean, 4),
            }
            if time.monotonic() - measured > measure_s:
                measured = time.monotonic()
                line["held out"] = task.measure(network)[1]
                torch.save(average.module.state_dict(), weights_at)
            _report(log, line)
    (last, last_words), (smooth, smooth_words) = task.measure(network), task.measure(average.module)
    if smooth < last:
        network.load_state_dict(average.module.state_dict())
    torch.save(network.state_dict(), weights_at)
    _report(log, {"last": last_words, "steps": len(losses)})
    _report(log, {"average": smooth_words, "steps": len(losses)})
    task.write(out)


def _rate(share: float, *, first: float = 0.03) -> float:
    """Learning rate after a share of the time, as a share of its peak: linear warm-up, then a cosine decay."""
    return (
        share / first if share < first else 0.5 * (1.0 + math.cos(math.pi * (share - first) / (1.0 - first)))
    )


def _report(log: Path, line: dict[str, Any]) -> None:
    with log.open("a") as stream:
        stream.write(json.dumps(line) + "\n")


def export(
    network: nn.Module, example: Tensor, out: Path, *, names: tuple[str, str], axes: Sequence[dict[int, str]]
) -> None:
    """Write a network to an ONNX file.

    Args:
        network: network to be written.
        example: example of its input.
        out: file.
        names: names of input and output.
        axes: for input and output, the axes of variable length.
    """
    network.eval().to("cpu", memory_format=torch.contiguous_format)
    torch.onnx.export(
        network, (example,), str(out), input_names=[names[0]], output_names=[names[1]],
        dynamic_axes=dict(zip(names, axes, strict=True)), dynamo=False,
    )  # fmt: skip
