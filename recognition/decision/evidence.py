"""Measures of a reading, some twenty named numbers: posteriors, strokes, size and depth of marks, rough land.

The score weighs some of them (`recognition.decision.score`). All are compared between parts that were certified and
parts that are read (`recognition.decision.likeness`).
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from recognition.decision.certified import DIGITS
from recognition.decision.reading import Reading

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo

_NORMAL = 1.4826
"""Standard deviation of normal noise whose median absolute deviation is 1."""


class Measure(StrEnum):
    """Measures of a part; the value is the name that people read."""

    CONFIDENCE = "confidence"
    ODDS = "log odds of the text before anything else is known"
    CAMERA = "log odds of the text by the camera, beside touch"
    MARGIN = "least margin"
    BELIEF = "belief before the format"
    EVIDENCE = "evidence against the strongest rival (nats)"
    FORMAT = "log probability of all that the format allows"
    STROKES = "share of strokes felt"
    LEAST_STROKES = "share of the strokes felt of the character that has the least"
    COVERED = "greatest share of deciding strokes that are covered"
    UNLIKENESS = "share of the marks that known fonts leave unexplained"
    HEIGHT = "character height (mm)"
    DEPTH = "mean depth (mm)"
    FINE = "fine roughness (µm)"
    COARSE = "coarse roughness (µm)"
    FINE_SHARE = "fine roughness in parts of the marks' depth"
    COARSE_SHARE = "coarse roughness in parts of the marks' depth"
    GRAIN = "grain of the photograph"
    PATCHES = "patches of the photograph"


def measures_of(
    reading: Reading, *, fine_mm: float = 0.1, coarse_mm: float = 0.4, fine_px: int = 1, coarse_px: int = 4
) -> Mapping[Measure, float]:
    """Return the measures that are known of the part.

    Args:
        reading: of the part.
        fine_mm: between places of the land whose heights are compared for fine roughness: grains.
        coarse_mm: the same for coarse roughness: lumps.
        fine_px: the same as `fine_mm` on a photograph.
        coarse_px: the same as `coarse_mm` on a photograph.
    """
    found: dict[Measure, float | None] = {
        Measure.CONFIDENCE: round(reading.confidence, DIGITS),
        Measure.ODDS: _within(reading.trace.odds),
        Measure.CAMERA: _within(reading.trace.camera_odds),
        Measure.FORMAT: reading.trace.evidence,
        Measure.LEAST_STROKES: min(
            (p.felt for p in reading.trace.strokes if p.felt is not None), default=None
        ),
        Measure.COVERED: _greatest_cover(reading),
        Measure.MARGIN: min((c.margin for c in reading.characters), default=0.0),
        Measure.BELIEF: _belief(reading),
        Measure.EVIDENCE: reading.evidence_margin,
        Measure.STROKES: reading.strokes_felt,
        Measure.UNLIKENESS: reading.unlikeness,
        Measure.HEIGHT: reading.height_mm if reading.scaled and reading.height_mm > 0.0 else None,
        Measure.DEPTH: reading.depth_mean_mm,
    }
    touch, vision = reading.touch, reading.vision
    if touch is not None and touch.trace.relief is not None:
        relief = touch.trace.relief
        heights_um = 1e3 * relief.height_mm.astype(np.float64)
        found[Measure.FINE] = roughness(heights_um, max(1, round(fine_mm / relief.pitch_mm)))
        found[Measure.COARSE] = roughness(heights_um, max(1, round(coarse_mm / relief.pitch_mm)))
        if touch.trace.felt_line is not None:
            depth_um = 1e3 * touch.trace.felt_line.depth_mm()
            for share, rough in ((Measure.FINE_SHARE, Measure.FINE), (Measure.COARSE_SHARE, Measure.COARSE)):
                rough_um = found[rough]
                found[share] = None if rough_um is None else rough_um / max(depth_um, 1.0)
    if vision is not None and vision.trace.photo is not None:
        grey = _evenly_lit(vision.trace.photo)
        found[Measure.GRAIN], found[Measure.PATCHES] = roughness(grey, fine_px), roughness(grey, coarse_px)
    return {name: float(value) for name, value in found.items() if value is not None and np.isfinite(value)}


def roughness(surface: NDArray[np.float64], step: int, *, enough_samples: int = 100_000) -> float | None:
    """Roughness of the land, in the unit of the surface; marks and edges hardly count.

    The standard deviation of normal noise with the same median of |z(-step) - 2 z(0) + z(+step)| / sqrt(6).

    Args:
        surface: (rows, cols), NaN where not known.
        step: samples between the three.
        enough_samples: samples of a surface that are used; their median is off by half a per cent.
    """
    # of a large picture every n-th row says the median as well
    every = max(1, round(surface.size / enough_samples))
    bends = [
        np.abs(z[::every, 2 * step :] - 2.0 * z[::every, step:-step] + z[::every, : -2 * step]).ravel()
        for z in (surface, surface.T)
        if z.shape[1] > 2 * step
    ]
    known = np.concatenate([b[np.isfinite(b)] for b in bends]) if bends else np.zeros(0)
    return float(_NORMAL * np.median(known) / np.sqrt(6.0)) if known.size else None


def _within(odds: float | None, *, most_odds: float = 50.0) -> float | None:
    """Log odds as a number: certainty is no missing value, but `most_odds`."""
    return None if odds is None else min(max(odds, -most_odds), most_odds)


def _greatest_cover(reading: Reading, *, deciding_heights: float = 0.25) -> float | None:
    """Greatest share of the strokes that only a rival has where nothing could be felt; None where none were asked.

    Args:
        reading: with the strokes in its trace.
        deciding_heights: length from which strokes that only one of two characters has decide between them, character
            heights.
    """
    places = reading.trace.strokes
    hidden = (r.hidden for place in places for r in place.rivals if r.more_heights >= deciding_heights)
    return max(hidden, default=0.0) if places else None


def _belief(reading: Reading) -> float | None:
    """Mean over places of the belief in the likeliest character, before the format has its say."""
    first = reading.touch or reading.vision
    lattice = None if first is None else first.trace.open_lattice
    if lattice is None or lattice.n_places == 0:
        return None
    return float(np.exp(lattice.log_belief.max(axis=1)).mean())


def _evenly_lit(photo: Photo, *, darkest: float = 1.0 / 255.0) -> NDArray[np.float64]:
    """Brightness over its median, so that exposure does not count.

    Args:
        photo: of the part.
        darkest: median brightness of a photograph that shows nothing.
    """
    grey = np.asarray(photo.grey(), dtype=np.float64)
    return grey / max(float(np.median(grey)), darkest)
