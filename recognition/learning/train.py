"""Train the recogniser or the finder of lines, and write it as ONNX::

    python -m recognition.learning.train recogniser --learn-from FOLDER --held-out FOLDER \
        --samples 150000 --out recogniser.onnx --log LOG

Files that are added to the folders meanwhile are learned from as well. The command, repeated, resumes a stopped run.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import torch
from cyclopts import Parameter, run

from recognition.learning import train_finder, train_recogniser
from recognition.learning.training_loop import Training, fit


def train(
    network: Literal["recogniser", "finder"],
    *,
    learn_from: Annotated[list[Path], Parameter(consume_multiple=True)],
    held_out: Path,
    how: Annotated[Training, Parameter(name="*")],
    out: Path,
    log: Path,
    threads: int = 2,
) -> None:
    """Train a network on the samples of folders.

    Raises MarksError: the public network to start from is not installed; ValueError: there are no samples, or fewer
    than a batch needs.

    Args:
        network: the recogniser, which learns from strips, or the finder, which learns from views.
        learn_from: folders of samples to learn from.
        held_out: folder of samples of held-out fonts, to measure on.
        how: settings of the run.
        out: ONNX file to write, in eight bits for the recogniser. The torch weights, and the recogniser in floating
            point, are written beside it.
        log: file to which each report adds a line of JSON.
        threads: number of processor threads.
    """
    torch.set_num_threads(threads)
    torch.manual_seed(how.seed)
    torch.set_flush_denormal(True)
    module = {"finder": train_finder, "recogniser": train_recogniser}[network]
    fit(module.task(learn_from, held_out, how), how, out=out, log=log)


if __name__ == "__main__":
    run(train)
