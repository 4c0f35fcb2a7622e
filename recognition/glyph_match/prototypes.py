"""Prototypes: predicted characters of a face as features of the recogniser, in a few numbers each.

    font --plate, touch or lamp--> strip --recogniser's middle--> features --window of a character, map--> prototypes
    part --the same--------------> strip --recogniser's middle--> features --window of a place, map------> cosines

The recogniser was trained on lines with dirt, wear and different lights, so a dirty mark and the predicted clean one
have similar features. Nothing is trained for a font. Each feature is normalised by its mean and spread along predicted
plates. Of the 19,584 features of a window a linear map, the principal components of many faces, keeps what
distinguishes characters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.shading import Light
from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import default_die
from recognition.glyph_match.kept_predictions import load_or_predict
from recognition.glyph_match.predicted import (
    CANONICAL_HEIGHT_MM,
    TemplateSet,
    ideal_plate,
    line_of,
    lit_views,
)
from recognition.recogniser.recogniser import FEATURE_COLUMNS, Features, features_of
from recognition.see.text_line import HEIGHT_ROWS, MARGIN
from recognition.see.view import View

LIGHTS = (*(Light(azimuth_deg=azimuth) for azimuth in (45.0, 135.0, 225.0, 315.0)), Light(elevation_deg=75.0))
"""Lights of predicted photographs: lamps from four sides, and a high one; 3 % more are accepted than by it alone."""
HALF_STEPS = 8
"""Steps of features on either side of a character's middle: as wide as a W."""
STEPS = 2 * HALF_STEPS + 1

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FeatureMap:
    """Linear map from windows of features to the numbers of prototypes."""

    mean: Features  # (features * rows,) mean and standard deviation of each feature along predicted plates
    spread: Features
    of_step: Features  # (features * rows, S) components of one step
    of_window: Features  # (STEPS * S, N) components of a window

    def components(self, features: Features) -> tuple[Features, Features]:
        """(steps, S) components of each step of a strip, and (steps,) its squared length."""
        normal = ((features.reshape(-1, features.shape[-1]).T - self.mean) / self.spread).astype(np.float32)
        return normal @ self.of_step, np.asarray(np.einsum("sf,sf->s", normal, normal))

    def numbers(self, windows: Features) -> Features:
        """(n, N) numbers of (n, STEPS, S) windows."""
        return windows.reshape(len(windows), -1) @ self.of_window


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Characters of faces, by one touch or under each of several lights."""

    names: tuple[str, ...]
    chars: tuple[str, ...]
    # (F, lights, T, N) mapped windows, divided by their length before the map; 0 of a character that the face
    # lacks
    numbers: Features
    # (F, T) half the width of a character's window, steps; 0 of a character that the face lacks
    half: Features

    def of(self, faces: NDArray[np.intp]) -> Prototypes:
        return Prototypes(
            tuple(self.names[k] for k in faces), self.chars, self.numbers[faces], self.half[faces]
        )


@dataclass(frozen=True, eq=False)
class PlaceWindows:
    """The (moves, places, N) mapped windows about the places of a line, moved by some steps to either side."""

    numbers: Features
    squares: Features


def felt_prototypes(templates: TemplateSet, map: FeatureMap, name: str) -> Prototypes:
    """Prototypes of a font by touch; cached in the set."""

    def make() -> Prototypes:
        view, where = templates.view, (templates.middles_mm, templates.half_width)
        arrays = load_or_predict(
            ("felt", view.layers, view.pitch_mm, *where, map), lambda: _prototypes([view], *where, map)
        )
        return Prototypes((name,), templates.chars, **arrays)

    prototypes: Prototypes = templates.derive("prototypes", make)
    return prototypes


def lit_prototypes(
    font: Font, chars: str, map: FeatureMap, *, lights: Sequence[Light] = LIGHTS
) -> Prototypes:
    """Prototypes of a font by camera, under each of several lights. Raises FontError or StampError."""

    def make() -> dict[str, Features]:
        plate = ideal_plate(font, chars, die)
        return _prototypes(lit_views(plate, lights), plate.middles_mm, plate.half_width, map)

    die = default_die(CANONICAL_HEIGHT_MM, font=font)
    arrays = load_or_predict(("lit", *(font.glyph(char) for char in chars), die, *lights, map), make)
    return Prototypes((font.name,), tuple(chars), **arrays)


def _prototypes(
    views: Sequence[View], middles_mm: Floats, half_width: Floats, map: FeatureMap
) -> dict[str, Features]:
    half, columns, line = half_steps(half_width), plate_columns(middles_mm), line_of(middles_mm)
    shown = [own_windows(features_of(view.strip(line)), columns, half, map) for view in views]
    return {
        "numbers": np.stack([map.numbers(plate_windows) for plate_windows in shown])[None],
        "half": half[None],
    }


def own_windows(features: Features, columns: Floats, half: Features, map: FeatureMap) -> Features:
    """(T, STEPS, S) windows of a plate's characters, each within its ink and of length 1 before the map."""
    components, squares = map.components(features)
    weights = own_steps(half)
    length = np.sqrt(np.einsum("ts,ts->t", windows(squares, columns), weights))
    return np.asarray(windows(components, columns) * (weights / length[:, None])[..., None])


