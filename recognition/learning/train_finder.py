"""Train the finder on windows of views with their lines, at random scales and rotations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as f
from torch.utils.data import IterableDataset, get_worker_info

from recognition.find.finder import CELL, FINDER_ROWS
from recognition.learning.augment import add_noise
from recognition.learning.finder_network import FINDINGS, Finder
from recognition.learning.training_loop import DEVICE, Task, Training, export, load_batches
from recognition.learning.training_samples import (
    VIEW_ROWS,
    Places,
    TrainingView,
    files_in,
    read_samples,
    rounds,
)
from recognition.see.text_line import TextLine, points_along
from recognition.see.view import HEIGHTS, LAYERS

WINDOW = (72, 224)
"""Rows and columns of the largest window."""
_TIGHTEST = (16, 48)
"""Rows and columns of the smallest window."""
_TIGHT_SHARE = 0.5
"""Share of batches with smaller windows at a line: the part, or the photograph, may end close to the characters."""
_MIDDLE = 0.25
"""Distance from the middle of a line within which a cell belongs to it, character heights."""
_BESIDE = 0.42
"""Distance from the middle of a line within which other cells are ignored, character heights."""
_MUST_FIND = 0.45
"""Difference between the heights of a line and of the scale up to which the line must be found, octaves."""
_MAY_FIND = 0.75
"""Difference between the heights of a line and of the scale up to which the line may be found, octaves."""
_HELD = 240
_FILES = 24
_WINDOWS = 4
"""Windows drawn from each view before the next files are read."""


def draw_window(
    view: TrainingView,
    rng: np.random.Generator,
    *,
    window: tuple[int, int] = WINDOW,
    plain: bool = False,  # show the middle of the view at its true scale instead
) -> tuple[NDArray[np.float32], NDArray[np.float32], float]:
    """Draw a window of a view at a random scale and rotation, with its truth: (2, *window) x and y of its pixels in the
    view; (2 + FINDINGS, rows, columns) of its cells: whether the finding "middle" counts in the loss, whether the
    others count, and the findings; its scale over the true one, octaves."""
    octaves = 0.0 if plain else rng.uniform(-1.0, 1.0)
    zoom = VIEW_ROWS / (FINDER_ROWS * 2.0**octaves)  # pixels of the view per pixel of the window
    turn = 0.0 if plain else rng.normal(0.0, 0.08)
    rows, columns = window
    h, w = view.layers.shape[1:]
    middle = np.array([w / 2, h / 2])
    if window != WINDOW and view.lines:
        points = _dense(view.lines[rng.integers(len(view.lines))])
        middle = points[rng.integers(len(points))] + rng.normal(0.0, 0.15, 2) * VIEW_ROWS
    elif not plain:
        middle += rng.uniform(-0.5, 0.5, 2) * np.maximum(
            [w - 0.6 * columns * zoom, h - 0.6 * rows * zoom], 0.3 * h
        )
    down, right = np.mgrid[:rows, :columns] - 0.5 * np.reshape([rows - 1, columns - 1], (2, 1, 1))
    cos, sin = np.cos(turn) * zoom, np.sin(turn) * zoom
    places = middle[:, None, None] + np.stack([cos * right - sin * down, sin * right + cos * down])
    cells = places.reshape(2, rows // CELL, CELL, columns // CELL, CELL).mean(axis=(2, 4))
    return places.astype(np.float32), _truth(view, cells, octaves, turn), octaves


def _truth(
    view: TrainingView, cells: NDArray[np.float64], octaves: float, turn: float
) -> NDArray[np.float32]:
    truth = np.zeros((2 + FINDINGS, *cells.shape[1:]), dtype=np.float32)
    truth[0] = 1.0
    nearest = np.full(cells.shape[1:], np.inf)
    for line in view.lines:
        points = _dense(line)
        along = np.gradient(points, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        away = cells[:, None] - points.T[:, :, None, None]
        k = (away**2).sum(axis=0).argmin(axis=0)
        offset = np.take_along_axis(away, k[None, None], axis=1)[:, 0]
        right, down = along[k, 0], along[k, 1]
        beyond = np.abs(offset[0] * right + offset[1] * down) / VIEW_ROWS
        off = -(-offset[0] * down + offset[1] * right) / VIEW_ROWS  # from the cell down to the middle
        far = np.maximum(np.abs(off), np.where(beyond > 0.15, 9.0, 0.0))
        mine = far < nearest
        nearest = np.where(mine, far, nearest)
        angle = (np.arctan2(down, right) - turn + np.pi) % (2 * np.pi) - np.pi
        truth[3:] = np.where(mine, np.stack([np.full_like(off, octaves), angle, off]), truth[3:])
        # cells next to the ends of a line are ignored
        truth[0] = np.where((np.abs(off) < _BESIDE) & (beyond > 0.1) & (beyond < 0.4), 0.0, truth[0])
    near = nearest < _MIDDLE
    truth[2] = near
    truth[0] = np.where((nearest >= _MIDDLE) & (nearest < _BESIDE), 0.0, truth[0])
    if abs(octaves) > _MAY_FIND:
        truth[2] = 0.0
    elif abs(octaves) > _MUST_FIND:
        truth[0] = np.where(nearest < _BESIDE, 0.0, truth[0])
    truth[1] = near & (abs(octaves) <= _MAY_FIND)
    return truth


def _dense(line: Places) -> NDArray[np.float64]:
    curve = TextLine(np.array(line), VIEW_ROWS)
    return points_along(curve, np.linspace(0.0, 1.0, max(8, int(curve.length_mm / 3))))


def _batch(
    views: Sequence[TrainingView], rng: np.random.Generator, *, plain: bool = False
) -> tuple[Tensor, Tensor]:
    strips, truths, window = [], [], WINDOW
    if not plain and rng.random() < _TIGHT_SHARE:
        # whole cells
        rows, columns = rng.integers(np.array(_TIGHTEST) // CELL, np.array(WINDOW) // CELL) * CELL
        window = (int(rows), int(columns))
    for view in views:
        places, truth, octaves = draw_window(view, rng, window=window, plain=plain)
        layers = torch.from_numpy(view.layers.astype(np.float32))[None]
        size = np.array(view.layers.shape[:0:-1]).reshape(2, 1, 1)
        grid = torch.from_numpy(np.moveaxis((places + 0.5) * 2 / size - 1, 0, -1).astype(np.float32))
        strip = f.grid_sample(layers, grid[None], mode="bilinear", align_corners=False)
        strip[:, HEIGHTS] *= 2.0**octaves
        strips.append(strip)
        truths.append(torch.from_numpy(truth))
    return torch.cat(strips), torch.stack(truths)


class Windows(IterableDataset[tuple[Tensor, Tensor]]):
    """Endless batches of windows and their truths; each worker process draws its own."""

    def __init__(self, folders: Sequence[Path], *, size: int, seed: int) -> None:
        self.folders, self.size, self.seed = tuple(folders), size, seed

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        worker = get_worker_info()
        rng = np.random.default_rng(self.seed if worker is None else self.seed + 1000 * (worker.id + 1))
        for views in rounds(TrainingView, self.folders, rng, files=_FILES):
            for _ in range(max(1, len(views) * _WINDOWS // self.size)):
                yield _batch([views[i] for i in rng.integers(len(views), size=self.size)], rng)


def loss_of(outputs: Tensor, truth: Tensor) -> Tensor:
    """Loss of the middle on all judged cells, and of the other findings on the lines."""
    judged, on = truth[:, 0], truth[:, 1]
    middle = (
        f.binary_cross_entropy_with_logits(outputs[:, 0], truth[:, 2], weight=judged, reduction="sum")
        / judged.sum()
    )
    counts = torch.tensor([1.0, 2.0, 1.5], device=outputs.device).reshape(1, 3, 1, 1)
    off = ((outputs[:, 1:] - truth[:, 3:]).abs() * counts).sum(dim=1)
    return 4 * middle + (off * on).sum() / on.sum().clamp(min=1.0)


@torch.no_grad()
def measure_finder(network: Finder, views: Sequence[TrainingView]) -> tuple[float, dict[str, Any]]:
    """Return the loss on plain views, and recall and precision of the cells with mean errors on the lines."""
    network.eval()
    rng, device = np.random.default_rng(0), network.head.weight.device
    batches = (_batch([view], rng, plain=True) for view in views)
    by_view, truth = zip(*((network(x.to(device)).cpu(), truth) for x, truth in batches), strict=True)
    outputs, true = torch.cat(by_view), torch.cat(truth)
    network.train()
    judged, line, middle = true[:, 0] > 0, true[:, 2] > 0, outputs[:, 0] > 0
    hits = (middle & line & judged).sum()
    off = ((outputs[:, 1:] - true[:, 3:]).abs() * true[:, 1:2]).sum(dim=(0, 2, 3)) / true[:, 1].sum()
    words = {
        "found": float(hits / (line & judged).sum()),
        "right": float(hits / (middle & judged).sum().clamp(min=1)),
        **dict(zip(("octaves", "radians", "down"), off.tolist(), strict=True)),
    }
    return float(loss_of(outputs, true)), words


def task(folders: Sequence[Path], held_out: Path, how: Training) -> Task:
    """The finder and its training data (default: a rate of 2e-3)."""
    network = Finder()
    if how.start is not None:
        network.load_state_dict(torch.load(how.start, weights_only=True))
    network = network.to(DEVICE, memory_format=torch.channels_last)
    held = read_samples(TrainingView, files_in([held_out]))[:_HELD]
    optimiser = torch.optim.AdamW(network.parameters(), lr=how.rate or 2e-3, weight_decay=0.01)
    # any number of views of any size
    axes = {0: "n", 2: "rows", 3: "columns"}
    return Task(
        network,
        optimiser,
        lambda step: load_batches(Windows(folders, size=how.batch, seed=how.seed + step), how),
        lambda batch, draw: _loss(network, batch, draw),
        lambda trained: measure_finder(trained, held),
        lambda out: export(
            network, torch.zeros(1, LAYERS, 64, 160), out, names=("view", "found"), axes=(axes, axes)
        ),
    )


def _loss(network: Finder, batch: tuple[Tensor, Tensor], draw: torch.Generator) -> Tensor:
    (views, truth), device = batch, draw.device
    with torch.no_grad(), device:
        normal = network.normalise(add_noise(views.to(device), rng=draw)).to(
            memory_format=torch.channels_last
        )
    with torch.autocast(device.type, torch.bfloat16):
        outputs = network.read(normal)
    return loss_of(outputs, truth.to(device))
