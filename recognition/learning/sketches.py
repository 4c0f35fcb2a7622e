r"""Strips without physics: a sketch as a tip would feel it and as a camera would see it, to learn from beside parts.

text --glyphs.sketch--> surface, ink, dirt --tip--> felt
                                           \--light, lens--> photograph
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glyphs.opencv import cv2
from glyphs.sketch import ROWS, Field, Sketch, blur, noise, rough_noise, sketch
from recognition.learning.training_parts import draw_font, draw_text
from recognition.learning.training_samples import TALL_ROWS, TrainingStrip
from recognition.see.text_line import HEIGHT_ROWS
from recognition.see.view import EDGES, GREY, HEIGHTS, KNOWN, LAYERS

_FINE = ROWS // TALL_ROWS
"""Pixels of the sketch per pixel of the strip."""
_H = HEIGHT_ROWS * _FINE
"""Pixels per character height."""


def sketch_strips(
    fonts: Sequence[Path],
    rng: np.random.Generator,
    *,
    # share of the second photographs in plain print, as the public network learned it: so it forgets no letters
    printed: float = 0.25,
) -> list[TrainingStrip]:
    """Strips of a line as felt or measured, and twice as photographed. Raises MarksError: draw again."""
    font = draw_font(fonts, rng)
    text = "".join(map(str, rng.integers(0, 10, 6))) if rng.random() < 0.12 else draw_text(font, rng)
    line = sketch(font, text, rng)
    felt = rng.random() < 0.75
    layers = [("felt" if felt else "heights", _touch(line, rng) if felt else _measure(line))]
    layers += [("photo", photograph(line, rng))]
    layers += [("photo", _print(line, rng) if rng.random() < printed else photograph(line, rng))]
    places = tuple((x0 / _FINE, x1 / _FINE) for x0, _, x1, _ in line.boxes)
    return [
        TrainingStrip(each.astype(np.float16), text, source, line.severity, places) for source, each in layers
    ]


def _small(field: Field) -> Field:
    size = (field.shape[1] // _FINE, field.shape[0] // _FINE)
    return np.asarray(cv2.resize(field, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _measure(drawn: Sketch) -> Field:
    layers = np.zeros((LAYERS, TALL_ROWS, drawn.surface.shape[1] // _FINE), dtype=np.float32)
    layers[HEIGHTS] = _small(drawn.surface)
    layers[HEIGHTS] -= np.median(layers[HEIGHTS])
    layers[KNOWN] = 1.0
    return layers


def _touch(drawn: Sketch, rng: np.random.Generator, *, preload: float = 0.2) -> Field:
    layers = _measure(drawn)
    radius = float(rng.uniform(0.03, 0.16)) * _H
    ball = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (max(1, round(0.5 * radius)) * 2 + 1,) * 2)
    felt = _small(blur(np.asarray(cv2.dilate(drawn.surface, ball), dtype=np.float32), 0.3 * radius))
    felt -= np.median(felt)
    rows, columns = felt.shape
    lines = float(rng.uniform(10.0, 40.0)) / HEIGHT_ROWS
    if lines < 1.0:
        coarse = cv2.resize(felt, (round(columns * lines), round(rows * lines)), interpolation=cv2.INTER_AREA)
        felt = np.asarray(
            cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_LINEAR), dtype=np.float32
        )
    layers[HEIGHTS] = felt
    dx, dy = (np.gradient(felt, axis=axis) * HEIGHT_ROWS for axis in (1, 0))
    lift, slope = felt / preload, float(rng.uniform(0.4, 1.0))
    grit = float(rng.uniform(0.0, 0.03))
    for k, edge in enumerate((lift + slope * dx, lift + slope * dy, lift - slope * dx, lift - slope * dy)):
        grain = blur(rng.standard_normal(felt.shape).astype(np.float32), 0.6)
        layers[EDGES + k] = np.clip(edge + grit * grain, -8.0, 8.0)
    return layers


def photograph(drawn: Sketch, rng: np.random.Generator) -> Field:
    """Photograph a sketch under a lamp from one side, as layers of a strip."""
    shape = drawn.surface.shape
    z = drawn.surface + 0.004 * float(rng.uniform(0, 1)) * rng.standard_normal(shape).astype(np.float32)
    z = blur(z, float(rng.uniform(0.5, 1.5)))
    gx, gy = (np.gradient(z, axis=axis) * _H for axis in (1, 0))
    norm = np.sqrt(1.0 + gx * gx + gy * gy)
    azimuth, high = float(rng.uniform(0, 2 * np.pi)), np.radians(float(rng.uniform(15.0, 75.0)))
    light = np.array([np.cos(azimuth) * np.cos(high), np.sin(azimuth) * np.cos(high), np.sin(high)])
    diffuse = np.maximum((-gx * light[0] - gy * light[1] + light[2]) / norm, 0.0)
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    gloss = np.maximum((-gx * half[0] - gy * half[1] + half[2]) / norm, 0.0) ** float(rng.uniform(5.0, 80.0))
    albedo = float(rng.uniform(0.3, 0.8)) * (
        1.0 + 0.25 * float(rng.uniform(0, 1)) ** 2 * rough_noise(shape, _H, rng)
    )
    if rng.random() < 0.45:  # ink or filling of the marks is darker or lighter
        share = float(rng.uniform(0.2, 1.0)) * np.clip(drawn.ink, 0.0, 1.0)
        patchy = (
            np.clip(0.8 + 0.5 * rough_noise(shape, 0.8 * _H, rng), 0.0, 1.0) if rng.random() < 0.5 else 1.0
        )
        albedo = albedo * (1 - share * patchy) + share * patchy * float(rng.choice([0.05, 0.15, 0.9]))
    dirty = np.clip(drawn.soil / 0.012, 0.0, 1.0)
    grime = float(rng.uniform(0.05, 0.8)) * (1.0 + 0.35 * rough_noise(shape, 0.3 * _H, rng))
    albedo = albedo * (1 - dirty) + grime * dirty
    if drawn.severity and rng.random() < 0.5:  # stains without height
        stain = np.clip(
            rough_noise(shape, float(rng.uniform(0.3, 2.0)) * _H, rng) - 1.2 + drawn.severity, 0.0, 1.0
        )
        albedo = albedo * (1 - stain * float(rng.uniform(0.1, 0.8)))
    ambient = float(rng.uniform(0.1, 0.6))
    shine = float(rng.choice([0.0, rng.uniform(0.0, 1.2)])) * (1 - 0.8 * dirty)
    image = np.clip(albedo, 0.02, 1.0) * (ambient + (1 - ambient) * diffuse) + shine * gloss
    image *= np.exp(0.5 * float(rng.uniform(0, 1)) * noise(shape, (3 * _H, 4 * _H), rng))
    if rng.random() < 0.15:  # a lamp's reflection
        image += 2.0 * np.maximum(noise(shape, (1.5 * _H, 2 * _H), rng) - 1.2, 0.0)
    return _take_picture(np.asarray(image, dtype=np.float32), rng)


def _print(line: Sketch, rng: np.random.Generator) -> Field:
    paper, ink = rng.uniform(0.0, 1.0, 2)
    return _take_picture(
        np.asarray(paper + (ink - paper) * np.clip(line.ink, 0.0, 1.0), dtype=np.float32), rng
    )


def _take_picture(image: Field, rng: np.random.Generator) -> Field:
    image = blur(image, float(rng.uniform(0.0, 0.05)) * _H)
    pixels = float(np.exp(rng.uniform(np.log(14.0), np.log(56.0)))) / _H
    size = (round(image.shape[1] * pixels), round(image.shape[0] * pixels))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    low, high = np.percentile(small, [1.0, 99.0])
    target = np.sort(rng.uniform(0.02, 1.02, 2))
    small = (small - low) / max(float(high - low), 1e-3) * max(float(target[1] - target[0]), 0.12) + target[0]
    small += float(rng.uniform(0.0, 1.0)) ** 2 * 0.06 * rng.standard_normal(small.shape).astype(np.float32)
    eight = np.asarray(
        255.0 * np.clip(small, 0.0, 1.0) ** float(np.exp(rng.normal(0.0, 0.25))), dtype=np.uint8
    )
    if rng.random() < 0.4:
        _, file = cv2.imencode(".jpg", eight, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 95))])
        eight = np.asarray(cv2.imdecode(file, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    layers = np.zeros((LAYERS, TALL_ROWS, image.shape[1] // _FINE), dtype=np.float32)
    whole = cv2.resize(eight, (layers.shape[2], TALL_ROWS), interpolation=cv2.INTER_LINEAR)
    layers[GREY], layers[KNOWN] = whole.astype(np.float32) / 255.0, 1.0
    return layers