def half_steps(half_width: Floats, *, beside_steps: float = 2.0) -> Features:
    """Half the widths of characters' windows, steps."""
    return (half_width * HEIGHT_ROWS / FEATURE_COLUMNS + beside_steps).astype(np.float32)


def own_steps(half: Features) -> Features:
    """(..., STEPS) weight of each step in windows of (...) half widths, 0 to 1."""
    return np.clip(half[..., None] - np.abs(np.arange(-HALF_STEPS, HALF_STEPS + 1)), 0.0, 1.0).astype(
        np.float32
    )


def plate_columns(middles_mm: Floats) -> Floats:
    """Columns of the middles of a plate's characters in the strip of its line."""
    line = line_of(middles_mm)
    along = np.linalg.norm(middles_mm - line.centre_mm[0], axis=1) / line.height_mm
    return np.asarray((along + MARGIN) * HEIGHT_ROWS - 0.5)


def windows(values: Features, columns: Floats, half: int = HALF_STEPS) -> Features:
    """(places, 2 * half + 1, ...) windows of (steps, ...) values about columns of a strip; 0 beyond it."""
    steps = np.rint((columns + 0.5) / FEATURE_COLUMNS - 0.5).astype(np.intp)
    steps = np.clip(steps, 0, len(values) - 1)
    padded = np.pad(values, ((half, half), *((0, 0),) * (values.ndim - 1)))
    return np.asarray(padded[steps[:, None] + np.arange(2 * half + 1)])


def place_windows(
    features: Features, columns: Floats, map: FeatureMap, *, moved_steps: int = 3
) -> PlaceWindows:
    """Map the windows about the places of a line."""
    components, squares = (
        windows(values, columns, HALF_STEPS + moved_steps) for values in map.components(features)
    )
    moves = range(2 * moved_steps + 1)
    numbers = [map.numbers(components[:, k : k + STEPS]) for k in moves]
    return PlaceWindows(np.stack(numbers), np.stack([squares[:, k : k + STEPS] for k in moves]))


def cosines(
    places: PlaceWindows, prototypes: Prototypes, *, moved: bool = True, move_cost: float = 0.007
) -> Features:
    """(F, lights, places, T) greatest cosine of every prototype with every place over small moves."""
    faces, lights, chars, count = prototypes.numbers.shape
    # with the factors in this order, the same product takes a third of the time
    flat, weights = prototypes.numbers.reshape(-1, count), own_steps(prototypes.half).reshape(-1, STEPS)
    middle = len(places.numbers) // 2
    best: Features | None = None
    for move in range(len(places.numbers)) if moved else (middle,):
        cosine = (flat @ places.numbers[move].T).reshape(faces, lights, chars, -1)
        cosine /= np.sqrt(np.maximum(weights @ places.squares[move].T, 1e-12)).reshape(faces, 1, chars, -1)
        cosine -= np.float32(move_cost * abs(move - middle))
        best = cosine if best is None else np.maximum(best, cosine, out=best)
    assert best is not None
    return np.swapaxes(best, 2, 3)
