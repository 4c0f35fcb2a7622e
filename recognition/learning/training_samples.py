"""Training samples in files: strips of lines with their texts, and whole views with the positions of their lines.

    part --lines_of--> TextLine --View.strip--> strips --write_samples--> NUMBER.npz
         --views_of--> views at one scale ------------/

Strips are taller than the input of the recogniser, so that augmentation can crop them differently. Heights of lines in
views are in character heights, of `VIEW_ROWS` pixels.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from recognition.learning.training_parts import TrainingPart
from recognition.see.curves import arc_through, straight_through
from recognition.see.resample import resample
from recognition.see.text_line import HEIGHT_ROWS, TextLine
from recognition.see.view import (
    HEIGHTS,
    LAYERS,
    View,
    felt_view,
    heights_view,
    photo_view,
    relief_of,
)
from whisker_array.estimation.edges import edge_map

Places = tuple[tuple[float, float], ...]

TALL_ROWS = 64
"""Rows of a strip in a file."""
WIDE_MARGIN = 0.8
"""Margin of a strip in a file before and after its line, character heights."""
VIEW_ROWS = 16
"""Pixels of a view per character height."""


@dataclass(frozen=True, eq=False)
class TrainingStrip:
    """A strip, from "felt", "photo" or "heights", and its truth; without columns of its characters if unknown."""

    layers: NDArray[np.float16]
    text: str
    source: str
    severity: float
    places: Places = ()


@dataclass(frozen=True, eq=False)
class TrainingView:
    """A view and its lines: x and y of points along the middle of each, pixels."""

    layers: NDArray[np.float16]
    lines: tuple[Places, ...]


Sample = TypeVar("Sample", TrainingStrip, TrainingView)


def lines_of(drawn: TrainingPart) -> list[tuple[TextLine, str, Places]]:
    """Return the lines of a part with text and columns, from the boxes of the characters; the serial comes first."""
    stamped = drawn.part.stamped
    lines = [(stamped.text, stamped.boxes_mm), (stamped.other_text, stamped.other_boxes_mm)]
    return [_line(text, np.array(boxes), drawn) for text, boxes in lines if text.strip()]


def _line(text: str, boxes_mm: NDArray[np.float64], drawn: TrainingPart) -> tuple[TextLine, str, Places]:
    height_mm, layout = drawn.part.height_mm, drawn.layout
    middles, half = 0.5 * (boxes_mm[:, :2] + boxes_mm[:, 2:]), 0.5 * (boxes_mm[:, 2] - boxes_mm[:, 0])
    inked = np.array([c != " " for c in text])
    # only the middle of a full-height character is on the middle of the line
    full = np.array([c.isdigit() or c.isupper() for c in text])
    full = full if full.any() else inked
    ends = np.flatnonzero(inked)[[0, -1]]
    if np.isinf(layout.radius_mm):
        turn = np.radians(layout.turned_deg)
        along, down = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        reach = middles[ends] @ along + half[ends] * (-1.0, 1.0)
        line = TextLine(reach[:, None] * along + np.median(middles[full] @ down) * down, height_mm)
        along_mm = middles @ along - reach[0] + WIDE_MARGIN * height_mm
        columns = np.stack([along_mm - half, along_mm + half], axis=1) * (HEIGHT_ROWS / height_mm)
        return line, text, _as_tuples(np.round(columns, 1).tolist())
    spare = np.linalg.norm(middles[full][[0, -1]] - middles[ends], axis=1)
    before, after = (float(far) for far in half[ends] + spare)
    curve = arc_through(middles[full], height=height_mm, before=before, after=after)
    if curve is None:
        curve = straight_through(middles[full], before=before, after=after)
    return TextLine(curve, height_mm), text, ()


def views_of(drawn: TrainingPart) -> list[View]:
    """Return the views of a part: felt, photographed and measured. Raises MapError if nothing was felt."""
    edges = edge_map(drawn.scan)
    views = [felt_view(edges, relief_of(drawn.scan, edges))]
    width, height = drawn.part.height_map.size_mm
    views += [
        photo_view(replace(photo, centre_mm=photo.centre_mm or (width / 2, height / 2)))
        for photo in drawn.photos
    ]
    return [*views, heights_view(drawn.part.height_map)]


def strips_of(drawn: TrainingPart) -> list[TrainingStrip]:
    """Strips of the lines of a part: felt, photographed and measured. Raises MapError."""
    lines, severity = lines_of(drawn), drawn.part.soiling.severity
    strips = []
    for view in views_of(drawn):
        for line, text, places in lines:
            layers = view.strip(line, rows=TALL_ROWS, margin=WIDE_MARGIN).astype(np.float16)
            strips.append(TrainingStrip(layers, text, str(view.kind), severity, places))
    return strips


def training_views(drawn: TrainingPart) -> list[TrainingView]:
    """Views of a part: felt, photographed and measured. Raises MapError."""
    lines = [line.centre_mm for line, _, _ in lines_of(drawn)]
    views, scale = [], VIEW_ROWS / drawn.part.height_mm
    for view in views_of(drawn):
        layers = resample(view, 1.0 / scale)
        layers[HEIGHTS] /= drawn.part.height_mm
        pixels = [np.round((line - view.origin_mm) * scale, 3).tolist() for line in lines]
        views.append(TrainingView(layers.astype(np.float16), _as_tuples(pixels)))
    return views


def write_samples(path: Path, samples: Sequence[Sample]) -> None:
    """Write samples of one kind into one .npz, without empty layers."""
    held = [np.flatnonzero(sample.layers.any(axis=(1, 2))) for sample in samples]
    truth = [
        {
            f.name: held_layers.tolist() if f.name == "layers" else getattr(sample, f.name)
            for f in fields(sample)
        }
        for sample, held_layers in zip(samples, held, strict=True)
    ]
    filled = (sample.layers[held_layers] for sample, held_layers in zip(samples, held, strict=True))
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as file:
        np.savez(file, *filled, truth=np.array(json.dumps(truth)))


def files_in(folders: Iterable[Path]) -> list[Path]:
    """Return the sample files in folders, without those that are being written. Raises ValueError without any."""
    files = sorted(p for folder in folders for p in folder.glob("*.npz") if not p.name.startswith("."))
    if not files:
        raise ValueError(f"there are no samples in {', '.join(map(str, folders))}: draw some first")
    return files


def read_samples(kind: type[Sample], paths: Iterable[Path]) -> list[Sample]:
    """Read the samples of files, all of one kind."""
    samples = []
    for path in paths:
        with np.load(path) as file:
            for k, fields_of_sample in enumerate(json.loads(str(file["truth"]))):
                filled: NDArray[np.float16] = file[f"arr_{k}"]
                layers = np.zeros((LAYERS, *filled.shape[1:]), dtype=np.float16)
                layers[fields_of_sample.pop("layers")] = filled
                samples.append(
                    kind(layers, **{name: _as_tuples(value) for name, value in fields_of_sample.items()})
                )
    return samples


def rounds(
    kind: type[Sample], folders: Sequence[Path], rng: np.random.Generator, *, files: int
) -> Iterator[list[Sample]]:
    """Yield the samples of `files` files at a time, endlessly; files added meanwhile are read. Raises ValueError."""
    waiting: list[Path] = []
    while True:
        if len(waiting) < files:
            there = files_in(folders)
            waiting += [there[k] for k in rng.permutation(len(there))]
        now, waiting = waiting[:files], waiting[files:]
        yield read_samples(kind, now)


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value
