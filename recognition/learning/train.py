"""Train the recogniser or the finder of lines, and write it as ONNX::

    python -m recognition.learning.train recogniser --learn-from FOLDER --held-out FOLDER --minutes 70 \
        --out recogniser.onnx --log LOG

Files that are put into the recogniser's folders while it trains are learned from as well. A line of JSON a report goes
to the log.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import torch

from recognition.learning import train_finder, train_recogniser
from recognition.learning.training_loop import Training, fit


def train(
    network: str, folders: Sequence[Path], held_out: Path, how: Training, *, out: Path, log: Path
) -> None:
    """Train a network on the samples of folders.

    Args:
        network: "recogniser", of strips, or "finder", of views.
        folders: of samples to learn from.
        held_out: folder of samples of fonts held out, to measure on.
        how: for how long, from which seed.
        out: ONNX file, the recogniser's in eight bits; the same in floating point and the weights as torch has them lie
            beside it.
        log: a line of JSON a report is added to it.

    Raises:
        MarksError: the public network to start from is not there.
        ValueError: no samples, or fewer than a batch has.
    """
    torch.manual_seed(how.seed)
    torch.set_flush_denormal(True)
    if network == "finder":
        task = train_finder.task(folders, held_out, how)
        fit(task, how, out=out, log=log)
        train_finder.write(task.network, out)
    else:
        task = train_recogniser.task(folders, held_out, how)
        fit(task, how, out=out, log=log)
        train_recogniser.write(task.network, folders, how, out)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train as the command line says."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("network", choices=["recogniser", "finder"])
    asked.add_argument("--learn-from", type=Path, required=True, nargs="+", help="folders of strips or views")
    asked.add_argument("--held-out", type=Path, required=True, help="folder of those of fonts held out")
    asked.add_argument("--minutes", type=float, required=True)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--rate", type=float, help="of learning, at most")
    asked.add_argument("--batch", type=int, help="samples to a step")
    asked.add_argument("--workers", type=int, default=0, help="processes that make strips ready")
    asked.add_argument("--threads", type=int, default=2)
    asked.add_argument("--start", type=Path, help="weights (.pt) to go on from")
    asked.add_argument("--noise", action="store_true", help="begin from noise, not from public weights")
    asked.add_argument("--no-covers", dest="covers", action="store_false", help="leave deciding strokes open")
    asked.add_argument("--out", type=Path, required=True, help="ONNX file")
    asked.add_argument("--log", type=Path, required=True, help="reports are added to it")
    given = asked.parse_args(arguments)
    torch.set_num_threads(given.threads)
    how = Training(**{f.name: getattr(given, f.name) for f in fields(Training) if hasattr(given, f.name)})
    train(given.network, given.learn_from, given.held_out, how, out=given.out, log=given.log)


if __name__ == "__main__":
    main()
