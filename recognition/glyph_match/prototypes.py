"""Prototypes: predicted characters of a font as features of the recogniser, compared with those of a strip.

    font --plate, touch or lamp--> strip --recogniser's middle--> features --window of a character--> prototypes
    part --the same--------------> strip --recogniser's middle--> features --window of a place------> cosines

The recogniser was trained on lines with dirt, wear and different lights. Therefore a dirty mark and the predicted clean
one have similar features, although their maps differ. Nothing is trained for a font, so a new one works as well as a
known one. A cosine is computed over the window of the prototype's ink and all features. Each feature is normalised by
its mean and spread along the predicted plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.shading import Light
from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import default_die
from recognition.glyph_match.kept_predictions import Arrays, kept
from recognition.glyph_match.predicted import (
    CANONICAL_HEIGHT_MM,
    TemplateSet,
    ideal_plate,
    line_of,
    lit_views,
)
from recognition.language.lattice import Lattice
from recognition.recogniser.recogniser import FEATURE_COLUMNS, Features, features_of
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import View

LIGHTS = (*(Light(azimuth_deg=azimuth) for azimuth in (45.0, 135.0, 225.0, 315.0)), Light(elevation_deg=75.0))
"""Lights of predicted photographs: lamps from four sides, and a high one. Of 100 soiled photographs 41
are accepted with all of them, and 38 with the high one alone."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Prototypes:
    """A font's characters as features.

    Attributes:
        chars: (T,) characters.
        values: (T, features, rows, steps) normalised by `mean` and `spread`; 0 beyond a character's own steps.
        own: (T, steps) weight of each step, 0 to 1.
        mean, spread: (features, 1, 1) mean and standard deviation along the predicted plate.
    """

    chars: tuple[str, ...]
    values: Features
    own: Features
    mean: Features
    spread: Features


def felt_prototypes(templates: TemplateSet) -> Prototypes:
    """Prototypes of a font by touch; cached in the set."""

    def make() -> Prototypes:
        one = templates
        where = (one.middles_mm, one.half_width)
        found = kept(("felt", one.view.layers, one.view.pitch_mm, *where), lambda: cut_out(one.view, *where))
        return Prototypes(one.chars, **found)

    made: Prototypes = templates.derive("prototypes", make)
    return made


def lit_prototypes(font: Font, chars: str, *, lights: Sequence[Light] = LIGHTS) -> tuple[Prototypes, ...]:
    """Prototypes of a font by camera, under each of several lights.

    Args:
        font: the font.
        chars: characters of the font.
        lights: lights under which photographs are predicted.

    Raises:
        FontError: a character that the font lacks.
        StampError: an invalid die.
    """

    def make() -> Arrays:
        plate = ideal_plate(font, chars, die)
        made = [cut_out(view, plate.middles_mm, plate.half_width) for view in lit_views(plate, lights)]
        return {name: np.stack([one[name] for one in made]) for name in made[0]}

    die = default_die(CANONICAL_HEIGHT_MM, font=font)
    found = kept(("lit", *map(font.glyph, chars), die, *lights), make)
    of_lights = (dict(zip(found, one, strict=True)) for one in zip(*found.values(), strict=True))
    return tuple(Prototypes(tuple(chars), **one) for one in of_lights)


def cut_out(
    view: View,
    middles_mm: Floats,
    half_width: Floats,
    *,
    half_steps: int = 8,
    beside_steps: float = 2.0,
    least_spread: float = 1e-3,
) -> Arrays:
    """Cut the values of `Prototypes`, by name, out of a view of the plate.

    Args:
        view: view of the plate.
        middles_mm: (T, 2) x, y of the middles of the characters.
        half_width: (T,) half the ink's width, character heights.
        half_steps: steps of features on either side of a character's middle: as wide as a W.
        beside_steps: steps beside a character's ink that count as its own.
        least_spread: added to the spread of each feature, which may be 0.
    """
    line = line_of(middles_mm)
    features = features_of(view.strip(line))
    mean = features.mean(axis=(1, 2), keepdims=True)
    spread = features.std(axis=(1, 2), keepdims=True) + least_spread
    along = np.linalg.norm(middles_mm - line.centre_mm[0], axis=1) / line.height_mm
    windows = _windows((features - mean) / spread, (along + MARGIN) * HEIGHT_ROWS - 0.5, half_steps)
    steps = np.abs(np.arange(-half_steps, half_steps + 1))
    half = half_width[:, None] * HEIGHT_ROWS / FEATURE_COLUMNS
    own = np.clip(half + beside_steps - steps, 0.0, 1.0).astype(np.float32)
    return {"values": windows * own[:, None, None], "own": own, "mean": mean, "spread": spread}


