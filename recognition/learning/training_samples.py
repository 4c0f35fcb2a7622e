"""Samples to learn from, in files: strips of a part's lines with their texts, and whole views with their lines.

    part --lines_of--> TextLine --View.strip--> strips --write_samples--> NUMBER.npz
         --views_of--> views at one scale ------------/

Strips are taller than the recogniser's, so that training may cut them otherwise. Views are kept `VIEW_ROWS` pixels to a
character, heights in character heights.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.stamping.die import Box
from recognition.learning.training_parts import TrainingPart
from recognition.views.curves import arc_through, straight_through
from recognition.views.resample import resample
from recognition.views.text_line import HEIGHT_ROWS, TextLine
from recognition.views.view import (
    HEIGHTS,
    LAYERS,
    View,
    ViewKind,
    felt_view,
    heights_view,
    photo_view,
    relief_of,
)
from whisker_array.estimation.edges import edge_map

Places = tuple[tuple[float, float], ...]

TALL_ROWS = 64
WIDE_MARGIN = 0.8
"""Land before and after the line in a file, character heights."""
VIEW_ROWS = 16
"""Pixels of a view to a character's height."""


@dataclass(frozen=True, eq=False)
class TrainingStrip:
    """A strip and its truth.

    Attributes:
        layers: (LAYERS, TALL_ROWS, columns) float16, as `recognition.views.view` has them.
        text: what stands there.
        source: "felt", "photo" or "heights".
        font: file name.
        soils: joined by +.
        severity: of the soil.
        directions: that were felt.
        places: where each character of the text begins and ends, columns; empty where that is not known.
    """

    layers: NDArray[np.float16]
    text: str
    source: str
    font: str
    soils: str
    severity: float
    directions: int = 0
    places: Places = ()


@dataclass(frozen=True, eq=False)
class TrainingView:
    """A view and its lines.

    Attributes:
        layers: (LAYERS, rows, columns) float16, heights in character heights.
        lines: of each, x and y in pixels of points along its middle.
    """

    layers: NDArray[np.float16]
    lines: tuple[Places, ...]


Sample = TypeVar("Sample", TrainingStrip, TrainingView)


def lines_of(made: TrainingPart) -> list[tuple[TextLine, str, Places]]:
    """The lines of a part, what they say and where, the one of its text first, by the boxes of the characters."""
    stamped = made.part.stamped
    lines = [(stamped.text, stamped.boxes_mm), (stamped.other_text, stamped.other_boxes_mm)]
    found = [(_line(text, boxes, made), text, boxes) for text, boxes in lines if text.strip()]
    return [(line, text, _places(line, boxes, made)) for line, text, boxes in found]


def _places(line: TextLine, boxes_mm: Sequence[Box], made: TrainingPart) -> Places:
    """Where each character of a straight line begins and ends in its strip, columns."""
    if not np.isinf(made.layout.radius_mm):
        return ()
    turn = np.radians(made.layout.turned_deg)
    along = np.array([np.cos(turn), np.sin(turn)])
    start = float(line.centre_mm[0] @ along) - WIDE_MARGIN * line.height_mm
    places = []
    for x0, y0, x1, y1 in boxes_mm:
        middle = (np.array([(x0 + x1) / 2, (y0 + y1) / 2]) @ along - start) * HEIGHT_ROWS / line.height_mm
        half = (x1 - x0) / 2 * HEIGHT_ROWS / line.height_mm
        places.append((round(float(middle - half), 1), round(float(middle + half), 1)))
    return tuple(places)


