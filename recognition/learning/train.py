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
from torch import Tensor
from torch.nn import functional as f

from recognition.experts.recogniser import CHARACTERS
from recognition.learning.augment import augmented
from recognition.learning.network import Recogniser
from recognition.learning.train_batches import Strips, batches, drawn_again, gathered, is_easy, targets
from recognition.learning.train_measure import measured, shares
from recognition.learning.training_strips import WIDE_MARGIN, TrainingStrip, read_strips
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, ROWS
from recognition.views.view import LAYERS

_LEAST_RATE = 1e-6
_FIRST_SHARE = 0.02
"""Of the time, in which the rate rises; then it falls."""
_AVERAGE_STEPS, _AVERAGE_SHARE = 8, 0.01
"""Steps between two looks of the running average at the weights, and what a look counts."""
_OFTEN_UNTIL, _OFTEN_STEPS, _SELDOM_S = 40_000, 20, 1500.0
"""Strips until which a report is made every so many steps; later one after so many seconds, with the held-out parts."""
_LOSSES = 100
"""Of which a report gives the mean."""


@dataclass(frozen=True)
class Training:
    """How to train.

    Attributes:
        minutes: by the clock.
        seed: of weights, batches and what happens to strips.
        width: of the network.
        batch: strips to a step.
        rate: of learning, at most.
        easy_share: of the time, spent on what a beginner can read, cut plainly: without it the network finds no
            alignment at all for long.
        start: weights to go on from; then there is no easy time.
    """

    minutes: float
    seed: int = 0
    width: int = 48
    batch: int = 32
    rate: float = 1.5e-3
    easy_share: float = 0.08
    start: Path | None = None


class Average:
    """The running mean of a network's weights."""

    def __init__(self, network: Recogniser) -> None:
        self.weights = {name: value.clone() for name, value in network.state_dict().items()}

    def add(self, network: Recogniser) -> None:
        """Take in the weights as they are."""
        for name, value in network.state_dict().items():
            counted = value.dtype.is_floating_point
            self.weights[name] = self.weights[name].lerp(value, _AVERAGE_SHARE) if counted else value.clone()


def _about_right(beliefs: Tensor, strips: Sequence[TrainingStrip]) -> Tensor:
    """Loss of plain strips whose characters stood evenly, which is about right: it shows a beginner where to look."""
    rows, steps, codes = [], [], []
    for row, strip in enumerate(strips):
        length = strip.layers.shape[2] - 2 * WIDE_MARGIN * HEIGHT_ROWS
        for k, char in enumerate(strip.text):
            at = (MARGIN * HEIGHT_ROWS + (k + 0.5) / len(strip.text) * length) / 2
            if at < beliefs.shape[1]:
                rows.append(row)
                steps.append(int(at))
                codes.append(CHARACTERS.index(char) + 1)
    return f.nll_loss(beliefs[rows, steps], torch.tensor(codes))


def _rate(most: float, share: float) -> float:
    """Of learning, when this share of the time is gone."""
    if share < _FIRST_SHARE:
        return max(most * share / _FIRST_SHARE, _LEAST_RATE)
    fallen = (share - _FIRST_SHARE) / (1 - _FIRST_SHARE)
    return max(most * 0.5 * (1 + float(np.cos(np.pi * fallen))), _LEAST_RATE)


def _step(
    network: Recogniser,
    optimiser: torch.optim.Optimizer,
    batch: Sequence[TrainingStrip],
    *,
    draw: torch.Generator,
    easy: bool,
) -> float:
    """Learn from a batch; its loss."""
    with torch.no_grad():
        drawn = network.drawn(augmented(*gathered(batch), rng=draw, easy=easy))
        drawn = drawn.to(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16):
        beliefs = network.read(drawn)
    classes, lengths = targets(batch)
    steps = torch.full((len(batch),), beliefs.shape[1])
    loss = f.ctc_loss(beliefs.permute(1, 0, 2), classes, steps, lengths, zero_infinity=True)
    if easy:
        loss = loss + _about_right(beliefs, batch)
    optimiser.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
    optimiser.step()
    return float(loss.item())


class _Reports:
    """What becomes of the training, a line of JSON at a time."""

    def __init__(self, log: Path) -> None:
        self.log = log
        self.begun = self.last = time.monotonic()

    def minutes(self) -> float:
        return (time.monotonic() - self.begun) / 60.0

    def due(self, done: int, steps: int) -> bool:
        often = done < _OFTEN_UNTIL and steps % _OFTEN_STEPS == 0
        return often or time.monotonic() - self.last > _SELDOM_S

    def write(self, line: dict[str, Any]) -> None:
        self.last = time.monotonic()
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with self.log.open("a") as stream:
            stream.write(json.dumps(line) + "\n")