def match_fonts(
    views: Sequence[View],
    line: TextLine,
    columns: Floats,
    fonts: Sequence[Sequence[Prototypes]],
    lattice: Lattice,
) -> tuple[Lattice, int]:
    """Match the best-fitting font to the places of a line: return its lattice and index.

    Args:
        views: views of one part, in one frame.
        line: line of the characters.
        columns: (places,) columns of the characters in its strip.
        fonts: prototypes of each font (at least one), for each touch or light; each view uses those that fit it best.
        lattice: posteriors of the other experts.
    """
    seen = [features_of(view.strip(line)) for view in views]
    tried = []
    for font in fonts:
        suited = [max((cosines(one, columns, lit) for lit in font), key=_suits) for one in seen]
        tried.append((np.mean(suited, axis=0), font[0].chars))
    best = max(range(len(tried)), key=lambda k: _suits(tried[k][0]))
    return lattice_of(*tried[best], lattice), best


def _suits(cosine: Floats) -> float:
    """Fit of a font to a line: the mean over places of its best cosine."""
    return float(cosine.max(axis=1).mean())


def cosines(
    features: Features,
    columns: Floats,
    prototypes: Prototypes,
    *,
    moved_steps: int = 3,
    move_cost: float = 0.007,
) -> Floats:
    """(places, T) greatest cosine of every prototype with every place over small shifts.

    Args:
        features: features of a strip.
        columns: (places,) columns of the characters in the strip.
        prototypes: prototypes of a font.
        moved_steps: greatest error of a place, steps.
        move_cost: loss of cosine per step.
    """
    seen = (features - prototypes.mean) / prototypes.spread
    wide = prototypes.own.shape[1]
    windows = _windows(seen, columns, wide // 2 + moved_steps)
    squares = (windows**2).sum(axis=(1, 2))
    count = len(prototypes.chars)
    flat = prototypes.values.reshape(count, -1)
    size = np.sqrt(
        (prototypes.values**2 / np.maximum(prototypes.own, 1e-6)[:, None, None]).sum(axis=(1, 2, 3))
    )
    best = np.full((columns.size, count), -1.0)
    for move in range(2 * moved_steps + 1):
        now = slice(move, move + wide)
        product = windows[..., now].reshape(columns.size, -1) @ flat.T
        energy = np.sqrt(squares[:, now] @ prototypes.own.T)
        cost = move_cost * abs(move - moved_steps)
        np.maximum(best, product / np.maximum(size * energy, 1e-9) - cost, out=best)
    return best


def lattice_of(cosine: Floats, chars: Sequence[str], lattice: Lattice, *, sharpness: float = 28.0) -> Lattice:
    """Turn cosines into a lattice over the characters that another lattice allows.

    A character that the font lacks is as likely as the font's least likely one.

    Args:
        cosine: (places, T).
        chars: (T,) characters of the prototypes.
        lattice: posteriors of the other experts.
        sharpness: log odds per unit of cosine; best of 16 to 36 on 40 parts (320 characters) drawn like the
            exam's, without what is reserved for the exam. Log loss of the templates alone is 0.080 (0.091 at 20), of
            the recogniser alone 0.075, of their mean 0.071.
    """
    allowed = np.isfinite(lattice.log_belief)
    log = np.full(allowed.shape, np.nan)
    for k, char in enumerate(chars):
        if char in lattice.chars:
            log[:, lattice.chars.index(char)] = sharpness * cosine[:, k]
    log = np.where(allowed, log, np.nan)
    known = np.isfinite(log)
    least = np.where(known, log, np.inf).min(axis=1, keepdims=True)
    log = np.where(known, log, np.where(allowed, np.where(np.isfinite(least), least, 0.0), -np.inf))
    log -= np.logaddexp.reduce(log, axis=1, keepdims=True)
    return replace(lattice, log_belief=np.minimum(log, 0.0))


def _windows(features: Features, columns: Floats, half: int) -> Features:
    """(places, features, rows, 2 * half + 1) about columns of a strip; 0 beyond it."""
    steps = np.rint((columns + 0.5) / FEATURE_COLUMNS - 0.5).astype(np.intp)
    padded = np.pad(features, ((0, 0), (0, 0), (half, half)))
    steps = np.clip(steps, 0, features.shape[2] - 1)
    return np.stack([padded[..., step : step + 2 * half + 1] for step in steps])