def _line(text: str, boxes_mm: Sequence[Box], made: TrainingPart) -> TextLine:
    boxes = [(c, b) for c, b in zip(text, boxes_mm, strict=True) if c != " "]
    middles = np.array([((b[0] + b[2]) / 2, (b[1] + b[3]) / 2) for _, b in boxes])
    # of what is as high as a line, the middle is half way up
    full = np.array([c.isdigit() or c.isupper() for c, _ in boxes])
    if not full.any():
        full[:] = True
    first, last = boxes[0][1], boxes[-1][1]
    before, after = (first[2] - first[0]) / 2, (last[2] - last[0]) / 2
    if np.isinf(made.layout.radius_mm):
        turn = np.radians(made.layout.turned_deg)
        along, down = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        level = np.median(middles[full] @ down)
        ends = np.array([middles[0] @ along - before, middles[-1] @ along + after])
        return TextLine(ends[:, None] * along + level * down, made.height_mm)
    wide = np.linalg.norm(middles[full][[0, 0, -1, -1]] - middles[[0, 0, -1, -1]], axis=1)
    before, after = before + float(wide[0]), after + float(wide[-1])
    curve = arc_through(middles[full], height=made.height_mm, before=before, after=after)
    if curve is None:
        curve = straight_through(middles[full], before=before, after=after)
    return TextLine(curve, made.height_mm)


def views_of(made: TrainingPart) -> list[View]:
    """Return the views of a part: felt, photographed and measured.

    Raises:
        MapError: nothing was felt.
    """
    edges = edge_map(made.scan)
    views = [felt_view(edges, relief_of(made.scan, edges))]
    width, height = made.part.height_map.size_mm
    views += [
        photo_view(replace(photo, centre_mm=photo.centre_mm or (width / 2, height / 2)))
        for photo in made.photos
    ]
    return [*views, heights_view(made.part.height_map)]


def strips_of(made: TrainingPart) -> list[TrainingStrip]:
    """Strips of the lines of a part: felt, photographed and measured.

    Raises:
        MapError: nothing was felt.
    """
    soiling = made.part.soiling
    return [
        TrainingStrip(
            layers=view.strip(line, rows=TALL_ROWS, margin=WIDE_MARGIN).astype(np.float16),
            text=text,
            source=str(view.kind),
            font=Path(made.font).name,
            soils="+".join(soiling.soils),
            severity=soiling.severity,
            directions=len(made.scan.sweeps) if view.kind is ViewKind.FELT else 0,
            places=places,
        )
        for view in views_of(made)
        for line, text, places in lines_of(made)
    ]


def training_views(made: TrainingPart) -> list[TrainingView]:
    """Views of a part: felt, photographed and measured.

    Raises:
        MapError: nothing was felt.
    """
    lines = [line.centre_mm for line, _, _ in lines_of(made)]
    return [_training_view(view, lines, made.height_mm) for view in views_of(made)]


def _training_view(view: View, lines: Sequence[NDArray[np.float64]], height_mm: float) -> TrainingView:
    layers = resample(view, height_mm / VIEW_ROWS)
    layers[HEIGHTS] /= height_mm
    pixels = [np.round((line - view.origin_mm) * (VIEW_ROWS / height_mm), 3).tolist() for line in lines]
    return TrainingView(layers.astype(np.float16), _as_tuples(pixels))


def write_samples(path: Path, samples: Sequence[Sample]) -> None:
    """Write samples of one kind into one .npz, of each the layers that hold anything."""
    held = [np.flatnonzero(sample.layers.any(axis=(1, 2))) for sample in samples]
    truth = [
        {
            **{f.name: getattr(sample, f.name) for f in fields(sample) if f.name != "layers"},
            "held": own.tolist(),
            "size": sample.layers.shape[1:],
        }
        for sample, own in zip(samples, held, strict=True)
    ]
    kept = [sample.layers[own].ravel() for sample, own in zip(samples, held, strict=True)]
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as file:
        np.savez(file, values=np.concatenate(kept), truth=np.array(json.dumps(truth)))


def read_samples(kind: type[Sample], paths: Iterable[Path]) -> list[Sample]:
    """Read the samples of files, all of one kind."""
    samples = []
    for path in paths:
        with np.load(path) as file:
            values, truth = file["values"], json.loads(str(file["truth"]))
        at = 0
        for one in truth:
            held: list[int] = one.pop("held")
            size: tuple[int, ...] = tuple(one.pop("size"))
            many = len(held) * math.prod(size)
            layers = np.zeros((LAYERS, *size), dtype=np.float16)
            layers[held] = values[at : at + many].reshape(len(held), *size)
            samples.append(kind(layers, **{name: _as_tuples(value) for name, value in one.items()}))
            at += many
    return samples


def _as_tuples(value: Any) -> Any:
    """Lists, and lists in them, as tuples."""
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value
