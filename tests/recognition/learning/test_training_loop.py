"""A run that is stopped goes on where it was; two copies in the background do not share a folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from glyphs.errors import MarksError
from glyphs.file_lock import exclusively
from recognition.learning.background import work

torch = pytest.importorskip("torch", reason="the extra `train` is not installed")


class StoppedError(Exception):
    """As when the process ends."""


def run_until(step: int, out: Path, *, samples: int = 400) -> list[int]:
    """Train one weight towards 3, and stop before a step; returns the steps from which batches were asked for."""
    from recognition.learning.training_loop import Task, Training, fit

    torch.manual_seed(0)
    network = torch.nn.Linear(1, 1, bias=False)
    asked: list[int] = []

    def batches(first: int) -> Iterator[int]:
        asked.append(first)
        for k in range(first, 1000):
            if k == step:
                raise StoppedError
            yield k

    task = Task(
        network,
        torch.optim.Adam(network.parameters(), lr=0.2),
        batches,
        lambda _batch, _draw: (network(torch.ones(1, 1)) - 3.0).square().sum(),
        lambda one: (abs(float(one.weight.detach()) - 3.0), {"weight": float(one.weight.detach())}),
        lambda path: path.write_text(str(float(network.weight.detach()))),
    )
    fit(task, Training(samples=samples, batch=4), out=out, log=out.with_suffix(".log"), save_s=-1.0)
    return asked


def test_a_stopped_run_goes_on_from_its_last_step(tmp_path: Path) -> None:
    out = tmp_path / "net.onnx"
    with pytest.raises(StoppedError):
        run_until(40, out)
    assert not out.exists()
    assert run_until(-1, out) == [40]
    lines = [json.loads(line) for line in out.with_suffix(".log").read_text().splitlines()]
    assert {"resumed at": 160} in lines
    assert lines[-1]["samples"] == 400
    assert float(out.read_text()) == pytest.approx(3.0, abs=0.1)
    # the next run is a new one
    assert not out.with_suffix(".state.pt").exists()


def test_going_on_gives_what_one_run_gives(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole.onnx", tmp_path / "parts.onnx"
    run_until(-1, whole)
    for stop in (30, 60):
        with pytest.raises(StoppedError):
            run_until(stop, parts)
    run_until(-1, parts)
    assert float(parts.read_text()) == pytest.approx(float(whole.read_text()), abs=1e-5)


def test_a_folder_is_used_by_one_copy(tmp_path: Path) -> None:
    with exclusively(tmp_path / "lock"), pytest.raises(MarksError, match="is in use"):
        work([], state=tmp_path, samples=1)
    assert [file.name for file in tmp_path.iterdir()] == ["lock"]
