"""Vary the surroundings of a line, and turn some lines the wrong way up.

more land, the part's edge and nothing beyond it        upside down, mirrored
........|~~~~~~ K 7 B 2 9 ~~~~~~~~~|........            6 2 B 7 K turned: the text is empty
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recognition.language.orientation import Way, images_of
from recognition.learning.training_samples import TALL_ROWS, TrainingStrip
from recognition.see.text_line import HEIGHT_ROWS
from recognition.see.view import EDGES, GREY, HEIGHTS, KNOWN


def vary_surroundings(
    strips: Sequence[TrainingStrip],
    *,
    rng: np.random.Generator,
    longer: float = 0.25,
    edge: float = 0.2,
    turned: float = 0.1,
) -> list[TrainingStrip]:
    """Change the surroundings of a share of the strips' ends, and turn a share the wrong way up: those have no text."""
    return [_turn_some(_change_ends(strip, longer, edge, rng), turned, rng) for strip in strips]


def _change_ends(
    strip: TrainingStrip, longer: float, edge: float, rng: np.random.Generator, *, gap_columns: float = 4.0
) -> TrainingStrip:
    # gap_columns: columns beside a character that stay as they are.
    if not strip.places:
        return strip
    layers, places = strip.layers, np.array(strip.places)
    free = places[:, 0].min(), layers.shape[2] - places[:, 1].max()
    margins = [int(max(columns - gap_columns, 0.0)) for columns in free]
    more = [int(rng.uniform(0.0, 2.5) * HEIGHT_ROWS) * (rng.random() < longer and m > 3) for m in margins]
    # land is added by mirroring the margin
    left, inner, right = np.split(layers, [margins[0], layers.shape[2] - margins[1]], axis=2)
    left = np.pad(left, ((0, 0), (0, 0), (more[0], 0)), mode="symmetric")
    right = np.pad(right, ((0, 0), (0, 0), (0, more[1])), mode="symmetric")
    layers = np.concatenate([left, inner, right], axis=2)
    for flipped, room in ((False, margins[0] + more[0]), (True, margins[1] + more[1])):
        if rng.random() < edge:
            _end_part(layers[:, :, ::-1] if flipped else layers, room, rng)
    return replace(strip, layers=layers, places=tuple((a + more[0], b + more[0]) for a, b in strip.places))


def _end_part(layers: NDArray[np.float16], room: int, rng: np.random.Generator) -> None:
    edge = rng.uniform(0.1, 1.0) * room + rng.uniform(-0.15, 0.15) * (np.arange(TALL_ROWS) - TALL_ROWS / 2)
    beyond = np.arange(layers.shape[2]) < np.minimum(edge, room)[:, None]
    shade = layers[GREY].any() and rng.random() < 0.7
    grey = rng.random() + 0.05 * rng.random() * rng.standard_normal(beyond.shape)
    layers[:, beyond] = 0
    if shade:
        layers[GREY, beyond] = np.clip(grey, 0.01, 1.0)[beyond]
        layers[KNOWN, beyond] = 1
    elif layers[HEIGHTS].any():
        # near the edge of a part, the level of the land is less exact
        layers[HEIGHTS] += (rng.normal(0.0, 0.04) * layers[KNOWN]).astype(np.float16)


def _turn_some(strip: TrainingStrip, share: float, rng: np.random.Generator) -> TrainingStrip:
    if rng.random() >= share:
        return strip
    way = Way.UPSIDE_DOWN if rng.random() < 0.7 else Way.ROWS_REVERSED
    text = strip.text.replace(" ", "")
    plain = sum(not images_of(char, way, exact=True) for char in text)
    if plain < max(2.0, 0.4 * len(text)):
        return strip
    order = list(range(strip.layers.shape[0]))
    order[EDGES:KNOWN] = [4, 5, 2, 3] if way is Way.UPSIDE_DOWN else [2, 5, 4, 3]
    columns = -1 if way is Way.UPSIDE_DOWN else 1
    return replace(strip, layers=strip.layers[order][:, ::-1, ::columns], text="", places=())
