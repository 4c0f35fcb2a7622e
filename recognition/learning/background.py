"""Draw and train in the background at the lowest priority, for days; stop it at any time and start it again::

    python -m recognition.learning.background FONTS ... --state FOLDER --start start.pt --samples 1400000

    draw_data --> FOLDER/data/strips --> train --> FOLDER/recogniser.onnx, .pt, log

Started again, it draws nothing twice, and training goes on from its last saved state.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from cyclopts import run

from glyphs.errors import MarksError
from glyphs.file_lock import exclusively

_ENOUGH_FILES = 14
"""Files of strips with which training begins: fewer are read in one round."""


def step_back() -> None:
    """Give this process, and those it starts, the lowest priority that the system has."""
    os.nice(19)
    if hasattr(os, "SCHED_IDLE"):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def work(
    fonts: list[Path],
    /,
    *,
    state: Path,
    samples: int,
    start: Path | None = None,
    parts: int = 9000,
    sketches: int = 30000,
    held_out: int = 200,
    rate: float = 5e-4,
    batch: int = 32,
    seed: int = 70,
) -> None:
    """Draw and train until all is done, or a signal comes.

    Raises MarksError: another copy works in the folder, or one of the two processes failed; its log is named.

    Args:
        fonts: folders of TrueType or OpenType files.
        state: folder for everything that is made.
        samples: strips to learn from, each drawn strip several times.
        start: torch weights to start from (default: the public network).
        parts: number of parts with fonts to learn from.
        sketches: number of lines without physics.
        held_out: number of parts with fonts that are never learned from.
        rate: peak of the learning rate.
        batch: strips per step.
        seed: seed of the parts and of the training.
    """
    strips = state / "data" / "strips"
    draw = [*map(str, fonts), "--out", state / "data", "--parts", parts, "--sketches", sketches]
    draw += ["--held-out", held_out, "--seed", seed]
    train = [
        "recogniser",
        "--learn-from",
        strips / "seen",
        strips / "sketched",
        "--held-out",
        strips / "held",
    ]
    train += ["--samples", samples, "--rate", rate, "--batch", batch, "--seed", seed, "--threads", 1]
    train += ["--out", state / "recogniser.onnx", "--log", state / "training.log"]
    train += [] if start is None else ["--start", start]
    state.mkdir(parents=True, exist_ok=True)
    with exclusively(state / "lock", wait=False) as alone, contextlib.ExitStack() as running:
        if not alone:
            raise MarksError(f"{state} is in use", hint="another copy draws and trains there")
        step_back()
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
        drawing = _begin("draw_data", draw, state, running)
        while (
            _files(strips / "seen") + _files(strips / "sketched") < _ENOUGH_FILES and drawing.poll() is None
        ):
            time.sleep(5.0)
        training = _begin("train", train, state, running)
        for process, name in ((training, "train"), (drawing, "draw_data")):
            if process.wait():
                raise MarksError(f"{name} has failed", hint=f"see {state / name}.log")


def _files(folder: Path) -> int:
    return sum(1 for _ in folder.glob("[!.]*.npz"))


def _begin(
    module: str, arguments: list[object], state: Path, running: contextlib.ExitStack
) -> subprocess.Popen[bytes]:
    log = running.enter_context((state / f"{module}.log").open("ab"))
    command = [sys.executable, "-m", f"recognition.learning.{module}", *map(str, arguments)]
    quiet = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    process = subprocess.Popen(command, stdout=log, stderr=log, env={**os.environ, **quiet})
    running.callback(process.wait)
    running.callback(process.terminate)
    return process


if __name__ == "__main__":
    run(work)
