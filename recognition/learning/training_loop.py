"""Train a network on a set number of samples, resumably; keep the better of last weights and running mean."""

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

from glyphs.atomic import replacing

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


@dataclass(frozen=True)
class Training:
    """Settings of a training run.

    Attributes:
        samples: number of samples to learn from; the learning rate falls to zero over it.
        seed: seed of weights, batches and augmentation.
        rate: peak of the learning rate (default: the network's own).
        frozen_share: share of the samples, at the start, for which early layers are frozen; a step then takes two
            thirds of the time (default: 0.35 from public weights, none from a start of one's own).
        noise: whether to start the recogniser from random instead of public weights.
        workers: processes that prepare batches.
        times: number of times that a batch is used, augmented anew each time.
    """

    samples: int
    seed: int = 0
    batch: int = 16
    rate: float | None = None
    frozen_share: float | None = None
    start: Path | None = None
    noise: bool = False
    covers: bool = True
    workers: int = 0
    times: int = 1


@dataclass(frozen=True, eq=False)
class Task:
    """A network and its training data; of the figure that `measure` returns, lower is better."""

    network: nn.Module
    optimiser: torch.optim.Optimizer
    batches: Callable[[int], Iterable[Any]]
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
    out: Path,  # ONNX file; the torch weights are written beside it, and until the end the state of the run
    log: Path,
    average_steps: int = 8,
    average_share: float = 0.01,
    report_steps: int = 50,
    save_s: float = 300.0,
    measure_s: float = 1500.0,
) -> None:
    """Train on all samples, and write the better of the last weights and their running mean."""
    network, weights_at, state_at = task.network, out.with_suffix(".pt"), out.with_suffix(".state.pt")
    for path in (out, log):
        path.parent.mkdir(parents=True, exist_ok=True)
    draw = torch.Generator(next(network.parameters()).device)
    average = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(1.0 - average_share))
    step, losses = 0, list[Tensor]()
    if state_at.exists():
        step = _restore(state_at, task, average)
        _report(log, {"resumed at": step * how.batch})
    else:
        _report(log, {"start": task.measure(network)[1]})
    draw.manual_seed(how.seed + step)
    frozen_share = (0.0 if how.start else 0.35) if how.frozen_share is None else how.frozen_share
    share = max(step - 1, 0) * how.batch / how.samples
    rates = LambdaLR(task.optimiser, lambda _: _rate(share))
    saved = measured = time.monotonic()
    for batch in task.batches(step):
        share = step * how.batch / how.samples
        if share >= 1.0:
            break
        for weights in task.early:
            weights.requires_grad_(share >= frozen_share)
        loss = task.loss(batch, draw)
        task.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 2.0)
        task.optimiser.step()
        rates.step()
        step += 1
        losses = [*losses[1 - 2 * report_steps :], loss.detach()]
        if step % average_steps == 0:
            average.update_parameters(network)
        if time.monotonic() - saved > save_s:
            saved = time.monotonic()
            _save(state_at, task, average, step)
        if step % report_steps == 0:
            line: dict[str, Any] = {
                "samples": step * how.batch,
                "loss": round(float(torch.stack(losses).mean()), 4),
            }
            if time.monotonic() - measured > measure_s:
                measured = time.monotonic()
                line["held out"] = task.measure(average.module)[1]
                torch.save(average.module.state_dict(), weights_at)
            _report(log, line)
    (last, last_words), (smooth, smooth_words) = task.measure(network), task.measure(average.module)
    if smooth < last:
        network.load_state_dict(average.module.state_dict())
    torch.save(network.state_dict(), weights_at)
    _report(log, {"last": last_words, "samples": step * how.batch})
    _report(log, {"average": smooth_words, "samples": step * how.batch})
    task.write(out)
    state_at.unlink(missing_ok=True)


def _save(path: Path, task: Task, average: AveragedModel, step: int) -> None:
    state = {
        "network": task.network.state_dict(), "average": average.state_dict(),
        "optimiser": task.optimiser.state_dict(), "step": step,
    }  # fmt: skip
    with replacing(path) as file:
        torch.save(state, file)


def _restore(path: Path, task: Task, average: AveragedModel) -> int:
    state = torch.load(path, weights_only=True, map_location=DEVICE)
    task.network.load_state_dict(state["network"])
    average.load_state_dict(state["average"])
    task.optimiser.load_state_dict(state["optimiser"])
    return int(state["step"])


def _rate(share: float, *, first: float = 0.03) -> float:
    return (
        share / first if share < first else 0.5 * (1.0 + math.cos(math.pi * (share - first) / (1.0 - first)))
    )


def _report(log: Path, line: dict[str, Any]) -> None:
    with log.open("a") as stream:
        stream.write(json.dumps(line) + "\n")


def export(
    network: nn.Module, example: Tensor, out: Path, *, names: tuple[str, str], axes: Sequence[dict[int, str]]
) -> None:
    """Write a network to an ONNX file, by an example of its input; `axes` of input and output vary in length."""
    network.eval().to("cpu", memory_format=torch.contiguous_format)
    torch.onnx.export(
        network, (example,), str(out), input_names=[names[0]], output_names=[names[1]],
        dynamic_axes=dict(zip(names, axes, strict=True)), dynamo=False,
    )  # fmt: skip
