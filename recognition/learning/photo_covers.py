"""Cover photographs of strips with what lies on parts in a workshop; the text stays as it was stamped. Pixels here are
those of strips: HEIGHT_ROWS to a character height."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from glyphs.opencv import cv2
from glyphs.sketch import blur, noise, rough_noise
from recognition.learning.training_samples import TrainingStrip
from recognition.see.text_line import HEIGHT_ROWS
from recognition.see.view import GREY, KNOWN

Grey = NDArray[np.float32]
_FINE = 4
"""Times that swarf, drops and scratches are drawn larger than the strip, for smooth edges."""
_HEIGHT = HEIGHT_ROWS * _FINE
"""Pixels per character height at which they are drawn."""


def cover_photos(
    strips: Sequence[TrainingStrip], *, rng: np.random.Generator, share: float = 0.35, most: int = 3
) -> list[TrainingStrip]:
    """Cover a share of the photographs among strips with one to `most` things."""
    return [
        _cover(strip, rng, most) if strip.layers[GREY].any() and rng.random() < share else strip
        for strip in strips
    ]


def _cover(strip: TrainingStrip, rng: np.random.Generator, most: int) -> TrainingStrip:
    layers = strip.layers.copy()
    grey = layers[GREY].astype(np.float32)
    for _ in range(int(rng.integers(1, most + 1))):
        grey = _COVERS[int(rng.integers(len(_COVERS)))](grey, rng)
    layers[GREY] = np.clip(grey, 0.0, 1.0) * layers[KNOWN]
    return replace(strip, layers=layers)


def _put(grey: Grey, mask: NDArray[np.uint8], shade: float | Grey) -> Grey:
    small = cv2.resize(mask, grey.shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
    return np.asarray(grey * (1.0 - small) + shade * small, dtype=np.float32)


def _blank(grey: Grey) -> NDArray[np.uint8]:
    return np.zeros((grey.shape[0] * _FINE, grey.shape[1] * _FINE), dtype=np.uint8)


def _spot(mask: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.float64]:
    return rng.uniform(0.0, 1.0, 2) * mask.shape[::-1]


def _curls(grey: Grey, rng: np.random.Generator) -> Grey:
    for _ in range(int(rng.integers(1, 5))):
        dark, bright = _blank(grey), _blank(grey)
        turns, length = rng.uniform(0.4, 3.0), rng.uniform(0.3, 2.0) * _HEIGHT
        along = np.linspace(0.0, 1.0, 60)
        angle = 2 * np.pi * (turns * along + rng.random())
        radius = rng.uniform(0.06, 0.35) * _HEIGHT * (1.0 + 0.5 * (along - 0.5))
        way = rng.uniform(0.0, 2 * np.pi)
        middle = _spot(dark, rng) + (along - 0.5)[:, None] * length * np.array([np.cos(way), np.sin(way)])
        points = middle + radius[:, None] * np.stack(
            [np.cos(angle), rng.uniform(0.3, 1.0) * np.sin(angle)], axis=1
        )
        line = np.round(points).astype(np.int32)
        wide = max(2, round(rng.uniform(0.03, 0.12) * _HEIGHT))
        cv2.polylines(dark, [line], False, 255, wide, cv2.LINE_AA)
        cv2.polylines(bright, [line - max(1, wide // 4)], False, 255, max(1, wide // 3), cv2.LINE_AA)
        grey = _put(grey, dark, float(rng.uniform(0.02, 0.5)))
        grey = _put(grey, bright, float(rng.uniform(0.5, 1.0)))
    return grey


def _chips(grey: Grey, rng: np.random.Generator) -> Grey:
    for _ in range(int(rng.integers(2, 12))):
        mask = _blank(grey)
        corners = np.sort(rng.uniform(0.0, 2 * np.pi, int(rng.integers(3, 7))))
        reach = rng.uniform(0.02, 0.16) * _HEIGHT * rng.uniform(0.5, 1.3, len(corners))
        middle = _spot(mask, rng)
        points = middle + reach[:, None] * np.stack(
            [np.cos(corners), rng.uniform(0.3, 1.0) * np.sin(corners)], axis=1
        )
        shadow = _blank(grey)
        cv2.fillPoly(shadow, [np.round(points + rng.uniform(-0.03, 0.03, 2) * _HEIGHT).astype(np.int32)], 160)
        cv2.fillPoly(mask, [np.round(points).astype(np.int32)], 255, cv2.LINE_AA)
        grey = _put(_put(grey, shadow, 0.05), mask, float(rng.uniform(0.1, 1.0)))
    return grey


def _drops(grey: Grey, rng: np.random.Generator) -> Grey:
    rows, columns = np.indices(grey.shape, dtype=np.float32)
    for _ in range(int(rng.integers(1, 6))):
        mask, rim = _blank(grey), _blank(grey)
        middle, radius = _spot(mask, rng), rng.uniform(0.08, 0.45) * _HEIGHT
        axes = (round(radius), round(radius * rng.uniform(0.6, 1.0)))
        centre = (round(middle[0]), round(middle[1]))
        cv2.ellipse(mask, centre, axes, 0.0, 0.0, 360.0, 255, -1, cv2.LINE_AA)
        cv2.ellipse(rim, centre, axes, 0.0, 0.0, 360.0, 180, max(1, round(0.02 * _HEIGHT)), cv2.LINE_AA)
        x, y = (float(place) for place in middle / _FINE)
        magnified = float(rng.uniform(0.6, 0.95))
        below_x = np.asarray(x + (columns - x) * magnified, dtype=np.float32)
        below_y = np.asarray(y + (rows - y) * magnified, dtype=np.float32)
        below = cv2.remap(grey, below_x, below_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        grey = _put(
            _put(grey, mask, np.asarray(np.asarray(below) * rng.uniform(0.5, 1.0), dtype=np.float32)),
            rim,
            0.05,
        )
        glint = _blank(grey)
        place = (round(centre[0] - 0.3 * radius), round(centre[1] - 0.3 * radius))
        cv2.circle(glint, place, max(2, round(0.12 * radius)), 255, -1, cv2.LINE_AA)
        grey = _put(grey, glint, 1.0)
    return grey


def _scratches(grey: Grey, rng: np.random.Generator) -> Grey:
    mask, tilt = _blank(grey), rng.normal(0.0, 0.12)
    for _ in range(int(rng.integers(2, 14))):
        start, length = _spot(mask, rng), rng.uniform(0.5, 6.0) * _HEIGHT
        end = start + length * np.array([1.0, tilt + rng.normal(0.0, 0.04)])
        wide = max(1, round(rng.uniform(0.01, 0.05) * _HEIGHT))
        cv2.line(
            mask,
            np.round(start).astype(int).tolist(),
            np.round(end).astype(int).tolist(),
            255,
            wide,
            cv2.LINE_AA,
        )
    return _put(grey, mask, float(rng.choice([rng.uniform(0.0, 0.2), rng.uniform(0.7, 1.0)])))


def _scale(grey: Grey, rng: np.random.Generator) -> Grey:
    rough = rough_noise(grey.shape, rng.uniform(0.3, 1.0) * HEIGHT_ROWS, rng)
    patch = np.clip(4.0 * (rough - rng.uniform(0.8, 1.8)), 0.0, 1.0)
    texture = 0.1 * rng.standard_normal(grey.shape).astype(np.float32)
    shade = np.clip(rng.uniform(0.05, 0.8) + texture, 0.0, 1.0)
    return np.asarray(grey + rng.uniform(0.4, 1.0) * patch * (shade - grey), dtype=np.float32)


def _chatter(grey: Grey, rng: np.random.Generator) -> Grey:
    rows, columns = np.indices(grey.shape, dtype=np.float32)
    tilt, period = rng.normal(0.0, 0.5), rng.uniform(0.06, 0.3) * HEIGHT_ROWS
    wave = np.sin(
        2 * np.pi * ((columns + tilt * rows) / period + rng.random()) + 0.6 * noise(grey.shape, (9, 9), rng)
    )
    from_median = np.abs(grey - float(np.median(grey)))
    weight = 0.5 * from_median if rng.random() < 0.5 else float(from_median.std())
    return np.asarray(grey + rng.uniform(0.3, 1.5) * weight * wave, dtype=np.float32)


def _orange_peel(grey: Grey, rng: np.random.Generator) -> Grey:
    soft = blur(grey, float(rng.uniform(0.3, 1.5)))
    peel = noise(grey.shape, (float(rng.uniform(3.0, 8.0)),) * 2, rng)
    return np.asarray(soft + rng.uniform(0.2, 1.0) * float(soft.std()) * peel, dtype=np.float32)


def _bloom(grey: Grey, rng: np.random.Generator) -> Grey:
    rows, columns = np.indices(grey.shape, dtype=np.float32)
    y, x = rng.uniform(0.0, 1.0, 2) * grey.shape
    high, wide = rng.uniform(0.3, 1.5, 2) * HEIGHT_ROWS
    far = ((rows - y) / high) ** 2 + ((columns - x) / (wide * rng.uniform(1.0, 4.0))) ** 2
    return np.asarray(grey + rng.uniform(0.4, 1.5) * np.exp(-far), dtype=np.float32)


_COVERS: tuple[Callable[[Grey, np.random.Generator], Grey], ...] = (
    _curls, _chips, _drops, _scratches, _scale, _chatter, _orange_peel, _bloom,
)  # fmt: skip
