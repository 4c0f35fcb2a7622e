"""Whole views to learn from, in files, with where their lines are: what the finder of lines is trained on.

Views are kept `VIEW_ROWS` pixels to a character, heights in character heights.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.learning.training_parts import TrainingPart
from recognition.learning.training_strips import lines_of, views_of
from recognition.views.resample import resample
from recognition.views.view import HEIGHTS, View

VIEW_ROWS = 16
"""Pixels to a character's height."""


@dataclass(frozen=True, eq=False)
class TrainingView:
    """A view and its lines.

    Attributes:
        layers: (LAYERS, rows, columns) float16, heights in character heights.
        lines: each (n, 2) float32, x and y in pixels along its middle.
    """

    layers: NDArray[np.float16]
    lines: tuple[NDArray[np.float32], ...]


def training_views(made: TrainingPart) -> list[TrainingView]:
    """Views of a part: felt, photographed and measured.

    Raises:
        MapError: nothing was felt.
    """
    lines = [line for line, _, _ in lines_of(made)]
    return [
        _training_view(view, [line.centre_mm for line in lines], made.height_mm) for view in views_of(made)
    ]


def _training_view(view: View, lines: Sequence[NDArray[np.float64]], height_mm: float) -> TrainingView:
    layers = resample(view, height_mm / VIEW_ROWS)
    layers[HEIGHTS] /= height_mm
    pixels = [((line - view.origin_mm) * (VIEW_ROWS / height_mm)).astype(np.float32) for line in lines]
    return TrainingView(layers.astype(np.float16), tuple(pixels))


def write_views(path: Path, views: Sequence[TrainingView]) -> None:
    """Write views into one .npz."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for k, view in enumerate(views):
        arrays[f"layers-{k}"] = view.layers
        for n, line in enumerate(view.lines):
            arrays[f"line-{k}-{n}"] = line
    np.savez(path, allow_pickle=False, **arrays)  # type: ignore[arg-type]


def read_views(paths: Iterable[Path]) -> list[TrainingView]:
    """Read the views of files."""
    views = []
    for path in paths:
        with np.load(path) as file:
            names = list(file.files)
            for name in names:
                if name.startswith("layers-"):
                    own = f"line-{name.removeprefix('layers-')}-"
                    lines = tuple(file[other] for other in names if other.startswith(own))
                    views.append(TrainingView(file[name], lines))
    return views
