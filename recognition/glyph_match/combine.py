"""Combine what recogniser, faces and depths say of each place, with fitted weights.

    cosines of all places --each face, and no face--> p(face) --mixture--> log m(c) of each place
    log p(c) = w_network log n(c) + w_faces log m(c) + w_depths log d(c)            up to a constant

"No face", whose characters all have the same cosine, wins where no face is near, and at a place that is covered. Each
weight rises or falls with the fit of the faces to the line. Weights are in `combine.fit.json`; `python
tests/benchmarks/fit_experts.py` fits them: a conditional logit of the true character of each place.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax

from recognition.glyph_match.prototypes import Floats

FITTED = Path(__file__).with_name("combine.fit.json")
NO_FACE = ""
"""Name of the answer that no face fits."""


@dataclass(frozen=True)
class ExpertWeights:
    """Weights of one sense."""

    sharpness: float  # log likelihood of a character per unit of cosine
    together: float  # share of the places' log likelihoods that counts for the face: neighbours err alike
    no_face: float
    covered: float  # probability that a place shows nothing although the face fits
    named: float  # log odds of a named font to a face of the library, before anything is seen
    # weight of the recogniser, and its rise per unit of fit (`FaceBelief.fit`); the same of faces, and of
    # depths, times the probability of the font along which they were compared
    network: float
    network_fit: float
    faces: float
    faces_fit: float
    depths: float
    depths_fit: float
    # probability that depths say nothing: a stroke that dirt fills is one event, however many samples it has
    filled: float


@cache
def fitted_weights(sense: str) -> ExpertWeights:
    """Load the fitted weights of a sense: "tactile" or "vision"."""
    return ExpertWeights(**json.loads(FITTED.read_text(encoding="utf-8"))["weights"][sense])


@dataclass(frozen=True, eq=False)
class LineExperts:
    """What the experts say of a line; leading axes, of several lines, are allowed everywhere."""

    # (..., places, C) log posteriors of the recogniser; -inf of a character that is not allowed
    network: Floats
    cosines: Floats  # (..., F, places, C) cosines of faces (`FaceCosines`)
    named: NDArray[np.bool_]
    # (..., places, C) log likelihoods of the depths; NaN where a character was not compared
    depths: Floats | None = None
    depth_face: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class FaceBelief:
    """What the faces say of a line."""

    faces: Floats
    # (..., places, C) log posteriors by the faces alone; the probabilities of a place sum to that of a face
    # showing there
    log: Floats
    fit: Floats  # (...,) by how much the faces' fits exceed that of no face, the mean by probability


def believe_faces(line: LineExperts, weights: ExpertWeights) -> FaceBelief:
    """Infer the face of a line from all places, and each character from the faces, or else from the recogniser."""
    prior = log_softmax(line.network, axis=-1)
    lacks = np.isfinite(prior) & np.isnan(line.cosines).all(axis=-3)
    nothing = np.where(np.isfinite(prior) & ~lacks, weights.no_face, np.nan)[..., None, :, :]
    log = weights.sharpness * np.concatenate([line.cosines, nothing], axis=-3)
    log = np.where(np.isnan(log), -np.inf, log)
    explained = np.maximum(np.logaddexp.reduce(log + prior[..., None, :, :], axis=-1), -1e3)
    odds = weights.together * explained.sum(axis=-1)
    odds[..., :-1] += weights.named * line.named
    faces = np.exp(log_softmax(odds, axis=-1))
    in_none = np.arange(faces.shape[-1]) == faces.shape[-1] - 1
    with np.errstate(divide="ignore"):
        at_place = np.log((1.0 - weights.covered) * faces + weights.covered * in_none)[..., None]
        mixture = np.logaddexp.reduce(log + at_place[..., None], axis=-3)
        unknown = np.exp(np.where(lacks, prior, -np.inf)).sum(axis=-1, keepdims=True)
        # no face has any character that a place may hold, such as small letters
        none = np.isneginf(mixture).all(axis=-1, keepdims=True)
        known = np.log1p(-np.minimum(unknown, 1.0)) + log_softmax(np.where(none, 0.0, mixture), axis=-1)
        known = np.where(none, -np.inf, known)
        shows = np.log1p(-np.exp(log_softmax(explained + at_place, axis=-2)[..., -1, :, None]))
    best = np.fmax.reduce(line.cosines, axis=-1, initial=weights.no_face - 1.0).mean(axis=-1)
    fit = (faces[..., :-1] * (best - weights.no_face)).sum(axis=-1)
    return FaceBelief(faces, np.where(lacks, prior, known) + shows, fit)


def combine_experts(line: LineExperts, belief: FaceBelief, weights: ExpertWeights) -> Floats:
    """(..., places, C) log posteriors of all experts together; a place counts as read if one of them has read it."""

    def at_fit(weight: float, rise: float) -> Floats:
        return np.maximum(weight + rise * belief.fit, 0.0)[..., None, None]

    network, faces = (log_softmax(log, axis=-1) for log in (line.network, belief.log))
    log = at_fit(weights.network, weights.network_fit) * network
    log = log + at_fit(weights.faces, weights.faces_fit) * np.where(np.isfinite(faces), faces, 0.0)
    if line.depths is not None and line.depth_face is not None:
        font = (belief.faces[..., :-1] * line.depth_face).sum(axis=-1)[..., None, None]
        log += font * at_fit(weights.depths, weights.depths_fit) * _limited(line.depths, weights.filled)
    read = np.maximum(
        *(np.logaddexp.reduce(log, axis=-1, keepdims=True) for log in (line.network, belief.log))
    )
    return np.asarray(np.minimum(log_softmax(log, axis=-1) + read, 0.0))


def _limited(depths: Floats, filled: float) -> Floats:
    best = np.fmax.reduce(depths, axis=-1, keepdims=True, initial=-1e9)
    relative = np.where(np.isnan(depths), 0.0, depths - best)
    return np.asarray(np.log((1.0 - filled) * np.exp(relative) + filled))