def train(folder: Path, held_out: Path, how: Training, *, out: Path, log: Path) -> None:
    """Train on the strips of a folder, and write the better of the last weights and their running mean.

    Args:
        folder: of strips to learn from.
        held_out: of strips to measure on.
        how: for how long, from which seed.
        out: ONNX file; the weights as torch has them lie beside it.
        log: reports are added to it.

    Raises:
        ValueError: fewer strips than a batch has.
    """
    torch.manual_seed(how.seed)
    torch.set_flush_denormal(True)
    network = Recogniser(1 + len(CHARACTERS), width=how.width).to(memory_format=torch.channels_last)
    if how.start is not None:
        network.load_state_dict(torch.load(how.start, weights_only=True))
    held = read_strips(sorted(held_out.glob("*.npz")))
    reports, average = _Reports(log), Average(network)
    done = _learned(network, average, Strips(folder), held, how, reports=reports, out=out)
    _keep_better(network, average, held, reports=reports, out=out, strips=done)
    export(network, out)


def _learned(
    network: Recogniser,
    average: Average,
    strips: Strips,
    held: Sequence[TrainingStrip],
    how: Training,
    *,
    reports: _Reports,
    out: Path,
) -> int:
    """Learn until the time is over; the number of strips learned from."""
    rng, draw = np.random.default_rng(how.seed), torch.Generator().manual_seed(how.seed)
    optimiser = torch.optim.AdamW(network.parameters(), lr=how.rate, weight_decay=0.02)
    losses: list[float] = []
    while reports.minutes() < how.minutes:
        every = strips.read()
        easy = how.start is None and reports.minutes() < how.minutes * how.easy_share
        chosen = [s for s in every if is_easy(s)] if easy else drawn_again(every, rng)
        if len(chosen) < how.batch:
            raise ValueError(f"{len(chosen)} strips are fewer than a batch of {how.batch}: draw more of them")
        for batch in batches(chosen, how.batch, rng):
            share = reports.minutes() / how.minutes
            if share >= (how.easy_share if easy else 1.0):
                break
            for group in optimiser.param_groups:
                group["lr"] = _rate(how.rate, share)
            losses.append(_step(network, optimiser, batch, draw=draw, easy=easy))
            if len(losses) % _AVERAGE_STEPS == 0:
                average.add(network)
            if reports.due(how.batch * len(losses), len(losses)):
                _report(network, held, how.batch * len(losses), len(every), losses, reports=reports, out=out)
    return how.batch * len(losses)


def _report(
    network: Recogniser,
    held: Sequence[TrainingStrip],
    done: int,
    of: int,
    losses: Sequence[float],
    *,
    reports: _Reports,
    out: Path,
) -> None:
    """Write how far it is; once much was learned, what is read of held-out fonts, and keep the weights."""
    line: dict[str, Any] = {
        "minutes": round(reports.minutes(), 1),
        "strips": done,
        "of": of,
        "loss": round(float(np.mean(losses[-_LOSSES:])), 4),
    }
    if done > _OFTEN_UNTIL:
        line["held out"] = shares(measured(network, held), 1)
        torch.save(network.state_dict(), out.with_suffix(".pt"))
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
    last = measured(network, held)
    own = {name: value.clone() for name, value in network.state_dict().items()}
    network.load_state_dict(average.weights)
    smooth = measured(network, held)
    if last["all"][1] <= smooth["all"][1]:
        network.load_state_dict(own)
    out.parent.mkdir(parents=True, exist_ok=True)
    torch.save(network.state_dict(), out.with_suffix(".pt"))
    for name, result in (("last", last), ("average", smooth)):
        reports.write({name: shares(result, 2), "strips": strips})


def export(network: Recogniser, out: Path) -> None:
    """Write ONNX for any number of strips of any length."""
    network.eval().to(memory_format=torch.contiguous_format)
    torch.onnx.export(
        network, (torch.zeros(1, LAYERS, ROWS, 160),), str(out), input_names=["strip"], output_names=["beliefs"],
        dynamic_axes={"strip": {0: "n", 3: "columns"}, "beliefs": {0: "n", 1: "steps"}}, dynamo=False,
    )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Train as the command line says."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--strips", type=Path, required=True, help="folder of files of strips to learn from")
    asked.add_argument("--held-out", type=Path, required=True, help="folder of those of fonts held out")
    asked.add_argument("--minutes", type=float, default=70.0)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--width", type=int, default=48, help="of the network")
    asked.add_argument("--threads", type=int, default=2)
    asked.add_argument("--start", type=Path, help="weights (.pt) to go on from")
    asked.add_argument("--out", type=Path, required=True, help="ONNX file")
    asked.add_argument("--log", type=Path, required=True, help="reports are added to it")
    given = asked.parse_args(arguments)
    torch.set_num_threads(given.threads)
    how = Training(minutes=given.minutes, seed=given.seed, width=given.width, start=given.start)
    train(given.strips, given.held_out, how, out=given.out, log=given.log)


if __name__ == "__main__":
    main()
