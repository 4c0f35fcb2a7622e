"""Train the recogniser or the finder of lines, and write it as ONNX::

    python -m recognition.learning.train recogniser --learn-from FOLDER --held-out FOLDER --minutes 70 \
        --out recogniser.onnx --log LOG

Files that are put into the recogniser's folders while it trains are learned from as well. A line of JSON a report goes
to the log.
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

    Args:
        network: the recogniser, of strips, or the finder, of views.
        learn_from: folders of samples to learn from.
        held_out: folder of samples of fonts held out, to measure on.
        how: for how long, from which seed.
        out: ONNX file, the recogniser's in eight bits; the same in floating point and the weights as torch has them lie
            beside it.
        log: a line of JSON a report is added to it.
        threads: threads of the processor.

    Raises:
        MarksError: the public network to start from is not there.
        ValueError: no samples, or fewer than a batch has.
    """
    torch.set_num_threads(threads)
    torch.manual_seed(how.seed)
    torch.set_flush_denormal(True)
    room = {"finder": train_finder, "recogniser": train_recogniser}[network]
    fit(room.task(learn_from, held_out, how), how, out=out, log=log)


if __name__ == "__main__":
    run(train)
